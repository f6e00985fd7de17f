//! Logs found by their column names, from a file of any format.

use super::columns::Asked;
use super::map::ColumnMap;
use super::samples::Samples;
use super::{Finding, Log, LogError, topics};
use crate::logs::tables::{Format, columnar, read_contents, text};
use dyngen::Arm;
use std::path::Path;

/// Reads several logs of an arm; the findings are of all of them.
///
/// # Errors
/// Every reason why one of the logs cannot be used.
pub fn read_logs<P: AsRef<Path>>(files: &[P], arm: &Arm) -> Result<(Vec<Log>, Vec<Finding>), LogError> {
    read_logs_as(files, arm, &ColumnMap::default())
}

/// The same with what a map says of their columns.
///
/// # Errors
/// Every reason why one of the logs cannot be used.
pub fn read_logs_as<P: AsRef<Path>>(
    files: &[P],
    arm: &Arm,
    map: &ColumnMap,
) -> Result<(Vec<Log>, Vec<Finding>), LogError> {
    let (mut logs, mut findings, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match read_log_as(file.as_ref(), arm, map, &mut findings) {
            Ok(log) => logs.push(log),
            Err(LogError(reasons)) => errors.extend(reasons),
        }
    }
    if errors.is_empty() { Ok((logs, findings)) } else { Err(LogError(errors)) }
}

/// Reads one log of an arm and adds what is odd about it to `findings`.
///
/// # Errors
/// Why the log cannot be used: no such file, missing columns, no torque constant, units that cannot be right.
pub fn read_log(path: &Path, arm: &Arm, findings: &mut Vec<Finding>) -> Result<Log, LogError> {
    read_log_as(path, arm, &ColumnMap::default(), findings)
}

/// The same with what a map says of its columns.
///
/// # Errors
/// As [`read_log`].
pub fn read_log_as(
    path: &Path,
    arm: &Arm,
    map: &ColumnMap,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    let file = path.display().to_string();
    let asked = Asked { arm, map, file: &file, header: None };
    match Format::of_file(path)? {
        Format::Csv | Format::Parquet => {
            let unreadable = |e| LogError::of_file(&file, "file", format!("cannot be read: {e}"));
            parse(&std::fs::read(path).map_err(unreadable)?, asked, findings)
        }
        Format::Mcap | Format::Rosbag | Format::Npz | Format::Mat => {
            let contents = read_contents(path)?;
            findings.extend(contents.notes);
            topics::log(&contents.tables, asked, findings)
        }
    }
}

/// Reads a log from the bytes of a file: Parquet by its mark, CSV else.
pub(super) fn parse(bytes: &[u8], asked: Asked<'_>, findings: &mut Vec<Finding>) -> Result<Log, LogError> {
    // Their header is their first line.
    let asked = Asked { header: Some(1), ..asked };
    let mut lines = Vec::new();
    let mut samples = Samples::new(asked, "line", findings);
    let torn = match Format::of(bytes) {
        Format::Parquet => columnar::read(bytes, asked.file, &mut samples).map(|()| false),
        _ => text::read(bytes, asked.file, &mut samples, &mut lines),
    }?;
    let log = samples.finish(torn);
    findings.extend(lines);
    log
}

impl Log {
    /// Reads a log of an arm from a file, CSV, Parquet, MCAP, rosbag2 (`.db3`), npz or mat, with what is odd about
    /// it.
    ///
    /// # Errors
    /// Why the log cannot be used: no such file, missing columns, no torque constant, units that cannot be
    /// right.
    pub fn read(path: impl AsRef<Path>, arm: &Arm) -> Result<(Log, Vec<Finding>), LogError> {
        Log::read_as(path, arm, &ColumnMap::default())
    }

    /// The same with what a map says of its columns.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn read_as(
        path: impl AsRef<Path>,
        arm: &Arm,
        map: &ColumnMap,
    ) -> Result<(Log, Vec<Finding>), LogError> {
        let mut findings = Vec::new();
        let log = read_log_as(path.as_ref(), arm, map, &mut findings)?;
        Ok((log, findings))
    }
}
