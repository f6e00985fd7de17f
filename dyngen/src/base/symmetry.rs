//! The saving of each declared symmetry: the arm's file declares a parameter zero, and this is the number of
//! removed parameters.

use super::coefficients;
use super::preference::Preference;
use super::sets::Sets;
use crate::arm::{Arm, Parameter};
use crate::exact::elimination::{self, SparseRow, Unproven};
use crate::parameters::Combination;

/// The effect on the torques of a parameter that is declared zero, in addition to the kept parameters.
#[derive(Clone, Debug)]
pub enum Removed {
    /// Nothing: its column is zero, with or without the symmetry.
    Nothing,
    /// A base parameter of its own: without this symmetry the rank is greater by one.
    BaseParameter,
    /// A term of other base parameters: the rank stays, and the parameter acts as this combination of kept
    /// ones.
    Term(Combination),
}

/// A declared symmetry with its saving.
#[derive(Clone, Debug)]
pub struct Symmetry {
    /// The parameter that is declared zero.
    pub parameter: Parameter,
    /// The saving of this declaration.
    pub removed: Removed,
}

/// Each declared symmetry of an arm, by itself, for the numbers in its file.
///
/// # Errors
/// Those of [`Sets::derive`].
pub fn symmetries(arm: &Arm, sets: &Sets) -> Result<Vec<Symmetry>, Unproven> {
    let field = &sets.field;
    let mut without: Arm = arm.clone();
    (0..arm.bodies()).for_each(|body| without.declared_zero_mut(body).clear());
    let rows = coefficients::kept(&without, &sets.rows);
    let kept: Vec<usize> = Preference::ALL[0].order(arm).iter().map(|p| p.index()).collect();
    let all = arm.all_parameters();
    let declared = all.iter().filter(|p| without.keeps(**p) && !arm.keeps(**p));
    declared
        .map(|parameter| {
            let own = parameter.index();
            let takes_part = |column: &usize| *column == own || kept.contains(column);
            let mut some: Vec<SparseRow> =
                rows.iter().map(|row| row.iter().filter(|(c, _)| takes_part(c)).cloned().collect()).collect();
            some.retain(|row| !row.is_empty());
            // Last in the order: it is kept exactly where it depends on none of the others.
            let order: Vec<usize> = kept.iter().copied().chain([own]).collect();
            let found = elimination::dependence(field, &some, all.len(), &order)?;
            let removed = if found.kept.contains(&own) {
                Removed::BaseParameter
            } else if found.coordinates[own].is_empty() {
                Removed::Nothing
            } else {
                let terms = found.coordinates[own].iter();
                Removed::Term(terms.map(|(position, c)| (all[found.kept[*position]], c.clone())).collect())
            };
            Ok(Symmetry { parameter: *parameter, removed })
        })
        .collect()
}
