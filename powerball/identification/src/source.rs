//! The input of an identification: logs and summaries of logs, in memory or in files, each with its mounting.
//!
//! The module also reduces logs to sufficient statistics, which [`identify`](super::identify) takes in their
//! place.

use super::identify::{Gathering, IdentifyError};
use super::mounting::Mounting;
use dyngen::Arm;
use powerball_logs::Progress;
use powerball_logs::log::{ColumnMap, Log, ServoLog, notes_of};
use powerball_logs::regression::DataOptions;
use powerball_logs::summary::{Bands, Summary};
use powerball_logs::tables::is_address;
use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A log, or the sufficient statistics of logs, and how the base stood for it.
///
/// Made from a [`Log`], from [`Bands`] or from the path of a file of either: files are read one after the
/// other and dropped again, so that more logs can be fitted than fit into memory.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    /// The log, the summary or the path of a file.
    pub input: Input<'a>,
    /// The mounting of the base. `None` means that of the arm file, or that of the summary itself.
    pub mounting: Option<Mounting>,
    /// How the columns of a file are read.
    pub map: Arc<ColumnMap>,
}

/// A log or its sufficient statistics.
#[derive(Clone, Debug)]
pub enum Input<'a> {
    /// The samples of a log.
    Log(Cow<'a, Log>),
    /// The R factors of logs, as `powerball summarize` writes them.
    Summary(Cow<'a, Bands>),
    /// The samples of a log of position servos.
    Servos(Cow<'a, ServoLog>),
    /// A file with any of these, recognised by its content.
    File(Cow<'a, Path>),
}

impl<'a> Source<'a> {
    /// A file: CSV, Parquet, MCAP, rosbag2, npz, mat or a summary.
    #[must_use]
    pub fn file(path: impl Into<PathBuf>) -> Source<'a> {
        Source::from(path.into())
    }

    /// This source with another mounting of the base.
    #[must_use]
    pub fn mounted(self, mounting: Mounting) -> Source<'a> {
        Source { mounting: Some(mounting), ..self }
    }

    /// This source with another map of its columns.
    #[must_use]
    pub fn mapped(self, map: Arc<ColumnMap>) -> Source<'a> {
        Source { map, ..self }
    }

    /// The log's name in messages: the file, or the log's own name.
    #[must_use]
    pub fn name(&self) -> String {
        match &self.input {
            Input::Log(log) => log.file.clone(),
            Input::Servos(log) => log.file.clone(),
            Input::File(path) => path.display().to_string(),
            Input::Summary(bands) => {
                let logs: Vec<&str> = bands.widest().logs.iter().map(|(name, _)| name.as_str()).collect();
                format!("the summary of {}", logs.join(", "))
            }
        }
    }

    /// Whether both are one file.
    pub(super) fn same_file(&self, other: &Source<'_>) -> bool {
        let (Input::File(a), Input::File(b)) = (&self.input, &other.input) else { return false };
        match (a.canonicalize(), b.canonicalize()) {
            (Ok(a), Ok(b)) => a == b,
            _ => a == b,
        }
    }
}

/// The summary in a file; `None` where the file is something else.
///
/// # Errors
/// Why the file cannot be read, in words.
pub(super) fn read_summary(file: &Path) -> Result<Option<Bands>, String> {
    // What is at an address is a log.
    if is_address(file) {
        return Ok(None);
    }
    let read = |mut f: std::fs::File| {
        let mut head = vec![0; 64];
        let count = f.read(&mut head)?;
        head.truncate(count);
        if Summary::is_summary(&head) {
            f.read_to_end(&mut head)?;
            return Ok(Some(head));
        }
        Ok(None)
    };
    let bytes = dyngen::file::open(file).and_then(read).map_err(|e| format!("cannot be read: {e}"))?;
    bytes.map(|bytes| Bands::from_bytes(&bytes).map_err(|e| e.to_string())).transpose()
}

impl<'a> From<Input<'a>> for Source<'a> {
    fn from(input: Input<'a>) -> Self {
        Source { input, mounting: None, map: Arc::default() }
    }
}

impl<'a> From<&'a Log> for Source<'a> {
    fn from(log: &'a Log) -> Self {
        Input::Log(Cow::Borrowed(log)).into()
    }
}

impl From<Log> for Source<'_> {
    fn from(log: Log) -> Self {
        Input::Log(Cow::Owned(log)).into()
    }
}

impl<'a> From<&'a Bands> for Source<'a> {
    fn from(summary: &'a Bands) -> Self {
        Input::Summary(Cow::Borrowed(summary)).into()
    }
}

impl From<Bands> for Source<'_> {
    fn from(summary: Bands) -> Self {
        Input::Summary(Cow::Owned(summary)).into()
    }
}

impl<'a> From<&'a Path> for Source<'a> {
    fn from(path: &'a Path) -> Self {
        Input::File(Cow::Borrowed(path)).into()
    }
}

impl From<PathBuf> for Source<'_> {
    fn from(path: PathBuf) -> Self {
        Input::File(Cow::Owned(path)).into()
    }
}

impl<'a> From<&'a Source<'_>> for Source<'a> {
    fn from(source: &'a Source<'_>) -> Self {
        let input = match &source.input {
            Input::Log(log) => Input::Log(Cow::Borrowed(log.as_ref())),
            Input::Summary(bands) => Input::Summary(Cow::Borrowed(bands.as_ref())),
            Input::Servos(log) => Input::Servos(Cow::Borrowed(log.as_ref())),
            Input::File(path) => Input::File(Cow::Borrowed(path.as_ref())),
        };
        Source { input, mounting: source.mounting, map: Arc::clone(&source.map) }
    }
}

// Logs as sufficient statistics, which [`identify`](super::identify) takes in their place.

/// The R factors of logs of one mounting.
#[derive(Clone, Debug)]
pub struct Summarized {
    /// How the base stood.
    pub mounting: Mounting,
    /// The factors: [`Bands::to_bytes`] writes them.
    pub bands: Bands,
    /// Why its logs should not be used, each a sentence without its full stop.
    pub unusable: Vec<String>,
    /// Warnings about the logs and the arm file.
    pub warnings: Vec<String>,
}

/// Reduces logs to their sufficient statistics, of one size however long they were, and joins summaries with
/// them.
///
/// # Errors
/// [`IdentifyError`]: logs that cannot be used, or are of several mountings of the base.
pub fn summarize<'a, S: Into<Source<'a>>>(
    arm: &Arm,
    logs: impl IntoIterator<Item = S>,
    options: &DataOptions,
    progress: Progress<'_>,
) -> Result<Summarized, IdentifyError> {
    let logs: Vec<Source<'a>> = logs.into_iter().map(Into::into).collect();
    let gathered = Gathering::new(arm, options, false, progress).said(notes_of(arm)).all(&logs)?;
    let mountings: Vec<String> = gathered.mounted.iter().map(|m| m.mounting.to_string()).collect();
    let mut mounted = gathered.mounted.into_iter();
    match (mounted.next(), mounted.next()) {
        (Some(only), None) => {
            let (mounting, bands) = (only.mounting, only.bands);
            Ok(Summarized { mounting, bands, unusable: only.doubts, warnings: gathered.warnings })
        }
        _ => Err(IdentifyError::Unusable(vec![format!(
            "these are of several mountings of the base ({}): a summary has one; give the logs themselves \
                to identify",
            mountings.join("; ")
        )])),
    }
}
