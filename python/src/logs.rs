//! Logs as Python gives them: files, or columns in memory.

use crate::arm::Arm;
use crate::failure::{input, value};
use crate::summary::Summary;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use powerball::Log;
use powerball::identification::{Input, Recorded, Source};
use powerball::logs::log::{ColumnMap, Finding, ServoLog, are_of_servos, inspect as look};
use pyo3::prelude::*;
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

/// One log: a file, columns with their names, or a summary.
#[derive(FromPyObject)]
pub(crate) struct Given<'py> {
    path: Option<PathBuf>,
    name: String,
    columns: Vec<(String, PyReadonlyArray1<'py, f64>)>,
    mounting: Option<String>,
    summary: Option<Py<Summary>>,
}

/// Logs as the library takes them, and what was found in those from memory.
pub(crate) struct Taken {
    pub(crate) sources: Vec<Source<'static>>,
    pub(crate) findings: Vec<String>,
}

/// The map of what was given for columns.
pub(crate) fn column_map(said: &[String]) -> PyResult<Arc<ColumnMap>> {
    ColumnMap::said(said).map(Arc::new).map_err(input)
}

/// Takes logs of an arm.
pub(crate) fn taken(arm: &dyngen::Arm, logs: &[Given<'_>], map: &Arc<ColumnMap>) -> PyResult<Taken> {
    let (mut sources, mut findings, mut wrong) = (Vec::new(), Vec::new(), Vec::new());
    for given in logs {
        let mounting = given.mounting.as_deref().map(str::parse).transpose().map_err(|e: String| value(e))?;
        let source = match (&given.path, &given.summary) {
            (Some(path), _) => Source::file(path.clone()),
            (None, Some(summary)) => Source::from(summary.get().bands.clone()),
            (None, None) => match in_memory(arm, given, map)? {
                Ok((log, found)) => {
                    findings.extend(found);
                    Source::from(log)
                }
                Err(why) => {
                    wrong.push(why);
                    continue;
                }
            },
        };
        sources.push(Source { mounting, ..source }.mapped(Arc::clone(map)));
    }
    if wrong.is_empty() { Ok(Taken { sources, findings }) } else { Err(input(wrong.join("\n"))) }
}

/// The log with what is odd about it, or why it is none.
type Read = Result<(Input<'static>, Vec<String>), String>;

fn in_memory(arm: &dyngen::Arm, given: &Given<'_>, map: &ColumnMap) -> PyResult<Read> {
    let slice = |(name, array): &(String, PyReadonlyArray1<'_, f64>)| -> PyResult<(String, Vec<f64>)> {
        let values = array.as_slice().map_err(|_| value(format!("{name} must be C-contiguous")))?;
        Ok((name.clone(), values.to_vec()))
    };
    let columns = given.columns.iter().map(slice).collect::<PyResult<Vec<_>>>()?;
    let columns: Vec<(String, &[f64])> = columns.iter().map(|(n, x)| (n.clone(), x.as_slice())).collect();
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    let read = match are_of_servos(&names, arm, map) {
        true => ServoLog::from_columns_as(&given.name, arm, &columns, map)
            .map(|(log, found)| (Input::Servos(Cow::Owned(log)), found)),
        false => Log::from_columns_as(&given.name, arm, &columns, map)
            .map(|(log, found)| (Input::Log(Cow::Owned(log)), found)),
    };
    let words = |found: Vec<Finding>| found.iter().map(ToString::to_string).collect();
    Ok(read.map(|(log, found)| (log, words(found))).map_err(|e| e.to_string()))
}

/// Times (N,), positions and torques (N, n), temperatures (N, n) where there are any, and what was found.
type Samples<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Option<Bound<'py, PyArray2<f64>>>,
    Vec<String>,
);

/// A log as the fits read it: its faults taken out, in SI units.
#[pyfunction]
pub(crate) fn read_log<'py>(
    py: Python<'py>,
    arm: &Arm,
    log: Given<'py>,
    map: Vec<String>,
) -> PyResult<Samples<'py>> {
    let map = column_map(&map)?;
    let Taken { sources, mut findings } = taken(&arm.arm, &[log], &map)?;
    let read = py.detach(|| Recorded::read(&arm.arm, &sources, &[])).map_err(input)?;
    findings.extend(read.warnings);
    let Some(log) = read.fit.into_iter().next() else { return Err(input("there is no log")) };
    let table = |by_joint: &[Vec<f64>]| {
        let rows = (0..log.t.len()).flat_map(|k| by_joint.iter().map(move |joint| joint[k]));
        PyArray1::from_vec(py, rows.collect()).reshape([log.t.len(), by_joint.len()])
    };
    let temperature = log.temperature.as_deref().map(table).transpose()?;
    let t = PyArray1::from_slice(py, &log.t);
    Ok((t, table(&log.q)?, table(&log.torque)?, temperature, findings))
}

/// What is in a file and what it is taken to be, as JSON.
#[pyfunction]
#[pyo3(signature = (file, map, arm))]
pub(crate) fn inspect(
    py: Python<'_>,
    file: PathBuf,
    map: Vec<String>,
    arm: Option<&Arm>,
) -> PyResult<String> {
    let map = column_map(&map)?;
    let found = py.detach(|| look(&file, &map, arm.map(|arm| &arm.arm))).map_err(input)?;
    powerball::report::files::json(&found).map_err(input)
}
