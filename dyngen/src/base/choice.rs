//! Which base columns to keep: those whose regressor is the cheapest.
//!
//! A few rules of choice give a start. From each, a kept column is exchanged for one that depends on it as
//! long as that makes the code cheaper. All columns are built once, as one graph, in which the cost of a
//! choice is counted. Functions of parameter values do not depend on the choice: they sum the parameters up
//! in their own way.

use super::plain::full_set;
use super::preference::Preference;
use crate::arm::Arm;
use crate::dynamics::angles::Angles;
use crate::dynamics::build::{self, Subject};
use crate::dynamics::chain::Origins;
use crate::dynamics::stage::Form;
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{Dependence, Unproven};
use crate::exact::symbols::AngleSymbols;
use crate::graph::Expr;
use crate::lagrangian::elements::joint_symbols;
use crate::optimize::PASSES;

/// A rule that was tried, with what the regressor costs for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The rule.
    pub preference: Preference,
    /// Columns that were exchanged for cheaper ones.
    pub exchanged: usize,
    /// Multiplications and additions of the regressor in all.
    pub operations: usize,
}

/// The cheapest base columns, and the result of the search from every rule; of equal costs the first rule
/// wins.
///
/// Where angles are kept as symbols eliminations are slow, and the first rule's columns are taken without a
/// search.
///
/// # Errors
/// Those of `eliminate`.
pub fn cheapest(
    arm: &Arm,
    symbols: &AngleSymbols,
    field: &ConstantField,
    eliminate: impl Fn(Preference) -> Result<Dependence, Unproven>,
) -> Result<(Dependence, Vec<Candidate>), Unproven> {
    let [first, others @ ..] = Preference::ALL;
    let start = eliminate(first)?;
    let all = AllColumns::build(&Subject { arm, angles: &Angles::new(arm), symbols, field, minimal: &start });
    let search = joint_symbols(arm) == 0;
    let (mut best, candidate) = all.improved(field, start, first, search);
    let mut candidates = vec![candidate];
    let others = if search { &others[..] } else { &[] };
    for preference in others {
        let (found, candidate) = all.improved(field, eliminate(*preference)?, *preference, search);
        if candidates.iter().all(|c| candidate.operations < c.operations) {
            best = found;
        }
        candidates.push(candidate);
    }
    Ok((best, candidates))
}

/// The candidate that was chosen.
pub fn chosen(candidates: &[Candidate]) -> Option<&Candidate> {
    // `min_by_key` takes the first of equals.
    candidates.iter().min_by_key(|c| c.operations)
}

/// The regressor of every parameter that the arm keeps, in every form.
struct AllColumns {
    forms: Vec<FunctionGraph>,
    /// For each parameter of the arm, its column.
    place: Vec<Option<usize>>,
}

impl AllColumns {
    fn build(subject: &Subject<'_>) -> Self {
        let full = full_set(subject.arm, subject.field);
        let mut place = vec![None; subject.arm.all_parameters().len()];
        for (column, parameter) in full.parameters.iter().enumerate() {
            place[parameter.carriers[0].0.index()] = Some(column);
        }
        let build = |form| build::build_in(form, None, Function::Regressor, subject, &full, None, PASSES);
        AllColumns {
            forms: [Origins::Inner, Origins::Outer].into_iter().flat_map(Form::all).map(build).collect(),
            place,
        }
    }

    /// The cost of some columns in a form: operations, and the additions among them.
    fn cost(&self, form: &FunctionGraph, kept: &[usize]) -> (usize, usize) {
        let (rows, columns) = form.shape;
        let outputs: Vec<Expr> = (kept.iter().filter_map(|k| self.place[*k]))
            .flat_map(|c| (0..rows).map(move |r| r * columns + c))
            .map(|k| form.outputs[k])
            .collect();
        let operations = form.graph.operations(&outputs);
        (operations.mul + operations.add, operations.add)
    }

    /// Exchanges columns as long as that makes the code cheaper.
    fn improved(
        &self,
        field: &ConstantField,
        mut dependence: Dependence,
        preference: Preference,
        search: bool,
    ) -> (Dependence, Candidate) {
        let costs = self.forms.iter().map(|form| (self.cost(form, &dependence.kept), form));
        // There is a form.
        let (mut operations, form) =
            costs.min_by_key(|(cost, _)| *cost).unwrap_or(((usize::MAX, 0), &self.forms[0]));
        let mut exchanged = 0;
        if search {
            while let Some((cost, position, column)) = self.best_exchange(form, &dependence, operations) {
                let Some(next) = exchange(field, &dependence, position, column) else { break };
                (dependence, operations, exchanged) = (next, cost, exchanged + 1);
            }
        }
        (dependence, Candidate { preference, exchanged, operations: operations.0 })
    }

    /// The exchange that costs least, where one costs less than `operations`: its cost, the position and the
    /// column that comes there.
    fn best_exchange(
        &self,
        form: &FunctionGraph,
        dependence: &Dependence,
        operations: (usize, usize),
    ) -> Option<((usize, usize), usize, usize)> {
        let mut best: Option<((usize, usize), usize, usize)> = None;
        for (column, coordinates) in dependence.coordinates.iter().enumerate() {
            if dependence.kept.contains(&column) {
                continue;
            }
            for (position, _) in coordinates {
                let mut kept = dependence.kept.clone();
                kept[*position] = column;
                let cost = self.cost(form, &kept);
                if cost < best.map_or(operations, |b| b.0) {
                    best = Some((cost, *position, column));
                }
            }
        }
        best
    }
}

/// The dependence with another column kept at a position; the column must depend on the one that was kept
/// there.
fn exchange(field: &ConstantField, from: &Dependence, position: usize, column: usize) -> Option<Dependence> {
    let entering = &from.coordinates[column];
    let pivot = entering.iter().find(|(p, _)| *p == position).map(|(_, c)| c)?;
    let mut to = from.clone();
    to.kept[position] = column;
    for coordinates in &mut to.coordinates {
        let Some(index) = coordinates.iter().position(|(p, _)| *p == position) else { continue };
        let factor = field.div(&coordinates[index].1, pivot)?;
        coordinates[index].1 = factor.clone();
        for (p, value) in entering.iter().filter(|(p, _)| *p != position) {
            let change = field.neg(&field.mul(&factor, value));
            match coordinates.iter_mut().find(|(q, _)| q == p) {
                Some((_, old)) => *old = field.add(old, &change),
                None => coordinates.push((*p, change)),
            }
        }
        coordinates.retain(|(_, c): &(usize, Constant)| !c.is_zero());
        coordinates.sort_by_key(|(p, _)| *p);
    }
    Some(to)
}
