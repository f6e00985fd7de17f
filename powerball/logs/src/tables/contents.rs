//! A file's format, by its first bytes, and its tables.
//!
//! [`Finding`] is a note on a fault of a log, [`LogError`] the reason why a log cannot be used.

#[cfg(feature = "topics")]
use super::bag;
use super::place::Place;
use super::table::Table;
use super::{columnar, text};
use serde::Serialize;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The formats that are distinguished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Format {
    /// Lines of text with a header line.
    #[serde(rename = "CSV")]
    Csv,
    /// Columns in Parquet.
    Parquet,
    /// The folder of a LeRobot dataset.
    #[serde(rename = "LeRobot")]
    LeRobot,
    /// A rosbag2 of the storage `mcap`, or any other MCAP.
    #[serde(rename = "MCAP")]
    Mcap,
    /// A rosbag2 of the storage `sqlite3`.
    #[serde(rename = "rosbag2 (SQLite)")]
    Rosbag,
    /// A bag of ROS 1.
    #[serde(rename = "ROS 1 bag")]
    Bag,
    /// An archive of NumPy arrays.
    #[serde(rename = "npz")]
    Npz,
    /// One NumPy array.
    #[serde(rename = "npy")]
    Npy,
    /// A file of MATLAB's, of version 5 to 7.
    #[serde(rename = "mat")]
    Mat,
    /// HDF5; MATLAB's version 7.3 is such.
    #[serde(rename = "HDF5")]
    Hdf5,
}

/// The tables of a file.
#[derive(Clone, Debug)]
pub struct Contents {
    /// How it is stored.
    pub format: Format,
    /// One table, or one a topic.
    pub tables: Vec<Table>,
    /// Notes on faults of the file itself.
    pub notes: Vec<Finding>,
}

impl Format {
    /// The format by the first bytes of a file.
    #[must_use]
    pub fn of(head: &[u8]) -> Format {
        let begins = |magic: &[u8]| head.starts_with(magic);
        match () {
            () if begins(b"PAR1") => Format::Parquet,
            () if begins(b"\x89MCAP0\r\n") => Format::Mcap,
            () if begins(b"SQLite format 3\0") => Format::Rosbag,
            () if begins(b"#ROSBAG V2.0\n") => Format::Bag,
            () if begins(b"PK\x03\x04") => Format::Npz,
            () if begins(b"\x93NUMPY") => Format::Npy,
            () if begins(b"\x89HDF\r\n\x1a\n") || begins(b"MATLAB 7.3") => Format::Hdf5,
            () if begins(b"MATLAB ") => Format::Mat,
            () => Format::Csv,
        }
    }

    /// The format of the file at a path, by its first bytes. For the folder of a recording, its first file
    /// decides, and for a compressed recording its content. A folder with a `meta/info.json` is a dataset of
    /// LeRobot's, and so is that file.
    ///
    /// # Errors
    /// If the file cannot be read, is empty, or has none of the formats.
    pub fn of_file(path: &Path) -> Result<Format, LogError> {
        let failed =
            |e: std::io::Error| LogError::of_file(&shown(path), "file", format!("cannot be read: {e}"));
        dyngen::file::regular(path).map_err(failed)?;
        if dataset(path).is_some() {
            return Ok(Format::LeRobot);
        }
        #[cfg(feature = "topics")]
        if path.is_dir() {
            return bag::Parts::of(path)?.format();
        }
        let mut head = Vec::new();
        let read = File::open(path).and_then(|file| file.take(text::HEAD as u64).read_to_end(&mut head));
        read.map_err(failed)?;
        #[cfg(feature = "topics")]
        if head.starts_with(bag::ZSTD) {
            let packed = Format::of(&bag::unpacked_head(path, text::HEAD as u64).map_err(failed)?);
            // What else is compressed is refused below.
            if packed.has_topics() {
                return Ok(packed);
            }
        }
        let format = Format::of(&head);
        match text::no_text(&head).filter(|_| format == Format::Csv) {
            Some(what) => Err(LogError::of_file(&shown(path), "file", what)),
            None => Ok(format),
        }
    }

    /// Whether it is a recording of topics.
    #[must_use]
    pub fn has_topics(self) -> bool {
        matches!(self, Format::Mcap | Format::Rosbag | Format::Bag)
    }
}

/// The file that describes a dataset of LeRobot, within its folder.
pub(super) const INFO: &str = "meta/info.json";

