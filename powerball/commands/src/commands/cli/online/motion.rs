//! What a motion shows and writes while it lasts.

use super::{Failure, output, replace};
use crate::procedure::MotionLog;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use std::path::Path;

/// A line on standard error, where a person looks at it, that is written over by the next one and cut at the
/// terminal's width: how far a motion has come. The last one stays.
pub(super) fn live<T: std::fmt::Display>() -> impl FnMut(&T) {
    let line = ProgressBar::no_length().with_style(
        ProgressStyle::with_template("  {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner()),
    );
    let line = line.with_finish(ProgressFinish::AndLeave);
    if output::is_quiet() {
        line.set_draw_target(ProgressDrawTarget::hidden());
    }
    move |what| line.set_message(what.to_string())
}

/// The file of a motion's log, in the folder of the results.
const LOG: &str = "log.csv";

/// Begins the log of a motion in a folder for results; no input is written over.
pub(super) fn motion_log(folder: &Path, inputs: &[&Path]) -> Result<MotionLog, Failure> {
    let file = folder.join(LOG);
    replace::check_inputs(&file, inputs)?;
    let words = "log.csv has every cycle of this run, up to its end or to where it was stopped.";
    output::make_own_folder(folder, &[LOG], "Log of a motion", words)?;
    MotionLog::create(&file)
        .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", file.display())))
}

/// Ends it.
pub(super) fn close(log: MotionLog) -> Result<(), Failure> {
    log.close().map_err(|e| Failure::Refused(format!("the log cannot be written: {e}")))
}
