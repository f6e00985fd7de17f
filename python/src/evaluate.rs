//! A function of an arm over arrays of states.

use crate::failure::{refused, value};
use dyngen::dynamics::function::Argument;
use dyngen::{Evaluator, Function, Samples};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// States by the name of the argument.
pub(crate) type States<'py> = Vec<(String, PyReadonlyArrayDyn<'py, f64>)>;

/// Every function with the arguments that it takes, and what it computes and returns in words.
#[pyfunction]
pub(crate) fn functions() -> Vec<(&'static str, Vec<&'static str>, &'static str, &'static str)> {
    let of = |function: Function| {
        let (what, returns) = function.meaning();
        let names = function.arguments().iter().map(|argument| argument.name()).collect();
        (function.name(), names, what, returns)
    };
    Function::ALL.into_iter().map(of).collect()
}

/// Runs over states of shape (n,) or (N, n). Vectors are (m,) or (N, m), matrices (r, c) or (N, r, c),
/// numbers () or (N,).
pub(crate) fn evaluate<'py>(
    py: Python<'py>,
    evaluator: &Evaluator,
    dof: usize,
    states: &States<'py>,
    parameters: &[f64],
) -> PyResult<Bound<'py, PyAny>> {
    let function = evaluator.function();
    let shape = common_shape(function, dof, states)?;
    let slice = |argument: Argument| -> PyResult<&[f64]> {
        let Some((name, array)) = states.iter().find(|(name, _)| name == argument.name()) else {
            return Ok(&[]);
        };
        let values = array.as_slice().map_err(|_| value(format!("{name} must be C-contiguous")))?;
        let length = argument.length(dof, 0);
        match values.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(value(format!(
                "{name} must be finite, shape {}: {} at {}",
                expected(length),
                values[at],
                place(at, length, array.ndim())
            ))),
            None => Ok(values),
        }
    };
    let samples = Samples {
        q: slice(Argument::Positions)?,
        dq: slice(Argument::Velocities)?,
        ddq: slice(Argument::Accelerations)?,
        dqr: slice(Argument::ReferenceVelocities)?,
        ddqr: slice(Argument::ReferenceAccelerations)?,
        tau: slice(Argument::Torques)?,
        e: slice(Argument::Errors)?,
        f: slice(Argument::Wrench)?,
        payload: slice(Argument::Payload)?,
        vq: slice(Argument::PositionDirection)?,
        vdq: slice(Argument::VelocityDirection)?,
        parameters,
    };
    let count = shape[..shape.len() - 1].iter().product::<usize>();
    let width = evaluator.outputs();
    let array = PyArray1::<f64>::zeros(py, count * width, false);
    let wrong = {
        let mut out = array.readwrite();
        let out = out.as_slice_mut().map_err(refused)?;
        py.detach(|| {
            evaluator.run(&samples, out);
            out.iter().position(|x| !x.is_finite())
        })
    };
    if let Some(at) = wrong {
        let sample =
            if shape.len() > 1 { format!(" at sample {}", at / width.max(1)) } else { String::new() };
        return Err(refused(format!("{function} is not finite{sample}: {}", function.why_not_finite())));
    }
    let mut result: Vec<usize> = shape[..shape.len() - 1].to_vec();
    match evaluator.shape() {
        (1, 1) => {}
        (length, 1) | (1, length) => result.push(length),
        (rows, columns) => result.extend([rows, columns]),
    }
    let array: Bound<'py, PyArrayDyn<f64>> = array.reshape(result)?;
    Ok(array.into_any())
}

/// The shape of all states, which must be the same.
fn common_shape(function: Function, dof: usize, states: &States<'_>) -> PyResult<Vec<usize>> {
    let mut common: Option<(&str, &[usize])> = None;
    for argument in function.arguments().iter().filter(|a| **a != Argument::Parameters) {
        let Some((name, array)) = states.iter().find(|(name, _)| name == argument.name()) else {
            return Err(value(format!("{function} needs {}", argument.name())));
        };
        let (shape, length) = (array.shape(), argument.length(dof, 0));
        if !(1..=2).contains(&shape.len()) || shape.last() != Some(&length) {
            return Err(value(format!(
                "{name} must have shape {}, it has {}",
                expected(length),
                shown(shape)
            )));
        }
        match common {
            // As many samples as the others; a wrench has six numbers in each.
            Some((first, as_first)) if as_first[..as_first.len() - 1] != shape[..shape.len() - 1] => {
                return Err(value(format!(
                    "{name} must have the shape of {first}, {}, it has {}",
                    shown(as_first),
                    shown(shape)
                )));
            }
            Some(_) => {}
            None => common = Some((name, shape)),
        }
    }
    Ok(common.map_or_else(|| vec![dof], |(_, shape)| shape.to_vec()))
}

fn expected(dof: usize) -> String {
    format!("({dof},) or (N, {dof})")
}

fn shown(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        several => format!("({})", several.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

fn place(at: usize, dof: usize, dimensions: usize) -> String {
    if dimensions == 1 { format!("[{at}]") } else { format!("[{}, {}]", at / dof, at % dof) }
}
