//! Summaries: logs as the sufficient statistics of their fit, made, joined, written and read.

use crate::arm::Arm;
use crate::failure::input;
use crate::identify::failure;
use crate::logs::{Given, column_map, taken};
use crate::work;
use powerball::identification::Summarized;
use powerball::logs::regression::DataOptions;
use powerball::logs::summary::Bands;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Logs, reduced.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct Summary {
    pub(crate) bands: Bands,
    warnings: Vec<String>,
}

#[pymethods]
impl Summary {
    /// From the bytes of a file.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Summary> {
        let bands = Bands::from_bytes(bytes).map_err(input)?;
        Ok(Summary { bands, warnings: Vec::new() })
    }

    /// The bytes of a file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let bytes = py.detach(|| self.bands.to_bytes());
        PyBytes::new(py, &bytes)
    }

    /// The arm's name.
    fn arm(&self) -> String {
        self.bands.widest().identity.arm.clone()
    }

    /// The logs that went in, and the seconds of each.
    fn logs(&self) -> Vec<(String, f64)> {
        self.bands.widest().logs.clone()
    }

    /// Rows, joint by joint.
    fn rows(&self) -> Vec<u64> {
        self.bands.widest().joints.iter().map(|joint| joint.rows()).collect()
    }

    /// What is to be reported about the logs.
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }
}

/// Reduces logs, and joins summaries with them.
#[pyfunction]
#[pyo3(signature = (arm, log, map, progress))]
pub(crate) fn summarize(
    py: Python<'_>,
    arm: &Arm,
    log: Vec<Given<'_>>,
    map: Vec<String>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Summary> {
    let (arm, map) = (arm.arm.clone(), column_map(&map)?);
    let logs = taken(&arm, &log, &map)?;
    let summarized = work::run(py, progress.as_ref(), move |progress| {
        powerball::identification::summarize(&arm, logs.sources, &DataOptions::default(), progress).map(
            |Summarized { bands, mut warnings, .. }| {
                warnings.splice(0..0, logs.findings);
                Summary { bands, warnings }
            },
        )
    })?;
    summarized.map_err(failure)
}
