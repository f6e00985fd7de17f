//! What an identification or an explanation of position servos is given: logs, and the masses of the arm.

use super::ServoArm;
use crate::identify::{IdentifyError, no_log_in_both};
use crate::source::{Input, Source};
use dyngen::{Arm, Values};
use powerball_logs::Progress;
use powerball_logs::log::{self, LogError, ServoLog};
use std::path::Path;

/// An arm on position servos with its logs, read.
#[derive(Debug)]
pub struct ServoInput {
    /// The arm with what is known of it.
    pub arm: ServoArm,
    /// The logs to fit.
    pub fit: Vec<ServoLog>,
    /// The logs to judge by.
    pub validate: Vec<ServoLog>,
    /// What is to be reported about masses, arm file and logs.
    pub warnings: Vec<String>,
}

/// Whether logs are those of position servos: the first one says it for all.
#[must_use]
pub fn are_of_servos(logs: &[Source<'_>], arm: &Arm) -> bool {
    logs.first().is_some_and(|source| match &source.input {
        Input::File(path) => log::is_of_servos(path, arm, &source.map),
        Input::Servos(_) => true,
        Input::Log(_) | Input::Summary(_) => false,
    })
}

impl ServoInput {
    /// Reads all logs, to fit and to judge by. Masses are `values`; where there are none, those of
    /// ARM.values.json next to the arm file, which `dyngen import` writes.
    ///
    /// # Errors
    /// Arms, masses and logs that cannot be used: every reason.
    pub fn read(
        arm: &Arm,
        (values, file): (Option<Values>, Option<&Path>),
        (fit, validate): (&[Source<'_>], &[Source<'_>]),
        progress: Progress<'_>,
    ) -> Result<ServoInput, IdentifyError> {
        let mut warnings = Vec::new();
        let values = match (values, file.map(|file| file.with_extension("values.json"))) {
            (None, Some(imported)) if imported.is_file() => {
                warnings.push(format!("{}: the masses are taken from it", imported.display()));
                Some(Values::read(&imported).map_err(|e| IdentifyError::Known(e.to_string()))?)
            }
            (values, _) => values,
        };
        let servos = ServoArm::new(arm, values.as_ref())?;
        no_log_in_both(fit, validate)?;
        progress.say("reading logs");
        warnings.extend(arm.notes());
        let (mut logs, mut unusable) = (Vec::new(), Vec::new());
        for source in fit.iter().chain(validate) {
            match read(source, arm, &mut warnings) {
                Ok(log) => logs.push(log),
                Err(reasons) => unusable.extend(reasons),
            }
        }
        if !unusable.is_empty() {
            return Err(IdentifyError::Unusable(unusable));
        }
        ServoLog::common_clock(logs.iter_mut());
        let validate = logs.split_off(fit.len());
        Ok(ServoInput { arm: servos, fit: logs, validate, warnings })
    }
}

/// The log of a source; what is odd about a file is added to `warnings`.
fn read(source: &Source<'_>, arm: &Arm, warnings: &mut Vec<String>) -> Result<ServoLog, Vec<String>> {
    if source.mounting.is_some() {
        return Err(vec![format!("{}: --mounting is of logs with torques", source.name())]);
    }
    match &source.input {
        Input::Servos(log) => Ok(log.as_ref().clone()),
        Input::File(path) => {
            let (log, findings) = ServoLog::read(path, arm, &source.map)
                .map_err(|LogError(reasons)| reasons.iter().map(ToString::to_string).collect::<Vec<_>>())?;
            warnings.extend(findings.iter().map(ToString::to_string));
            Ok(log)
        }
        Input::Log(_) | Input::Summary(_) => Err(vec![format!(
            "{}: has torques, and the first log is of position servos (goal1 … and no torque)",
            source.name()
        )]),
    }
}
