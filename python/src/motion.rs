//! Trajectories: `excite`, and the next experiment.

use crate::arm::{Arm, set_kind};
use crate::failure::{input, refused, value};
use crate::work;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use powerball::identification::excite::{
    CLEARANCE, Collision, Criterion, Error, ExcitationSettings, ExciteOptions, FloorAt, MassSource, Mounting,
    RADIUS, excite as search, searches,
};
use powerball::identification::motion::Motion;
use powerball::report;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Samples of a motion from rest to rest.
#[pyclass(frozen, module = "powerball._core")]
#[derive(Clone)]
pub(crate) struct Trajectory(pub(crate) Motion);

/// Times (N,), then positions, velocities and accelerations (N, n).
type Arrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

#[pymethods]
impl Trajectory {
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Arrays<'py>> {
        let motion = &self.0;
        let (count, dof) = (motion.len(), motion.dof());
        let times = (0..count).map(|k| k as f64 * motion.period).collect();
        let table = |x: &[f64]| PyArray1::from_slice(py, x).reshape([count, dof]);
        Ok((PyArray1::from_vec(py, times), table(&motion.q)?, table(&motion.dq)?, table(&motion.ddq)?))
    }

    fn csv(&self) -> String {
        self.0.to_csv()
    }
}

/// Exciting trajectories.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct Excited {
    json: String,
    page: String,
    trajectories: Vec<Trajectory>,
}

#[pymethods]
impl Excited {
    fn json(&self) -> String {
        self.json.clone()
    }

    fn page(&self) -> String {
        self.page.clone()
    }

    fn trajectories(&self) -> Vec<Trajectory> {
        self.trajectories.clone()
    }
}

/// The options of `powerball excite`, by the names of its flags.
#[derive(FromPyObject)]
pub(crate) struct Asked {
    parameters: String,
    period: f64,
    harmonics: usize,
    periods: usize,
    ramp: f64,
    margin: f64,
    objective: String,
    weight: f64,
    mounting: Vec<String>,
    /// A height, "none", or nothing given.
    floor: Option<Floor>,
    radius: Option<f64>,
    clearance: Option<f64>,
    no_collision: bool,
    /// Text and name of the values.
    values: Option<(String, String)>,
    no_torque: bool,
    from_: Option<Vec<f64>>,
    evaluations: usize,
    rate: f64,
    seed: u64,
}

#[derive(FromPyObject)]
enum Floor {
    Height(f64),
    Word(String),
}

/// Searches exciting trajectories within an arm's limits and surroundings.
#[pyfunction]
#[pyo3(signature = (arm, asked, progress))]
pub(crate) fn excite(
    py: Python<'_>,
    arm: &Arm,
    asked: Asked,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Excited> {
    let criterion = match asked.objective.as_str() {
        "condition" => Criterion::Condition { lambda2: asked.weight },
        "volume" => Criterion::Volume,
        other => return Err(value(format!("objective must be 'condition' or 'volume', not '{other}'"))),
    };
    let floor = match &asked.floor {
        None => None,
        Some(Floor::Height(height)) if height.is_finite() => Some(FloorAt(Some(*height))),
        Some(Floor::Word(word)) if word == "none" => Some(FloorAt(None)),
        Some(_) => return Err(value("floor must be a height in m, or 'none'")),
    };
    let mountings: Result<Vec<Mounting>, String> = asked.mounting.iter().map(|m| m.parse()).collect();
    let (mountings, parameters, arm) =
        (mountings.map_err(value)?, set_kind(&asked.parameters)?, arm.arm.clone());
    let found = work::run(py, progress.as_ref(), move |progress| {
        let options = ExciteOptions {
            parameters,
            search: ExcitationSettings {
                harmonics: asked.harmonics,
                fundamental: std::f64::consts::TAU / asked.period,
                periods: asked.periods,
                ramp: asked.ramp,
                margin: asked.margin,
                criterion,
                evaluations: asked.evaluations,
                searches: searches(asked.evaluations),
                seed: asked.seed,
            },
            rate: asked.rate,
            mountings,
            collision: (!asked.no_collision).then_some(Collision {
                floor,
                radius: asked.radius.unwrap_or(RADIUS),
                clearance: asked.clearance.unwrap_or(CLEARANCE),
            }),
            masses: match asked.values {
                _ if asked.no_torque => None,
                Some((text, file)) => Some(MassSource::Values { text, file }),
                None => Some(MassSource::Guess),
            },
            from: asked.from_,
            progress,
        };
        search(&arm, &options)
    })?;
    let found = found.map_err(|e| match e {
        Error::Setting(_) => input(e),
        _ => refused(e),
    })?;
    Ok(Excited {
        json: report::excited::json(&found).to_string(),
        page: report::excited::page(&found).to_html(),
        trajectories: found.trajectories.into_iter().map(|t| Trajectory(t.motion)).collect(),
    })
}

/// Writes a file whole or not at all.
#[pyfunction]
pub(crate) fn write_whole(path: PathBuf, data: &[u8]) -> PyResult<()> {
    report::files::write_whole(&path, data).map_err(input)
}
