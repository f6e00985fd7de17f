//! Logs found by their column names, from CSV with a header line or from Parquet.

use super::{Finding, Log, LogError, columnar, text};
use dyngen::Arm;
use std::path::Path;

/// Reads several logs of an arm; the findings are of all of them.
///
/// # Errors
/// Every reason why one of the logs cannot be used.
pub fn read_logs<P: AsRef<Path>>(files: &[P], arm: &Arm) -> Result<(Vec<Log>, Vec<Finding>), LogError> {
    let (mut logs, mut findings, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match read_log(file.as_ref(), arm, &mut findings) {
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
    let file = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| {
        LogError(vec![Finding {
            file: file.clone(),
            line: None,
            quantity: "file".into(),
            message: format!("cannot be read: {e}"),
        }])
    })?;
    parse(&bytes, &file, arm, findings)
}

/// Reads a log from the bytes of a file: Parquet by its mark, CSV else.
pub(super) fn parse(
    bytes: &[u8],
    file: &str,
    arm: &Arm,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    let parse = if bytes.starts_with(b"PAR1") { columnar::parse } else { text::parse };
    parse(bytes, file, arm, findings)
}

impl Log {
    /// Reads a log of an arm from a file, CSV or Parquet, with what is odd about it.
    ///
    /// # Errors
    /// Why the log cannot be used: no such file, missing columns, no torque constant, units that cannot be
    /// right.
    pub fn read(path: impl AsRef<Path>, arm: &Arm) -> Result<(Log, Vec<Finding>), LogError> {
        let mut findings = Vec::new();
        let log = read_log(path.as_ref(), arm, &mut findings)?;
        Ok((log, findings))
    }
}
