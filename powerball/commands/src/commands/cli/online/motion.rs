//! What a motion shows and writes while it lasts.

use super::{Failure, output};
use crate::procedure::MotionLog;
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use std::path::Path;

/// A line on standard error, where a person looks at it, that is written over by the next one and cut at the
/// terminal's width: how far a motion has come. The last one stays.
pub(super) fn live<T: std::fmt::Display>() -> impl FnMut(&T) {
    let line = ProgressBar::no_length().with_style(
        ProgressStyle::with_template("  {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner()),
    );
    let line = line.with_finish(ProgressFinish::AndLeave);
    move |what| line.set_message(what.to_string())
}

/// Begins the log of a motion in a folder for results.
pub(super) fn motion_log(folder: &Path) -> Result<MotionLog, Failure> {
    output::make_own_folder(folder, &["log.csv"])?;
    let file = folder.join("log.csv");
    MotionLog::create(&file)
        .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", file.display())))
}

/// Ends it.
pub(super) fn close(log: MotionLog) -> Result<(), Failure> {
    log.close().map_err(|e| Failure::Refused(format!("the log cannot be written: {e}")))
}
