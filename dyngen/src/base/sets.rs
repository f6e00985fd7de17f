//! The parameter sets of an arm and the exact relations between them.

use super::certificate;
use super::choice::{self, Candidate};
use super::coefficients::{self, Sizes};
use super::plain::{full_set, named_combination_text, unexamined};
use super::preference::Preference;
use super::published;
use crate::arm::{Arm, Convention, Parameter};
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{self, Dependence, SparseRow, Unproven};
use crate::exact::prime::Draws;
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::joint_symbols;
use crate::parameters::{Combination, ParameterSet, SetKind, SetParameter, minimal_coordinates};

pub use super::plain::combination_text;

/// How well the torques determine a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// The parameter's column is zero.
    Unidentifiable,
    /// The parameter's column depends on no other.
    Alone,
    /// Only together with others.
    InCombination,
}

impl Class {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Class::Unidentifiable => "unidentifiable",
            Class::Alone => "identifiable alone",
            Class::InCombination => "identifiable in a combination",
        }
    }
}

/// Seed of the values of general angles modulo the prime; any fixed seed keeps the choice reproducible.
const SEED: u64 = 0x6479_6e67_656e;

/// All sets of an arm, in its field of constants.
#[derive(Clone, Debug)]
pub struct Sets {
    /// The field of the coefficients.
    pub field: ConstantField,
    /// The sets; `Published` only where the file has groupings.
    pub sets: Vec<ParameterSet>,
    /// The dependence of the columns for the numbers in the file.
    pub minimal: Dependence,
    /// For a standard table with general twists: the chain with frames on its joints, and the dependence of
    /// its columns, which need no fractions.
    pub on_joints: Option<(Arm, Dependence)>,
    /// Rows that span those of the Lagrangian for all the arm's parameters, those declared zero too.
    pub(super) rows: Vec<SparseRow>,
    /// The rules that were tried for the choice of the minimal set's columns.
    pub candidates: Vec<Candidate>,
}

impl Sets {
    /// Derives the sets of an arm by exact elimination on the coefficients of its Lagrangian.
    ///
    /// # Errors
    /// [`Unproven`] where a number of the arm is a multiple of the proof's prime.
    pub fn derive(arm: &Arm, symbols: &AngleSymbols) -> Result<Sets, Unproven> {
        let field = ConstantField::new(symbols, joint_symbols(arm), &mut Draws::new(SEED));
        let columns = arm.all_parameters().len();
        let eliminate_of = |arm: &Arm, rows: &[SparseRow], preference: Preference| {
            let order: Vec<usize> = preference.order(arm).iter().map(|p| p.index()).collect();
            // The result is certified by the Lagrangian itself below.
            elimination::unchecked(&field, rows, columns, &order)
        };
        let eliminate = |rows: &[SparseRow], preference: Preference| eliminate_of(arm, rows, preference);
        let all = |sizes| coefficients::all_rows(arm, symbols, &field, sizes);
        let rows = all(Sizes::Numbers)?;
        let kept = coefficients::kept(arm, &rows);
        let (minimal, candidates) = choice::cheapest(arm, symbols, &field, |p| eliminate(&kept, p))?;
        certificate::certify(arm, symbols, &field, Sizes::Numbers, &minimal)?;
        let symbolic = coefficients::kept(arm, &all(Sizes::Variables)?);
        let symbolic = eliminate(&symbolic, Preference::ALL[0])?;
        certificate::certify(arm, symbols, &field, Sizes::Variables, &symbolic)?;
        let mut sets = vec![
            full_set(arm, &field),
            base_set(SetKind::Minimal, arm, &field, &minimal),
            base_set(SetKind::Symbolic, arm, &field, &symbolic),
        ];
        if !arm.groupings.is_empty() {
            sets.push(published::published_set(arm, &field, &minimal)?);
        }
        for set in &mut sets {
            let (rank, relations) = relations(&field, &minimal, &set.parameters)?;
            (set.rank, set.relations) = (rank, relations);
        }
        let general = arm.convention == Convention::Standard && joint_symbols(arm) > 0;
        let on_joints = match general && arm.bars.is_empty() {
            true => {
                let chain = arm.on_joints();
                let rows = coefficients::all_rows(&chain, symbols, &field, Sizes::Numbers)?;
                let kept = coefficients::kept(&chain, &rows);
                let dependence = eliminate_of(&chain, &kept, Preference::ALL[0])?;
                certificate::certify(&chain, symbols, &field, Sizes::Numbers, &dependence)?;
                Some((chain, dependence))
            }
            false => None,
        };
        Ok(Sets { field, sets, minimal, on_joints, rows, candidates })
    }

