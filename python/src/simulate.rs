//! An arm that moves as a model says, under a control law or a Python function.

use crate::arm::Arm;
use crate::failure::{input, refused};
use crate::identify::{ModelText, model_file};
use crate::work;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use powerball::explanation::simulate::{
    Cycle, Law, Moved, SimulateError, simulate as move_arm, simulate_with,
};
use powerball::identification::motion::Motion;
use pyo3::prelude::*;

/// Positions, velocities and torques (N, n).
type Arrays<'py> = [Bound<'py, PyArray2<f64>>; 3];

fn arrays<'py>(py: Python<'py>, moved: &Moved, dof: usize) -> PyResult<Arrays<'py>> {
    let table = |x: &[f64]| PyArray1::from_slice(py, x).reshape([x.len() / dof.max(1), dof]);
    Ok([table(&moved.q)?, table(&moved.dq)?, table(&moved.torque)?])
}

fn motion(period: f64, [q, dq, ddq]: [Vec<Vec<f64>>; 3]) -> Motion {
    let mut path = Motion::new(q.first().map_or(0, Vec::len), period);
    for ((q, dq), ddq) in q.iter().zip(&dq).zip(&ddq) {
        path.push(q.iter().zip(dq).zip(ddq).map(|((q, dq), ddq)| [*q, *dq, *ddq]));
    }
    path
}

fn failed<E: Into<PyErr>>(e: SimulateError<E>) -> PyErr {
    match e {
        SimulateError::Input(what) => input(what),
        SimulateError::Lost(joint, t) => refused(format!("joint {joint} ran away at {t:.3} s")),
        SimulateError::Controller(e) => e.into(),
    }
}

/// A law by its name: "gravity", "computed_torque" or "impedance".
fn law(name: &str, bandwidth: f64, damping: f64) -> PyResult<Law> {
    match name {
        "gravity" => Ok(Law::Gravity),
        "computed_torque" => Ok(Law::ComputedTorque { bandwidth, damping }),
        "impedance" => Ok(Law::Impedance { bandwidth, damping }),
        other => Err(input(format!(
            "controller must be 'gravity', 'computed_torque', 'impedance' or a function, not '{other}'"
        ))),
    }
}

/// Moves an arm that is as `plant` says along a path, under a law that knows `model`.
#[pyfunction]
#[pyo3(signature = (arm, plant, model, controller, bandwidth, damping, period, path))]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    arm: &Arm,
    plant: ModelText,
    model: ModelText,
    controller: &str,
    bandwidth: f64,
    damping: f64,
    period: f64,
    path: [Vec<Vec<f64>>; 3],
) -> PyResult<Arrays<'py>> {
    let (plant, model, law) =
        (model_file(&plant)?, model_file(&model)?, law(controller, bandwidth, damping)?);
    let (described, path) = (arm.arm.clone(), motion(period, path));
    let dof = path.dof();
    let moved = work::run(py, None, move |_| match move_arm(&described, &plant, &model, law, &path) {
        Ok(moved) => Ok(moved),
        Err(SimulateError::Input(what)) => Err(Ok(what)),
        Err(SimulateError::Lost(joint, t)) => Err(Err((joint, t))),
        Err(SimulateError::Controller(never)) => match never {},
    })?;
    let moved = moved.map_err(|e| match e {
        Ok(what) => input(what),
        Err((joint, t)) => failed::<PyErr>(SimulateError::Lost(joint, t)),
    })?;
    arrays(py, &moved, dof)
}

/// A simulation with a function of Python: t, q, dq, and the path's q, dq, ddq to n torques.
#[pyfunction]
#[pyo3(signature = (arm, plant, controller, period, path))]
pub(crate) fn simulate_function<'py>(
    py: Python<'py>,
    arm: &Arm,
    plant: ModelText,
    controller: &Bound<'py, PyAny>,
    period: f64,
    path: [Vec<Vec<f64>>; 3],
) -> PyResult<Arrays<'py>> {
    let (plant, path) = (model_file(&plant)?, motion(period, path));
    let control = |cycle: &Cycle<'_>| -> PyResult<Vec<f64>> {
        py.check_signals()?;
        let array = |x: &[f64]| PyArray1::from_slice(py, x);
        let [q, dq, ddq] = cycle.reference.map(array);
        controller.call1((cycle.t, array(cycle.q), array(cycle.dq), q, dq, ddq))?.extract()
    };
    let moved = simulate_with(&arm.arm, &plant, &path, control).map_err(failed)?;
    arrays(py, &moved, path.dof())
}