/// The folder of a dataset of LeRobot, if a path is this folder or its `meta/info.json`.
pub(super) fn dataset(path: &Path) -> Option<PathBuf> {
    let folder = if path.ends_with(INFO) { path.ancestors().nth(2)? } else { path };
    folder.join(INFO).is_file().then(|| folder.to_path_buf())
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
/// If the file cannot be read, is truncated, or has a format that this build does not have.
pub fn read_contents(path: &Path) -> Result<Contents, LogError> {
    read_topics(&mut Place::of(path)?, &shown(path), None)
}

/// Like [`read_contents`], but reads only the topics of some names, if a file has topics; others are counted.
/// `file` is the name in messages.
pub(crate) fn read_topics(place: &mut Place, file: &str, only: Only<'_>) -> Result<Contents, LogError> {
    let (format, path) = (place.format, place.path.clone());
    let failed = |e: std::io::Error| LogError::of_file(file, "file", format!("cannot be read: {e}"));
    let mut notes = Vec::new();
    let tables = match format {
        Format::Csv => {
            let mut table = Table::new("", "lines");
            if text::read(File::open(&path).map_err(failed)?, file, &mut table, &mut notes)? {
                notes.push(Finding::of_file(file, "last line", "is torn"));
            }
            vec![table]
        }
        Format::Parquet => {
            let mut table = Table::new("", "rows");
            columnar::read(File::open(&path).map_err(failed)?, file, &mut table)?;
            vec![table]
        }
        Format::LeRobot => {
            let mut table = Table::new("", "rows");
            read_dataset(&path, file, &mut table, &mut notes)?;
            vec![table]
        }
        Format::Mcap | Format::Rosbag | Format::Bag => topic_tables(place, only, file, &mut notes)?,
        Format::Npz => npz_tables(&path, file, &mut notes)?,
        Format::Npy => npy_tables(&path, file, &mut notes)?,
        Format::Mat => mat_tables(&path, file, &mut notes)?,
        Format::Hdf5 => hdf5_tables(&path, file, &mut notes)?,
    };
    for table in &tables {
        if let Some((count, reason)) = &table.unreadable {
            let message =
                format!("{count} messages could not be read (the first: {reason}) and were left out");
            notes.push(Finding::of_file(file, &table.name, message));
        }
    }
    Ok(Contents { format, tables, notes })
}

#[cfg(feature = "parquet")]
pub(crate) use super::lerobot::read as read_dataset;

#[cfg(not(feature = "parquet"))]
pub(crate) fn read_dataset(
    _: &Path,
    file: &str,
    _: &mut impl super::RowSink,
    _: &mut Vec<Finding>,
) -> Result<(), LogError> {
    Err(LogError::of_file(file, "LeRobot", super::NOT_READ))
}

#[cfg(feature = "topics")]
fn topic_tables(
    place: &mut Place,
    only: Only<'_>,
    file: &str,
    notes: &mut Vec<Finding>,
) -> Result<Vec<Table>, LogError> {
    let mut topics = super::messages::Topics::of(only);
    let refused = |e: std::io::Error| LogError::of_file(file, "topics", format!("cannot be read: {e}"));
    #[cfg(feature = "remote")]
    if let super::remote::Remote::Read(object) = &mut place.remote {
        let wrong = super::mcap::read_from(object, &mut topics)
            .map_err(|e| LogError::of_file(file, "MCAP", format!("cannot be read: {e}")))?;
        notes.extend(wrong.into_iter().map(|wrong| Finding::of_file(file, "MCAP", wrong)));
        return topics.tables().map_err(refused);
    }
    bag::Parts::of(&place.path)?.read(&mut topics, notes)?;
    topics.tables().map_err(refused)
}

#[cfg(not(feature = "topics"))]
fn topic_tables(
    _: &mut Place,
    _: Only<'_>,
    file: &str,
    _: &mut Vec<Finding>,
) -> Result<Vec<Table>, LogError> {
    Err(LogError::of_file(file, "topics", super::NOT_READ))
}

/// Files of arrays: what each kind of them is called, the feature that reads it, and its reader.
macro_rules! arrays {
    ($name:literal, $feature:literal, $function:ident, $read:expr) => {
        #[cfg(feature = $feature)]
        fn $function(path: &Path, file: &str, notes: &mut Vec<Finding>) -> Result<Vec<Table>, LogError> {
            let read = $read(path);
            let (tables, left_out) = read.map_err(|e: std::io::Error| {
                LogError::of_file(file, $name, format!("cannot be read: {e}"))
            })?;
            notes.extend(left_out.into_iter().map(|note| Finding::of_file(file, "arrays", note)));
            Ok(tables)
        }

        #[cfg(not(feature = $feature))]
        fn $function(_: &Path, file: &str, _: &mut Vec<Finding>) -> Result<Vec<Table>, LogError> {
            Err(LogError::of_file(file, $name, super::NOT_READ))
        }
    };
}

arrays!("npz", "npz", npz_tables, super::npz::read);
arrays!("npy", "npz", npy_tables, super::npz::read_array);
arrays!("mat", "mat", mat_tables, super::mat::read);
arrays!("HDF5", "hdf5", hdf5_tables, super::hdf5::read);

// Faults of a log, and the reasons why one cannot be used.

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
    /// The fault, how it was handled, and what to do.
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
