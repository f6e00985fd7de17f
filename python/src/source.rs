//! Code and robot descriptions from models: `generate` and `export`.

use crate::arm::{Arm, function, set_kind};
use crate::failure::{input, refused, value};
use crate::identify::{ModelText, model_file};
use crate::work;
use dyngen::emit::{self, Options};
use dyngen::export::{self, Known};
use dyngen::import::{ImportError, Source};
use dyngen::{FrictionTerm, Function};
use numpy::PyReadonlyArray1;
use powerball::explanation::torque_model::{Scalar, SourceError};
use powerball::identification::KnownModel;
use powerball::identification::mounting::Mounting;
use powerball::logs::regression::RigidArm;
use pyo3::prelude::*;
use std::path::PathBuf;

fn functions(names: Option<Vec<String>>) -> PyResult<Option<Vec<Function>>> {
    names.map(|names| names.iter().map(|name| function(name)).collect()).transpose()
}

/// What `dyngen generate` writes.
#[pyfunction]
#[pyo3(signature = (arm, parameters, names, values, friction, batch, tests, contract))]
pub(crate) fn generate(
    py: Python<'_>,
    arm: &Arm,
    parameters: &str,
    names: Option<Vec<String>>,
    values: Option<PyReadonlyArray1<'_, f64>>,
    friction: Vec<String>,
    batch: bool,
    tests: bool,
    contract: bool,
) -> PyResult<String> {
    let model = arm.model(py)?;
    let friction: Result<Vec<FrictionTerm>, String> = friction.iter().map(|term| term.parse()).collect();
    let options = Options {
        parameters: set_kind(parameters)?,
        functions: functions(names)?.unwrap_or_else(|| Function::common().collect()),
        values: values.map(|v| v.as_array().to_vec()),
        friction: friction.map_err(value)?,
        batch,
        tests,
        contract,
    };
    work::run(py, None, move |_| emit::source(&model, &options))?.map_err(refused)
}

/// What `powerball generate` writes, and what a controller cannot make up for.
#[pyfunction]
#[pyo3(signature = (arm, model, scalar, names))]
pub(crate) fn generate_model(
    py: Python<'_>,
    arm: &Arm,
    model: ModelText,
    scalar: &str,
    names: Option<Vec<String>>,
) -> PyResult<(String, Vec<String>)> {
    let scalar = match scalar {
        "f32" => Scalar::F32,
        "f64" => Scalar::F64,
        _ => return Err(value(format!("scalar must be 'f32' or 'f64', not '{scalar}'"))),
    };
    let names = functions(names)?.unwrap_or_default();
    let file = model_file(&model)?;
    let known = file.arm(&arm.arm, Mounting::Filed).map_err(input)?;
    let arm = arm.arm.clone();
    work::run(py, None, move |_| {
        let body = RigidArm::new(&known).map_err(refused)?;
        let model = file.checked(&body).map_err(input)?;
        let source = model.source(&arm, scalar, &names).map_err(|e| match e {
            SourceError::Changes(_) | SourceError::Prefix(_) => input(e),
            SourceError::Generator(_) | SourceError::Coupled => refused(e),
        })?;
        Ok((source, model.not_compensated()))
    })?
}

/// The text of a robot description with what it includes.
#[pyfunction]
pub(crate) fn description(path: PathBuf) -> PyResult<String> {
    Ok(Source::read(&path).map_err(input)?.text)
}

/// A copy of the robot description that the arm was imported from, with values; and what is to be reported
/// about it.
#[pyfunction]
#[pyo3(signature = (arm, values, friction, uncertain))]
pub(crate) fn export_imported(
    arm: &Arm,
    values: ModelText,
    friction: Option<ModelText>,
    uncertain: bool,
) -> PyResult<(String, Vec<String>)> {
    let Some(origin) = &arm.origin else {
        return Err(value(
            "only an arm from a URDF or a MuJoCo model can be exported: use from_urdf or from_mjcf",
        ));
    };
    let friction = friction.as_ref().map(|(text, file)| (text.as_str(), file.as_str()));
    let mut known = Known::read(&arm.arm, (&values.0, &values.1), friction).map_err(refused)?;
    let mut notes = if uncertain { Vec::new() } else { known.without_uncertain_damping(&arm.arm) };
    let write = if origin.mjcf { export::mjcf } else { export::urdf };
    let exported = write(&origin.text, &origin.file, &arm.arm, &known, &origin.options);
    let exported = exported.map_err(|e| match e {
        ImportError::Unreadable(_) => input(e),
        ImportError::Refused(_) => refused(e),
    })?;
    notes.extend(exported.notes);
    Ok((exported.text, notes))
}
