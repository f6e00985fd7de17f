//! What the steps of the search decided.

use super::super::named::Rival;
use super::naming::Comparison;
use super::question::Question;
use crate::explanation::effects::Effect;

/// What a step decided.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) number: usize,
    pub(crate) effect: &'static dyn Effect,
    /// Squared errors before it, by joint, (N·m)² summed over rows.
    pub(crate) square_before: Vec<f64>,
    pub(crate) comparison: Comparison,
    /// What an experiment would have to decide.
    pub(crate) question: Option<Question>,
    /// rms on the validation set before it, by joint, N·m.
    pub(crate) before: Vec<f64>,
    /// … and after.
    pub(crate) after: Vec<f64>,
}

/// What the steps decided so far.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// Those whose effects stand.
    pub(crate) steps: Vec<Step>,
    /// Names that steps left open.
    pub(crate) questions: Vec<Question>,
    /// Effects that the last step refused, and why.
    pub(crate) refused: Vec<Rival>,
}
