//! `identify`, `verify` and `compare`.

use crate::arm::Arm;
use crate::failure::{input, refused, value};
use crate::logs::{Given, column_map, taken};
use crate::servos::{Masses, Servos, with_torques};
use crate::work;
use powerball::comparison::{CompareError, CompareOptions};
use powerball::explanation::torque_model::{Additions, ModelFile};
use powerball::identification::estimate::FrictionKind;
use powerball::identification::servo::are_of_servos;
use powerball::identification::{Estimator, IdentifyError, KnownModel, VerifyOptions};
use powerball::report::{self, Files};
use powerball::{IdentifyOptions, Side};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// The text of a model and the name that errors give it.
pub(crate) type ModelText = (String, String);

/// A model from its text.
pub(crate) fn model_file((text, name): &ModelText) -> PyResult<ModelFile> {
    ModelFile::parse(text, Path::new(name)).map_err(input)
}

pub(crate) fn failure(e: IdentifyError) -> PyErr {
    if e.is_input() { input(e) } else { refused(e) }
}

/// The result of an identification.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct Identified {
    side: Side,
    files: Files,
}

#[pymethods]
impl Identified {
    /// identified.json.
    fn json(&self) -> String {
        self.files.first()
    }

    /// covariance.json.
    fn covariance(&self) -> PyResult<String> {
        serde_json::to_string(&self.side.uncertainty).map_err(refused)
    }

    /// The files that the command writes.
    fn save(&self, folder: PathBuf) -> PyResult<()> {
        self.files.write(&folder).map_err(input)
    }

    /// As one of two fits that are compared.
    fn side(&self, name: &str) -> ComparedSide {
        ComparedSide(Side { name: name.to_string(), ..self.side.clone() })
    }
}

/// A fit of torques, or of position servos.
#[derive(IntoPyObject)]
pub(crate) enum Fit {
    Torques(Py<Identified>),
    Servos(Written),
}

/// Fits the minimal set and friction to logs, or constants of position servos.
#[pyfunction]
#[pyo3(signature = (arm, log, validate, map, model, values, friction, estimator, progress))]
pub(crate) fn identify(
    py: Python<'_>,
    arm: &Arm,
    log: Vec<Given<'_>>,
    validate: Vec<Given<'_>>,
    map: Vec<String>,
    model: Option<ModelText>,
    values: Masses,
    friction: &str,
    estimator: &str,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Fit> {
    let friction = match friction {
        "symmetric" => FrictionKind::Symmetric,
        "asymmetric" => FrictionKind::Asymmetric,
        _ => return Err(value(format!("friction must be 'symmetric' or 'asymmetric', not '{friction}'"))),
    };
    let estimator = match estimator {
        "weighted" => Estimator::Weighted,
        "robust" => Estimator::Robust,
        "instrumental" => Estimator::Instrumental,
        _ => {
            let what = "estimator must be 'weighted', 'robust' or 'instrumental', not";
            return Err(value(format!("{what} '{estimator}'")));
        }
    };
    let map = column_map(&map)?;
    let (logs, validate) = (taken(&arm.arm, &log, &map)?, taken(&arm.arm, &validate, &map)?);
    if are_of_servos(&logs.sources, &arm.arm) {
        let servos = Servos::new(arm, values, model.is_some(), (logs, validate))?;
        return servos.identify(py, progress.as_ref()).map(Fit::Servos);
    }
    let arm = with_torques(arm, &values)?.clone();
    let known = model.as_ref().map(model_file).transpose()?;
    let (identified, known) = work::run(py, progress.as_ref(), move |progress| {
        let options = IdentifyOptions {
            friction,
            estimator,
            known: known.as_ref().map(|known| known as &dyn KnownModel),
            progress,
            ..IdentifyOptions::default()
        };
        let identified = powerball::identify(&arm, logs.sources, validate.sources, &options);
        let said = identified.map(|mut identified| {
            identified.warnings.splice(0..0, logs.findings.into_iter().chain(validate.findings));
            identified
        });
        (said, known)
    })?;
    let identified = identified.map_err(failure)?;
    let additions: Option<&Additions> = known.as_ref().map(|known| &known.model.additions);
    let files = report::identified::files(&identified, additions).map_err(refused)?;
    Py::new(py, Identified { side: Side::of("", &identified), files }).map(Fit::Torques)
}

/// What a joint's friction coefficients in covariance.json are multiplied with at a velocity.
#[pyfunction]
pub(crate) fn friction_row(gamma2: f64, gamma4: f64, velocity: f64) -> [f64; 5] {
    powerball::identification::estimate::friction_row([gamma2, gamma4], velocity)
}

/// Judges a model on logs: verified.json, with what writes its files.
#[pyfunction]
#[pyo3(signature = (arm, model, log, map, tolerance, progress))]
pub(crate) fn verify(
    py: Python<'_>,
    arm: &Arm,
    model: ModelText,
    log: Vec<Given<'_>>,
    map: Vec<String>,
    tolerance: f64,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Written> {
    let (arm, map, model) = (arm.arm.clone(), column_map(&map)?, model_file(&model)?);
    let logs = taken(&arm, &log, &map)?;
    let verified = work::run(py, progress.as_ref(), move |progress| {
        let joint_bands = model.model.joint_bands.clone();
        let options = VerifyOptions { tolerance, joint_bands, progress, ..VerifyOptions::default() };
        let verified = powerball::identification::verify(&arm, &model, logs.sources, &options);
        verified.map(|mut verified| {
            verified.warnings.splice(0..0, logs.findings);
            verified
        })
    })?;
    Ok(Written(report::verified::files(&verified.map_err(failure)?).map_err(refused)?))
}

/// A result that is there as its files.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct Written(pub(crate) Files);

#[pymethods]
impl Written {
    fn json(&self) -> String {
        self.0.first()
    }

    fn save(&self, folder: PathBuf) -> PyResult<()> {
        self.0.write(&folder).map_err(input)
    }
}

/// One of two fits that are compared.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct ComparedSide(Side);

#[pymethods]
impl ComparedSide {
    /// The result of `powerball identify`: its folder or file.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<ComparedSide> {
        Side::read(&path).map(ComparedSide).map_err(compare_failure)
    }
}

fn compare_failure(e: CompareError) -> PyErr {
    match e {
        CompareError::Different(_) | CompareError::NoErrors(_) => refused(e),
        CompareError::Unreadable(_) | CompareError::Setting(_) => input(e),
    }
}

/// Compares two fits; differences are `b` less `a`.
#[pyfunction]
pub(crate) fn compare(py: Python<'_>, a: &ComparedSide, b: &ComparedSide, level: f64) -> PyResult<Written> {
    let compared = py.detach(|| powerball::compare(&a.0, &b.0, &CompareOptions { level }));
    Ok(Written(report::compared::files(&compared.map_err(compare_failure)?).map_err(refused)?))
}
