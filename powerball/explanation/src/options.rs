//! The options of an explanation, and its errors.

use super::rule::Rule;
use super::torque_model::{FileError, TorqueModel, Unchanged};
use powerball_controller::JointNumber;
use powerball_logs::Progress;
use powerball_logs::regression::{DataError, DataOptions};

/// The options of an explanation in addition to the arm and the logs. By default there is no known model and
/// no progress report.
#[derive(Clone, Debug, Default)]
pub struct ExplainOptions<'a> {
    /// The thresholds of the rule.
    pub rule: Rule,
    /// How logs are prepared.
    pub data: DataOptions,
    /// The known model: that of an earlier explanation for the same arm file. Its torque is subtracted from
    /// the logs without changes; new effects are added to it.
    pub known: Option<TorqueModel>,
    /// Whether the search runs again without each log in turn, so that names which need one log are marked
    /// (see [`Again`](crate::explain::Again)); nothing is marked below
    /// [`FEWEST_LOGS`](crate::explain::FEWEST_LOGS). It takes that many times longer.
    pub leave_one_out: bool,
    /// Names that an experiment has ruled out.
    pub ruled_out: Vec<RuledOut>,
    /// Who wants to know what is being done.
    pub progress: Progress<'a>,
}

/// A name that an experiment has ruled out on some joints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RuledOut {
    /// The name.
    pub effect: String,
    /// The joints.
    pub joints: Vec<JointNumber>,
    /// The name that the experiment favours instead.
    pub in_favour_of: String,
    /// The reason.
    pub why_not: String,
}

/// Why logs cannot be explained.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ExplainError {
    /// The logs to fit hold too little.
    #[error("--log: {0}")]
    Fit(#[source] DataError),
    /// The validation logs hold too little.
    #[error("--validate: {0}")]
    Validate(#[source] DataError),
    /// The arm's dynamics cannot be derived, or those of the arm that was found.
    #[error("{0}")]
    Arm(#[source] dyngen::Error),
    /// The known model, or the result, has a change that is impossible for the arm.
    #[error("{0}")]
    Changes(#[source] Unchanged),
    /// The known model is another arm's.
    #[error("{0}")]
    Known(#[source] FileError),
}