    /// The set `full` alone, and nothing known of how columns depend: enough for what takes no parameters.
    pub(crate) fn underived(arm: &Arm, symbols: &AngleSymbols) -> Sets {
        let field = ConstantField::new(symbols, joint_symbols(arm), &mut Draws::new(SEED));
        let minimal =
            Dependence { kept: Vec::new(), coordinates: vec![Vec::new(); arm.all_parameters().len()] };
        let sets = vec![full_set(arm, &field)];
        Sets { field, sets, minimal, on_joints: None, rows: Vec::new(), candidates: Vec::new() }
    }

    /// The set of that kind, if the arm has it.
    pub fn get(&self, kind: SetKind) -> Option<&ParameterSet> {
        self.sets.iter().find(|set| set.kind == kind)
    }

    /// How well the torques determine a parameter of the full set.
    pub fn class(&self, parameter: Parameter) -> Class {
        let coordinates = &self.minimal.coordinates;
        let own = &coordinates[parameter.index()];
        let Some(position) = self.minimal.kept.iter().position(|k| *k == parameter.index()) else {
            return if own.is_empty() { Class::Unidentifiable } else { Class::InCombination };
        };
        let shares = |c: &Vec<(usize, Constant)>| c.iter().any(|(p, _)| *p == position);
        if coordinates.iter().filter(|c| shares(c)).count() == 1 {
            Class::Alone
        } else {
            Class::InCombination
        }
    }
}

pub(super) fn base_set(
    kind: SetKind,
    arm: &Arm,
    field: &ConstantField,
    dependence: &Dependence,
) -> ParameterSet {
    let all = arm.all_parameters();
    let mut parameters: Vec<SetParameter> = Vec::with_capacity(dependence.kept.len());
    for (position, kept) in dependence.kept.iter().enumerate() {
        let carrier = all[*kept];
        let mut terms: Combination = Vec::new();
        for (column, coordinates) in dependence.coordinates.iter().enumerate() {
            for (p, coefficient) in coordinates {
                if *p == position {
                    terms.push((all[column], coefficient.clone()));
                }
            }
        }
        // The carrier leads its sum, as in Ixx2 − Iyy2 + 49/400·m3.
        terms.sort_by_key(|(p, _)| (*p != carrier, *p));
        let one = field.rational(crate::exact::rational::integer(1));
        parameters.push(SetParameter {
            name: combination_text(field, &terms),
            terms,
            carriers: vec![(carrier, one)],
        });
    }
    parameters.sort_by_key(|p| p.carriers[0].0);
    unexamined(kind, parameters)
}

/// The rank of a set's columns and the relations among them, each as `name = combination of names`.
fn relations(
    field: &ConstantField,
    minimal: &Dependence,
    parameters: &[SetParameter],
) -> Result<(usize, Vec<String>), Unproven> {
    let coordinates: Vec<Vec<(usize, Constant)>> =
        parameters.iter().map(|p| minimal_coordinates(field, minimal, &p.carriers)).collect();
    let text = |column: usize, terms: &[(usize, Constant)], carrier: &dyn Fn(usize) -> usize| {
        let sum = terms.iter().map(|(position, c)| (parameters[carrier(*position)].name.clone(), c));
        format!("{} = {}", quoted(&parameters[column].name), quoted_sum(field, sum))
    };
    // Where each of the minimal columns is one of the set's, its coordinates are the relations.
    let one = field.rational(crate::exact::rational::integer(1));
    let mut own: Vec<Option<usize>> = vec![None; minimal.kept.len()];
    for (column, terms) in coordinates.iter().enumerate() {
        if let [(position, factor)] = &terms[..]
            && *factor == one
        {
            own[*position].get_or_insert(column);
        }
    }
    if let Some(own) = own.into_iter().collect::<Option<Vec<usize>>>() {
        let others = (0..coordinates.len()).filter(|column| !own.contains(column));
        let texts = others.map(|column| text(column, &coordinates[column], &|position| own[position]));
        return Ok((own.len(), texts.collect()));
    }
    // The rows of this small matrix are the minimal columns, its columns the set's parameters. Denominators
    // would not survive as polynomials, so the coordinates are cleared of them column by column.
    let dependence = elimination::dependence_of_columns(field, &coordinates, minimal.kept.len())?;
    let kept = &dependence.kept;
    let others = (0..coordinates.len()).filter(|column| !kept.contains(column));
    let texts =
        others.map(|column| text(column, &dependence.coordinates[column], &|position| kept[position]));
    Ok((kept.len(), texts.collect()))
}

fn quoted_sum<'a>(field: &ConstantField, terms: impl IntoIterator<Item = (String, &'a Constant)>) -> String {
    named_combination_text(field, terms.into_iter().map(|(name, c)| (quoted(&name), c)))
}

/// A name that is itself a sum stands in brackets.
fn quoted(name: &str) -> String {
    if name.contains(' ') || name.contains('*') { format!("[{name}]") } else { name.to_string() }
}
