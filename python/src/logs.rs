//! Logs as Python gives them: files, or columns in memory.

use crate::failure::{input, value};
use numpy::PyReadonlyArray1;
use powerball::Log;
use powerball::identification::{Input, Source};
use powerball::logs::log::ColumnMap;
use pyo3::prelude::*;
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

/// One log: a file, or columns with their names.
#[derive(FromPyObject)]
pub(crate) struct Given<'py> {
    path: Option<PathBuf>,
    name: String,
    columns: Vec<(String, PyReadonlyArray1<'py, f64>)>,
    mounting: Option<String>,
}

/// Logs as the library takes them, and what was found in those from memory.
pub(crate) struct Taken {
    pub(crate) sources: Vec<Source<'static>>,
    pub(crate) findings: Vec<String>,
}

/// The map of what was said of columns.
pub(crate) fn column_map(said: &[String]) -> PyResult<Arc<ColumnMap>> {
    ColumnMap::said(said).map(Arc::new).map_err(input)
}

/// Takes logs of an arm.
pub(crate) fn taken(arm: &dyngen::Arm, logs: &[Given<'_>], map: &Arc<ColumnMap>) -> PyResult<Taken> {
    let (mut sources, mut findings, mut wrong) = (Vec::new(), Vec::new(), Vec::new());
    for given in logs {
        let mounting = given.mounting.as_deref().map(str::parse).transpose().map_err(|e: String| value(e))?;
        let source = match &given.path {
            Some(path) => Source::file(path.clone()),
            None => match in_memory(arm, given, map)? {
                Ok((log, found)) => {
                    findings.extend(found);
                    Source::from(Input::Log(Cow::Owned(log)))
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
type Read = Result<(Log, Vec<String>), String>;

fn in_memory(arm: &dyngen::Arm, given: &Given<'_>, map: &ColumnMap) -> PyResult<Read> {
    let slice = |(name, array): &(String, PyReadonlyArray1<'_, f64>)| -> PyResult<(String, Vec<f64>)> {
        let values = array.as_slice().map_err(|_| value(format!("{name} must be C-contiguous")))?;
        Ok((name.clone(), values.to_vec()))
    };
    let columns = given.columns.iter().map(slice).collect::<PyResult<Vec<_>>>()?;
    let columns: Vec<(String, &[f64])> = columns.iter().map(|(n, x)| (n.clone(), x.as_slice())).collect();
    let read = Log::from_columns_as(&given.name, arm, &columns, map);
    let words = |found: Vec<powerball::logs::log::Finding>| found.iter().map(ToString::to_string).collect();
    Ok(read.map(|(log, found)| (log, words(found))).map_err(|e| e.to_string()))
}
