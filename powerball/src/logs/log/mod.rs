//! Logs of joint positions and torques: read, checked, and every doubt about them said.
//!
//! Files ([`Log::read`]: CSV or Parquet), arrays ([`Log::from_arrays`]) and samples ([`Log::from_samples`])
//! come to columns by name, and these pass the same checks.

mod arrays;
mod check;
mod clock;
mod columnar;
mod columns;
mod doubts;
mod file;
mod levels;
mod raw;
mod read;
mod samples;
mod signs;
mod speeds;
mod text;
#[cfg(feature = "parquet")]
mod zstd_pages;

pub use arrays::{Arrays, Sample};
pub use clock::common_clock;
use doubts::{Doubts, Severity};
pub use file::LogFile;
pub use read::{read_log, read_logs};
use std::fmt;

/// One recording as it was logged, after its faults were taken out.
#[derive(Clone, Debug)]
pub struct Log {
    /// The file, as the caller named it.
    pub file: String,
    /// Rising time stamps, s.
    pub t: Vec<f64>,
    /// Joint positions by joint, rad or m, without wraps.
    pub q: Vec<Vec<f64>>,
    /// Joint torques by joint, N·m or N, positive in the direction of q.
    pub torque: Vec<Vec<f64>>,
    /// Joint temperatures by joint, °C, where they were logged.
    pub temperature: Option<Vec<Vec<f64>>>,
    /// Index ranges without a gap.
    pub pieces: Vec<std::ops::Range<usize>>,
    /// Seconds to add to `t` for a clock that runs through all logs (see [`common_clock`]).
    pub clock: f64,
}

/// Something about a log that its user should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The file.
    pub file: String,
    /// Line in the file, or number of the sample of a log from memory, from 1; `None` where the whole log is
    /// meant.
    pub line: Option<usize>,
    /// The column or quantity.
    pub quantity: String,
    /// What was found, what was done about it, what to do.
    pub message: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}: {}", self.file, self.quantity, self.message),
            None => write!(f, "{}: {}: {}", self.file, self.quantity, self.message),
        }
    }
}

/// Why logs cannot be used at all: every reason at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogError(pub Vec<Finding>);

impl fmt::Display for LogError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, finding) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{finding}")?;
        }
        Ok(())
    }
}

impl std::error::Error for LogError {}

#[cfg(test)]
mod tests;
