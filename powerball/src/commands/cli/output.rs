//! Results on disk and on the terminal.

use super::Failure;
use crate::controller::JointNumber;
use crate::identification::estimate::Spread;
use crate::report::files;
use std::io::{IsTerminal, Write};
use std::path::Path;

/// Progress on standard error, where a person looks at it.
pub(crate) struct Progress(bool);

impl Progress {
    pub(crate) fn new() -> Progress {
        Progress(std::io::stderr().is_terminal())
    }

    pub(crate) fn say(&self, what: &str) {
        if self.0 {
            eprintln!("  {what} …");
        }
    }
}

/// A line on standard error, where a person looks at it, that is written over by the next one: how far a motion has
/// come. A line feed ends it when nothing more is told.
pub(crate) fn live<T: std::fmt::Display>() -> impl FnMut(&T) {
    let mut line = Line { shown: std::io::stderr().is_terminal(), begun: false };
    move |told| line.show(told)
}

struct Line {
    shown: bool,
    begun: bool,
}

impl Line {
    fn show(&mut self, told: &impl std::fmt::Display) {
        if self.shown {
            self.begun = true;
            let _ = write!(std::io::stderr(), "\r\x1b[K  {told}");
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if self.begun {
            let _ = writeln!(std::io::stderr());
        }
    }
}

/// Makes a folder for results, where it is missing.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Failure> {
    files::make_folder(folder).map_err(Failure::Unusable)
}

/// Writes a file of a folder whole or not at all: a reader never sees half of it.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    write_file(&folder.join(name), bytes)
}

/// The same for a path.
pub(crate) fn write_file(target: &Path, bytes: &[u8]) -> Result<(), Failure> {
    files::write_whole(target, bytes).map_err(Failure::Unusable)
}

/// Serialises a result.
pub(crate) fn json(value: &impl serde::Serialize) -> Result<String, Failure> {
    files::json(value).map_err(Failure::Refused)
}

/// Prints to standard output; a closed pipe is no error.
pub(crate) fn print(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Errors by joint as a table; several spreads side by side.
pub(crate) fn table(columns: &[(&str, &Spread)]) -> String {
    let mut text = String::from("joint");
    for (name, _) in columns {
        text.push_str(&format!("  {name:>26}"));
    }
    let joints = columns.iter().map(|(_, s)| s.rms.len()).max().unwrap_or(0);
    for j in 0..joints {
        text.push_str(&format!("\n{:>5}", JointNumber::from_index(j).number()));
        for (_, spread) in columns {
            let cell = format!("{:.4} N·m  {:5.1} %", spread.rms[j], 100.0 * spread.relative[j]);
            text.push_str(&format!("  {cell:>26}"));
        }
    }
    text
}
