//! What does not change while effects are looked for.

use crate::explanation::effects::MotionColumns;
use crate::explanation::options::ExplainOptions;
use crate::explanation::rule::Rule;
use crate::identification::estimate::Folds;
use crate::logs::regression::Data;

/// The logs as rows, how they are held out, and what the search was told.
pub(super) struct Study<'a> {
    /// The logs to fit.
    pub(super) data: Data<'a>,
    /// Their columns that do not depend on the model.
    pub(super) columns: MotionColumns,
    /// The validation set: logs of another path, on which additions must hold.
    pub(super) validation: Data<'a>,
    /// How the logs to fit are held out.
    pub(super) folds: Folds,
    /// Whether the validation set repeats the path of the fitted logs.
    pub(super) one_path: bool,
    /// What it was told beside the logs.
    pub(super) options: &'a ExplainOptions<'a>,
}

impl Study<'_> {
    /// The thresholds.
    pub(super) fn rule(&self) -> &Rule {
        &self.options.rule
    }

    /// Says what is being done.
    pub(super) fn say(&self, what: &str) {
        self.options.progress.say(what);
    }
}
