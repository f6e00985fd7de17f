//! The virtual arm: logs of which the truth is known.

use crate::failure::{input, refused};
use crate::work;
use powerball::commands::demo::{Session, SessionError, names};
use pyo3::prelude::*;
use std::path::PathBuf;

/// The arm file, logs to fit, logs of other paths, and what is in the plant: name, joints, words.
type Recorded = (PathBuf, Vec<PathBuf>, Vec<PathBuf>, (String, Vec<usize>, String));

/// The effects that a virtual arm may have.
#[pyfunction]
pub(crate) fn virtual_effects() -> Vec<&'static str> {
    names()
}

/// Records a session with an arm of which the model does not know everything.
#[pyfunction]
#[pyo3(signature = (folder, seed, effect, progress))]
pub(crate) fn virtual_session(
    py: Python<'_>,
    folder: PathBuf,
    seed: u64,
    effect: Option<String>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Recorded> {
    powerball::report::files::make_folder(&folder).map_err(input)?;
    let session = work::run(py, progress.as_ref(), move |progress| {
        progress.say("searching exciting paths and recording them");
        let named = effect.as_deref().map_or_else(names, |name| vec![name]);
        Session::record(&folder, seed, &named)
    })?;
    let session = session.map_err(|e| match e {
        SessionError::UnknownEffect(_) | SessionError::Write(..) => input(e),
        _ => refused(e),
    })?;
    let effect = &session.effect;
    let joints = effect.joints();
    let truth = (effect.name().to_string(), joints, effect.describe());
    Ok((session.arm_file, session.fit, session.held_out, truth))
}
