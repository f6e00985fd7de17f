//! What is odd about a log, and why one cannot be used.

use std::fmt;

/// Something about a log that its user should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The file.
    pub file: String,
    /// Line in the file, message of its topic, or number of the sample of a log from memory, from 1; `None`
    /// where the whole log is meant.
    pub line: Option<usize>,
    /// The column or quantity.
    pub quantity: String,
    /// What was found, what was done about it, what to do.
    pub message: String,
}

impl Finding {
    /// One about a whole file.
    pub(crate) fn of_file(file: &str, quantity: &str, message: impl Into<String>) -> Finding {
        Finding { file: file.into(), line: None, quantity: quantity.into(), message: message.into() }
    }
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

impl LogError {
    /// A single reason about a whole file.
    pub(crate) fn of_file(file: &str, quantity: &str, message: impl Into<String>) -> LogError {
        LogError(vec![Finding::of_file(file, quantity, message)])
    }
}

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
