//! `explain`.

use crate::arm::Arm;
use crate::failure::{input, refused};
use crate::identify::{ModelText, Written, model_file};
use crate::logs::{Given, column_map, taken};
use crate::motion::Trajectory;
use crate::servos::{Masses, Servos, with_torques};
use crate::work;
use powerball::ExplainOptions;
use powerball::explanation::{ExplainError, Prepared, Rule};
use powerball::identification::servo::are_of_servos;
use powerball::identification::{IdentifyError, Recorded};
use powerball::report::{self, Files};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Why there is no explanation.
enum Why {
    Logs(IdentifyError),
    Explain(ExplainError),
}

/// The result of an explanation.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct Explained {
    files: Files,
    model: String,
    trajectory: Option<Trajectory>,
}

#[pymethods]
impl Explained {
    /// explained.json.
    fn json(&self) -> String {
        self.files.first()
    }

    /// model.json.
    fn model_json(&self) -> String {
        self.model.clone()
    }

    /// The path that tells apart what these logs leave open.
    fn trajectory(&self) -> Option<Trajectory> {
        self.trajectory.clone()
    }

    /// The files that the command writes.
    fn save(&self, folder: PathBuf) -> PyResult<()> {
        self.files.write(&folder).map_err(input)
    }
}

/// An explanation of torques, or of position servos.
#[derive(IntoPyObject)]
pub(crate) enum Explanation {
    Torques(Explained),
    Servos(Written),
}

/// Explains what the base model of an arm lacks on logs.
#[pyfunction]
#[pyo3(signature = (arm, log, validate, map, model, values, rule, progress))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn explain(
    py: Python<'_>,
    arm: &Arm,
    log: Vec<Given<'_>>,
    validate: Vec<Given<'_>>,
    map: Vec<String>,
    model: Option<ModelText>,
    values: Masses,
    rule: &str,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Explanation> {
    let map = column_map(&map)?;
    let rule = Rule::from_json(rule).map_err(input)?;
    let (logs, validate) = (taken(&arm.arm, &log, &map)?, taken(&arm.arm, &validate, &map)?);
    if are_of_servos(&logs.sources, &arm.arm) {
        let servos = Servos::new(arm, values, model.is_some(), (logs, validate))?;
        return servos.explain(py, rule, progress.as_ref()).map(Explanation::Servos);
    }
    let arm = with_torques(arm, &values)?.clone();
    let name = model.as_ref().map(|(_, name)| name.clone());
    let known = model.as_ref().map(model_file).transpose()?.map(|file| file.model);
    let done = work::run(py, progress.as_ref(), move |progress| -> Result<_, Why> {
        progress.say("reading logs");
        let recorded = Recorded::read(&arm, &logs.sources, &validate.sources).map_err(Why::Logs)?;
        let options = ExplainOptions { rule, known, progress, ..ExplainOptions::default() };
        let prepared =
            Prepared::new(&arm, &recorded.fit, &recorded.validate, &options).map_err(Why::Explain)?;
        let (mut explained, motion) = prepared.explained(&options).map_err(Why::Explain)?;
        let found = logs.findings.into_iter().chain(validate.findings).chain(recorded.warnings);
        explained.warnings.splice(0..0, arm.notes().into_iter().chain(found));
        Ok((prepared.with_known(explained), motion))
    })?;
    let (explained, motion) = done.map_err(|why| match (why, name) {
        (Why::Logs(e), _) if e.is_input() => input(e),
        (Why::Logs(e), _) => refused(e),
        (Why::Explain(e @ (ExplainError::Changes(_) | ExplainError::Known(_))), Some(name)) => {
            input(format!("{name}: {e}"))
        }
        (Why::Explain(e), _) => refused(e),
    })?;
    let mut files = report::explained::files(&explained).map_err(refused)?;
    if let Some(motion) = &motion {
        files = files.with(powerball::explanation::experiment::TRAJECTORY, motion.to_csv());
    }
    let model = report::files::json(&explained.model).map_err(refused)?;
    Ok(Explanation::Torques(Explained { files, model, trajectory: motion.map(Trajectory) }))
}

/// Every threshold of `explain` with its default, as JSON.
#[pyfunction]
pub(crate) fn rule() -> PyResult<String> {
    report::files::json(&Rule::default()).map_err(refused)
}
