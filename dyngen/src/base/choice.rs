//! Which base columns to keep: those whose code is the cheapest, among a few rules of choice.

use super::preference::Preference;
use super::sets::{SetKind, base_set};
use crate::arm::Arm;
use crate::dynamics::function::Subject;
use crate::dynamics::{Function, function};
use crate::exact::constant::ConstantField;
use crate::exact::elimination::{Dependence, Unproven};
use crate::exact::symbols::AngleSymbols;
use crate::optimize::PASSES;

/// The functions whose cost is counted: those that run in a control loop or over a log.
pub const COUNTED: [Function; 1] = [
    Function::Regressor,
];

/// A rule that was tried, with the multiplications and additions of [`COUNTED`] under it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The rule.
    pub preference: Preference,
    /// Multiplications and additions in all.
    pub operations: usize,
}

/// The base columns of the cheapest rule, and what every rule costs; of equal costs the first rule wins.
///
/// Where angles are kept as symbols their eliminations are slow, and only the first rule is tried.
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
    let cost = |dependence: &Dependence| -> usize {
        let set = base_set(SetKind::Minimal, arm, field, dependence);
        let subject = Subject { arm, symbols, field, minimal: dependence };
        let built = |f: Function| function::build(f, &subject, &set, None, PASSES).operations();
        COUNTED.iter().map(|f| built(*f)).map(|o| o.mul + o.add).sum()
    };
    let mut best = eliminate(first)?;
    let mut candidates = vec![Candidate { preference: first, operations: cost(&best) }];
    let mut lowest = candidates[0].operations;
    let others = if symbols.angles.is_empty() { &others[..] } else { &[] };
    for preference in others {
        let dependence = eliminate(*preference)?;
        let operations = cost(&dependence);
        candidates.push(Candidate { preference: *preference, operations });
        if operations < lowest {
            (best, lowest) = (dependence, operations);
        }
    }
    Ok((best, candidates))
}

/// The candidate that was chosen.
pub fn chosen(candidates: &[Candidate]) -> Option<&Candidate> {
    // `min_by_key` takes the first of equals.
    candidates.iter().min_by_key(|c| c.operations)
}
