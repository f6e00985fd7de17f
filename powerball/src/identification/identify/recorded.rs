//! The samples of all logs of a computation, read at once.

use super::error::IdentifyError;
use crate::identification::source::{Input, Source};
use crate::logs::log::{Log, LogError, common_clock, read_log_as};
use dyngen::Arm;

/// Logs to fit and logs to judge by, on a common clock, and what was found in them.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Logs to fit.
    pub fit: Vec<Log>,
    /// Logs of other paths.
    pub validate: Vec<Log>,
    /// What is odd about the files.
    pub warnings: Vec<String>,
}

impl Recorded {
    /// Reads logs of an arm, each from its file or as it is.
    ///
    /// # Errors
    /// Every log that cannot be read or is a summary, and a file that is to be fitted and to judge.
    pub fn read(arm: &Arm, logs: &[Source<'_>], validate: &[Source<'_>]) -> Result<Recorded, IdentifyError> {
        apart(logs, validate)?;
        let (mut all, mut warnings, mut unusable) = (Vec::new(), Vec::new(), Vec::new());
        for source in logs.iter().chain(validate) {
            match samples(source, arm, &mut warnings) {
                Ok(log) => all.push(log),
                Err(reasons) => unusable.extend(reasons),
            }
        }
        if !unusable.is_empty() {
            return Err(IdentifyError::Unusable(unusable));
        }
        common_clock(&mut all);
        let validate = all.split_off(logs.len());
        Ok(Recorded { fit: all, validate, warnings })
    }
}

/// There is a log to fit, and none that is fitted judges.
///
/// # Errors
/// [`IdentifyError::Setting`] and [`IdentifyError::JudgesItself`].
pub(super) fn apart(logs: &[Source<'_>], validate: &[Source<'_>]) -> Result<(), IdentifyError> {
    if logs.is_empty() {
        return Err(IdentifyError::Setting("there is no log to fit: give at least one".to_string()));
    }
    match validate.iter().find(|file| logs.iter().any(|log| log.same_file(file))) {
        Some(both) => Err(IdentifyError::JudgesItself(both.name())),
        None => Ok(()),
    }
}

/// The samples of a source; what is odd about a file is added to `warnings`.
pub(super) fn samples(
    source: &Source<'_>,
    arm: &Arm,
    warnings: &mut Vec<String>,
) -> Result<Log, Vec<String>> {
    match &source.input {
        Input::Log(log) => Ok(log.as_ref().clone()),
        Input::Summary(_) => {
            Err(vec![format!("{}: single samples are needed: give the log itself", source.name())])
        }
        Input::File(path) => {
            let mut findings = Vec::new();
            let read = read_log_as(path, arm, &source.map, &mut findings);
            warnings.extend(findings.iter().map(ToString::to_string));
            read.map_err(|LogError(reasons)| reasons.iter().map(ToString::to_string).collect())
        }
    }
}
