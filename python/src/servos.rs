//! Logs of position servos, as `identify` and `explain` take them.

use crate::arm::{Arm, named_values};
use crate::failure::{input, refused};
use crate::identify::{Written, failure};
use crate::logs::Taken;
use crate::work;
use dyngen::Values;
use powerball::explanation::Rule;
use powerball::explanation::servo::explain_servos;
use powerball::identification::IdentifyError;
use powerball::identification::servo::{ServoInput, identify_servos};
use powerball::logs::Progress;
use powerball::report;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Values of an arm's inertial parameters as Python gives them: a file, or by name.
pub(crate) type Masses = Option<(Option<PathBuf>, BTreeMap<String, f64>)>;

/// The arm of logs with torques, which need no masses.
pub(crate) fn with_torques<'a>(arm: &'a Arm, masses: &Masses) -> PyResult<&'a dyngen::Arm> {
    match masses {
        Some(_) => Err(input(
            "values takes logs of position servos (goal1 … and no torque); these have torques, from which \
             masses are identified",
        )),
        None => Ok(&arm.arm),
    }
}

/// Logs of position servos with what is known of their arm, not yet read.
pub(crate) struct Servos {
    arm: dyngen::Arm,
    values: Option<Values>,
    file: Option<PathBuf>,
    logs: Taken,
    validate: Taken,
}

impl Servos {
    /// Masses are those that are given, else those of the robot description.
    pub(crate) fn new(
        arm: &Arm,
        masses: Masses,
        has_model: bool,
        (logs, validate): (Taken, Taken),
    ) -> PyResult<Servos> {
        if has_model {
            return Err(input(
                "model takes logs with torques; these are of position servos (goal1 … and no torque)",
            ));
        }
        let own = (!arm.values.is_empty()).then(|| (None, arm.values.iter().cloned().collect()));
        let values = masses.or(own).map(|(file, named)| named_values(file, &named)).transpose()?;
        Ok(Servos { arm: arm.arm.clone(), values, file: arm.file.clone(), logs, validate })
    }

    fn read(self, progress: Progress<'_>) -> Result<ServoInput, IdentifyError> {
        let sources = (self.logs.sources.as_slice(), self.validate.sources.as_slice());
        let mut read = ServoInput::read(&self.arm, (self.values, self.file.as_deref()), sources, progress)?;
        read.warnings.splice(0..0, self.logs.findings.into_iter().chain(self.validate.findings));
        Ok(read)
    }

    /// What `powerball identify` writes.
    pub(crate) fn identify(self, py: Python<'_>, listener: Option<&Bound<'_, PyAny>>) -> PyResult<Written> {
        let found = work::run(py, listener, move |progress| {
            let read = self.read(progress)?;
            let mut found = identify_servos(&read.arm, &read.fit, &read.validate, progress)?;
            found.warnings.splice(0..0, read.warnings);
            Ok(found)
        })?;
        Ok(Written(report::servos::files(&found.map_err(failure)?).map_err(refused)?))
    }

    /// What `powerball explain` writes.
    pub(crate) fn explain(
        self,
        py: Python<'_>,
        rule: Rule,
        listener: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Written> {
        let found = work::run(py, listener, move |progress| {
            let read = self.read(progress)?;
            let mut found = explain_servos(&read.arm, &read.fit, &read.validate, &rule, progress)?;
            found.warnings.splice(0..0, read.warnings);
            Ok(found)
        })?;
        Ok(Written(report::servos::explained(&found.map_err(failure)?).map_err(refused)?))
    }
}
