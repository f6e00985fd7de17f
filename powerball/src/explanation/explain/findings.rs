//! What was found, from which the result is made.

use super::comparison::History;
use super::model::Model;
use super::named::FalsePositives;
use super::prepare::Beforehand;
use super::special::{RestPush, predicts_better};
use super::study::Study;

/// Everything that the result says something of.
pub(super) struct Findings<'a> {
    pub(super) study: Study<'a>,
    /// What was known before the search.
    pub(super) beforehand: Beforehand,
    /// What the search accepted.
    pub(super) model: Model,
    /// What its steps decided.
    pub(super) history: History,
    /// What pushed the arm while it stood still.
    pub(super) at_rest: Vec<RestPush>,
    /// How often it is wrong on these data.
    pub(super) false_positives: FalsePositives,
}

impl<'a> Findings<'a> {
    /// The other findings where their model predicts the validation set clearly better.
    pub(super) fn or_better(self, other: Findings<'a>) -> Findings<'a> {
        let better = predicts_better((&other.study, &other.model), (&self.study, &self.model));
        if better { other } else { self }
    }
}
