//! The data and options that do not change during the search.

use crate::effects::{Context, Made};
use crate::options::ExplainOptions;
use crate::rule::Rule;
use powerball_identification::estimate::{Fit, Folds};
use powerball_logs::regression::Data;

/// The logs as rows, how they are held out, and what was given to the search.
pub(super) struct Study<'a> {
    /// The logs to fit.
    pub(super) data: Data<'a>,
    /// Columns of the logs to fit that were made already.
    pub(super) made: Made,
    /// The validation set: logs of another path, on which additions must hold.
    pub(super) validation: Data<'a>,
    /// Columns of the validation set that were made already.
    pub(super) made_on_validation: Made,
    /// How the logs to fit are held out.
    pub(super) folds: Folds,
    /// Whether the validation set repeats the path of the fitted logs.
    pub(super) one_path: bool,
    /// The options of the search.
    pub(super) options: &'a ExplainOptions<'a>,
}

impl<'a> Study<'a> {
    /// This study with one multibody model for all joints.
    pub(super) fn joint_fit(&self) -> Study<'a> {
        let [made, made_on_validation] = [Made::default(), Made::default()];
        let (data, validation) = (self.data.joint_fit(), self.validation.joint_fit());
        let Study { ref folds, one_path, options, .. } = *self;
        Study { data, made, validation, made_on_validation, folds: folds.clone(), one_path, options }
    }

    /// The thresholds.
    pub(super) fn rule(&self) -> &Rule {
        &self.options.rule
    }

    /// How long the fitted logs are, s.
    pub(super) fn fitted_time(&self) -> f64 {
        self.data.recordings.iter().map(|r| r.len() as f64 / r.rate).sum()
    }

    /// A model on the fitted logs, with its residual.
    pub(super) fn on_fitted<'c>(&'c self, fit: &'c Fit, residual: &'c [Vec<f64>]) -> Context<'c> {
        Context::new(&self.data, fit, residual, self.rule()).with(&self.made)
    }

    /// A model on the validation set, with its residual.
    pub(super) fn on_validation<'c>(&'c self, fit: &'c Fit, residual: &'c [Vec<f64>]) -> Context<'c> {
        Context::new(&self.validation, fit, residual, self.rule()).with(&self.made_on_validation)
    }

    /// Says what is being done.
    pub(super) fn say(&self, what: &str) {
        self.options.progress.say(what);
    }
}
