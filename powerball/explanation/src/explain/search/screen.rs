//! Candidates as questions to the model so far.

use crate::effects::{Candidate, Context};
use powerball_controller::JointNumber;
use powerball_identification::evidence::{Base, FoldFits, Rows, Trial};
use std::ops::Range;

/// The base model prepared for many candidates.
#[derive(Debug)]
pub(crate) struct Screen<'c> {
    /// The model and its residual.
    pub(crate) context: &'c Context<'c>,
    /// The model on its rows.
    pub(crate) base: Base<'c>,
    /// The model without each fold.
    pub(crate) folds: FoldFits<'c>,
}

impl<'c> Screen<'c> {
    /// Prepares the base model of a context.
    #[must_use]
    pub(crate) fn new(context: &'c Context<'c>) -> Screen<'c> {
        Screen::without(context, 0..0)
    }

    /// Like [`Self::new`], without some of the model's columns, of whose torque the context's residual is
    /// free.
    #[must_use]
    pub(crate) fn without(context: &'c Context<'c>, columns: Range<usize>) -> Screen<'c> {
        let Context { data, fit, residual, rule, .. } = *context;
        let free: Vec<bool> =
            fit.free.iter().enumerate().map(|(c, free)| *free && !columns.contains(&c)).collect();
        let solver = fit.normal_equations().solver(|c| free[c]);
        let rows = Rows { data, design: &fit.design, residual };
        let base = Base::new(rows, &fit.weights, solver, rule.per_coefficient);
        Screen { context, base, folds: FoldFits::new(fit, free) }
    }

    /// Tries a candidate; `None` where it has no usable column or is physically impossible.
    #[must_use]
    pub(crate) fn try_candidate(&self, candidate: &Candidate) -> Option<Trial> {
        let effect = candidate.effect();
        let trial = self.base.ask(self.context.columns(candidate), candidate.searched)?;
        let sound = !(effect.non_negative() && trial.theta.iter().any(|t| *t <= 0.0));
        let possible = effect.admissible(candidate, &trial.theta)
            && effect.possible(self.context, candidate, &trial.theta);
        (sound && possible).then_some(trial)
    }

    /// The gain by joint: on the only joint all of it, else where the squared error falls.
    #[must_use]
    pub(crate) fn gains(&self, trial: &Trial, joints: &[JointNumber]) -> Vec<(JointNumber, f64)> {
        if let [joint] = joints {
            return vec![(*joint, trial.gain)];
        }
        let (added, rows) = (self.base.added(trial), &self.base.rows);
        let fall = |j: usize| self.base.weights[j] * rows.fall(&added, j, 0..rows.residual[j].len());
        joints.iter().map(|j| (*j, fall(j.index()))).collect()
    }
}
