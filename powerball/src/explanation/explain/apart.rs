//! On a repeated path: one rigid body for all joints, or joints by themselves (see [`Data::take_apart`]).
//!
//! [`Data::take_apart`]: crate::logs::regression::Data::take_apart

use super::compose::Composed;
use super::forward::{ExplainError, Session};
use super::rule;
use crate::identification::estimate::fit;

/// Said where joints were taken apart.
pub(super) const APART: &str = "the logs repeat one path, and joints by themselves predict the held-out logs \
    better than a rigid body that all joints share: \
                                each joint was given inertial parameters of its own, an offset and a slope \
                                with its position, all errors here are of \
                                that model, and effects of the body (payload, base tilt, broken symmetries) \
                                were not considered; model.json holds \
                                one body for all, whose errors are larger";

impl Session<'_> {
    /// Whether this one's squared errors on the held-out logs are clearly below another's: the geometric mean
    /// over all rows, which no joint's unit rules.
    pub(super) fn predicts_better_than(&self, rival: &Session<'_>) -> bool {
        let square = |session: &Session<'_>| -> Vec<(f64, f64)> {
            let left = session.fit.residual_on(&session.other, &session.other_columns(&session.fit));
            left.iter().map(|r| (r.len() as f64, r.iter().map(|e| e * e).sum::<f64>())).collect()
        };
        let (mut log_ratio, mut rows) = (0.0, 0.0);
        for ((n, own), (_, theirs)) in square(self).into_iter().zip(square(rival)) {
            if own > 0.0 && theirs > 0.0 {
                log_ratio += n * (own / theirs).ln();
                rows += n;
            }
        }
        log_ratio < rows * (1.0 - rule::CLEARLY_BETTER).ln()
    }

    /// What joints by themselves leave, and a model of one body with the effects that were found.
    pub(super) fn composed_apart(&mut self) -> Result<Composed, ExplainError> {
        let held_out = self.fit.residual_on(&self.other, &self.other_columns(&self.fit));
        let candidates: Vec<_> = self.accepted.iter().map(|a| a.candidate.clone()).collect();
        self.take_apart(false);
        let start = fit(&self.data, &self.folds, &[], None);
        let apart = std::mem::replace(&mut self.fit, start);
        self.refit();
        let composed = self.composed();
        self.take_apart(true);
        self.fit = apart;
        self.accepted.iter_mut().zip(candidates).for_each(|(a, c)| a.candidate = c);
        Ok(Composed { model: composed?.model, fitted: self.fit.residual.clone(), held_out })
    }

    fn take_apart(&mut self, apart: bool) {
        self.data.take_apart(apart);
        self.other.take_apart(apart);
    }
}
