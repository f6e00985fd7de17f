//! A file's format, by what it begins with, and its tables.
//!
//! Also here: what is odd about a log, and why one cannot be used.

use super::table::Table;
use super::{columnar, text};
use serde::Serialize;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The formats that are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Format {
    /// Lines of text with a header line.
    #[serde(rename = "CSV")]
    Csv,
    /// Columns in Parquet.
    Parquet,
    /// A rosbag2 of the storage `mcap`, or any other MCAP.
    #[serde(rename = "MCAP")]
    Mcap,
    /// A rosbag2 of the storage `sqlite3`.
    #[serde(rename = "rosbag2 (SQLite)")]
    Rosbag,
    /// An archive of NumPy arrays.
    #[serde(rename = "npz")]
    Npz,
    /// A file of MATLAB's, of version 5 to 7.
    #[serde(rename = "mat")]
    Mat,
}

/// The tables of a file.
#[derive(Clone, Debug)]
pub struct Contents {
    /// How it is stored.
    pub format: Format,
    /// One table, or one a topic.
    pub tables: Vec<Table>,
    /// What is odd about the file itself.
    pub notes: Vec<Finding>,
}

impl Format {
    /// By the first bytes of a file.
    #[must_use]
    pub fn of(head: &[u8]) -> Format {
        let begins = |magic: &[u8]| head.starts_with(magic);
        match () {
            () if begins(b"PAR1") => Format::Parquet,
            () if begins(b"\x89MCAP0\r\n") => Format::Mcap,
            () if begins(b"SQLite format 3\0") => Format::Rosbag,
            () if begins(b"PK\x03\x04") => Format::Npz,
            () if begins(b"MATLAB ") => Format::Mat,
            () => Format::Csv,
        }
    }

    /// What the file at a path begins with.
    ///
    /// # Errors
    /// Where it cannot be read, is empty, or is none of these.
    pub fn of_file(path: &Path) -> Result<Format, LogError> {
        let mut head = Vec::new();
        let read = File::open(path).and_then(|file| file.take(text::HEAD as u64).read_to_end(&mut head));
        read.map_err(|e| LogError::of_file(&shown(path), "file", format!("cannot be read: {e}")))?;
        let format = Format::of(&head);
        match text::no_text(&head).filter(|_| format == Format::Csv) {
            Some(what) => Err(LogError::of_file(&shown(path), "file", what)),
            None => Ok(format),
        }
    }
}

/// The topics that are read, where not all are.
type Only<'a> = Option<&'a [String]>;

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Reads all tables of a file. Of a bag the numbers of joint states and of JSON messages come into memory,
/// one message after the other; pictures and the like stay on the disk.
///
/// # Errors
/// Where the file cannot be read, is torn, or is of a format that this build does not have.
pub fn read_contents(path: &Path) -> Result<Contents, LogError> {
    read_topics(path, None)
}

/// The same with the topics of some names alone, where a file has topics; others are counted.
pub(crate) fn read_topics(path: &Path, only: Only<'_>) -> Result<Contents, LogError> {
    let format = Format::of_file(path)?;
    let file = shown(path);
    let failed = |e: std::io::Error| LogError::of_file(&file, "file", format!("cannot be read: {e}"));
    let mut notes = Vec::new();
    let tables = match format {
        Format::Csv => {
            let mut table = Table::new("", "lines");
            let bytes = std::fs::read(path).map_err(failed)?;
            if text::read(&bytes, &file, &mut table, &mut notes)? {
                notes.push(Finding::of_file(&file, "last line", "is torn"));
            }
            vec![table]
        }
        Format::Parquet => {
            let mut table = Table::new("", "rows");
            columnar::read(&std::fs::read(path).map_err(failed)?, &file, &mut table)?;
            vec![table]
        }
        Format::Mcap => mcap_tables(path, only, &file, &mut notes)?,
        Format::Rosbag => rosbag_tables(path, only, &file, &mut notes)?,
        Format::Npz => npz_tables(path, &file, &mut notes)?,
        Format::Mat => mat_tables(path, &file, &mut notes)?,
    };
    for table in &tables {
        if let Some((count, reason)) = &table.unreadable {
            let message =
                format!("{count} messages could not be read (the first: {reason}) and were left out");
            notes.push(Finding::of_file(&file, &table.name, message));
        }
    }
    Ok(Contents { format, tables, notes })
}

#[cfg(feature = "mcap")]
fn mcap_tables(
    path: &Path,
    only: Only<'_>,
    file: &str,
    notes: &mut Vec<Finding>,
) -> Result<Vec<Table>, LogError> {
    let read = File::open(path).and_then(|opened| super::mcap::read(opened, only));
    let (tables, wrong) =
        read.map_err(|e| LogError::of_file(file, "MCAP", format!("cannot be read: {e}")))?;
    notes.extend(wrong.into_iter().map(|wrong| Finding::of_file(file, "MCAP", wrong)));
    Ok(tables)
}

#[cfg(feature = "rosbag")]
fn rosbag_tables(
    path: &Path,
    only: Only<'_>,
    file: &str,
    notes: &mut Vec<Finding>,
) -> Result<Vec<Table>, LogError> {
    let read = File::open(path).and_then(|opened| super::rosbag::read(opened, only));
    // SQLite moves what was written last into the file when it is closed.
    let mut waiting = path.as_os_str().to_owned();
    waiting.push("-wal");
    if std::fs::metadata(&waiting).is_ok_and(|m| m.len() > 0) {
        let message = "its last messages are still in the file beside it that ends in -wal, and were not \
            read: \
            `sqlite3 FILE vacuum` brings them in";
        notes.push(Finding::of_file(file, "rosbag2", message));
    }
    read.map_err(|e| LogError::of_file(file, "rosbag2", format!("cannot be read: {e}")))
}

#[cfg(feature = "npz")]
fn npz_tables(path: &Path, file: &str, notes: &mut Vec<Finding>) -> Result<Vec<Table>, LogError> {
    let read = std::fs::read(path).and_then(|bytes| super::npz::read(&bytes));
    let (table, left_out) =
        read.map_err(|e| LogError::of_file(file, "npz", format!("cannot be read: {e}")))?;
    notes.extend(left_out.map(|note| Finding::of_file(file, "arrays", note)));
    Ok(vec![table])
}

#[cfg(feature = "mat")]
fn mat_tables(path: &Path, file: &str, notes: &mut Vec<Finding>) -> Result<Vec<Table>, LogError> {
    let read = std::fs::read(path).and_then(|bytes| super::mat::read(&bytes));
    let (table, left_out) =
        read.map_err(|e| LogError::of_file(file, "mat", format!("cannot be read: {e}")))?;
    notes.extend(left_out.map(|note| Finding::of_file(file, "arrays", note)));
    Ok(vec![table])
}

/// What is said where a build lacks a format.
macro_rules! absent {
    ($feature:literal, $function:ident $(, $only:ty)?) => {
        #[cfg(not(feature = $feature))]
        fn $function(_: &Path, $(_: $only,)? file: &str, _: &mut Vec<Finding>) -> Result<Vec<Table>, LogError> {
            let message = concat!("this build does not read it: enable the feature `", $feature, "`");
            Err(LogError::of_file(file, $feature, message))
        }
    };
}

absent!("mcap", mcap_tables, Only<'_>);
absent!("rosbag", rosbag_tables, Only<'_>);
absent!("npz", npz_tables);
absent!("mat", mat_tables);

// What is odd about a log, and why one cannot be used.

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
