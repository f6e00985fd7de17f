//! The findings from which the result is made.

use super::comparison::History;
use super::model::Model;
use super::named::FalsePositives;
use super::prepare::InitialFit;
use super::special::predicts_better;
use super::study::Study;
use powerball_identification::estimate::residual_stats;
use std::collections::BTreeSet;

/// Everything that the result says something of.
pub(super) struct Findings<'a> {
    pub(super) study: Study<'a>,
    /// The fit before the search.
    pub(super) initial_fit: InitialFit,
    /// The model with the accepted effects.
    pub(super) model: Model,
    /// The decisions of the steps.
    pub(super) history: History,
    /// How often it is wrong on these data.
    pub(super) false_positives: FalsePositives,
}

impl<'a> Findings<'a> {
    /// The other findings where their model predicts the validation set clearly better.
    pub(super) fn or_better(self, other: Findings<'a>) -> Findings<'a> {
        let better = predicts_better((&other.study, &other.model), (&self.study, &self.model));
        if better { other } else { self }
    }

    /// These findings if the effects that they removed from the validation set are needed there, else those
    /// of the set as logged. An incomplete base model has errors on a new path that look like a body or a
    /// pushing hand; once the missing effect is in the model, no body is needed. A needed effect removes most
    /// of the error that the other model has beyond that on its fitted logs.
    pub(super) fn or_as_logged(self, logged: Findings<'a>) -> Findings<'a> {
        let sigma = &logged.model.fit.sigma;
        let joints: BTreeSet<usize> = self
            .initial_fit
            .validation_only
            .iter()
            .flat_map(|effect| &effect.named.joints)
            .map(|j| j.index())
            .collect();
        let excess = |findings: &Findings<'_>| -> f64 {
            let study = &findings.study;
            let rms = residual_stats(&study.validation, &findings.model.residual_on_validation(study)).rms;
            let of = |j: &usize| (rms[*j] / sigma[*j]).powi(2) - 1.0;
            joints.iter().filter(|j| sigma[**j] > 0.0).map(of).sum()
        };
        let needed = excess(&self) <= self.study.rule().max_unexplained * excess(&logged);
        if needed { self } else { logged }
    }
}
