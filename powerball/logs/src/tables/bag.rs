//! Recordings of topics: a file, a file that is compressed as a whole, or the folder that rosbag2 makes of
//! several.

use super::contents::{Finding, Format, LogError};
use super::messages::Topics;
use serde::Deserialize;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The first bytes of a file that Zstandard compressed.
pub(super) const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";
/// The description that rosbag2 writes of a recording, in its folder.
const METADATA: &str = "metadata.yaml";

/// The files of a recording, in order.
pub(super) struct Parts {
    files: Vec<PathBuf>,
    /// Whether each message is compressed on its own.
    compressed_messages: bool,
    notes: Vec<Finding>,
}

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    relative_file_paths: Vec<String>,
    #[serde(default)]
    compression_format: String,
    #[serde(default)]
    compression_mode: String,
}

impl Parts {
    /// The parts of a file or a folder.
    pub(super) fn of(path: &Path) -> Result<Parts, LogError> {
        if !path.is_dir() {
            return Ok(Parts { files: vec![path.into()], compressed_messages: false, notes: Vec::new() });
        }
        let shown = path.display().to_string();
        let error = |what: String| LogError::of_file(&shown, "rosbag2", what);
        let mut notes = Vec::new();
        let (files, compressed_messages) = match std::fs::read_to_string(path.join(METADATA)) {
            Ok(text) => {
                let Metadata { rosbag2_bagfile_information: own } = serde_saphyr::from_str(&text)
                    .map_err(|e| error(format!("{METADATA} cannot be read: {e}")))?;
                let compressed = own.compression_mode.eq_ignore_ascii_case("message");
                if compressed && own.compression_format != "zstd" {
                    return Err(error(format!(
                        "its messages are compressed by {}: use zstd",
                        own.compression_format
                    )));
                }
                (own.relative_file_paths.iter().map(|name| path.join(name)).collect(), compressed)
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let files = unlisted(path).map_err(|e| error(format!("cannot be read: {e}")))?;
                if !files.is_empty() {
                    let what = format!(
                        "has no {METADATA}, as the recording was interrupted: its {} files were read by \
                        their numbers",
                        files.len()
                    );
                    notes.push(Finding::of_file(&shown, "rosbag2", what));
                }
                (files, false)
            }
            Err(e) => return Err(error(format!("{METADATA} cannot be read: {e}"))),
        };
        // The folder may have been moved without one of them.
        let (there, missing): (Vec<PathBuf>, Vec<PathBuf>) =
            files.into_iter().partition(|file| file.is_file());
        let missing: Vec<String> = missing.iter().map(|file| file.display().to_string()).collect();
        match (there.is_empty(), missing.is_empty()) {
            (true, true) => {
                return Err(error(
                    "is a folder without a recording: a .mcap, a .db3, or either as .zstd".into(),
                ));
            }
            (true, false) => {
                return Err(error(format!("the files of {METADATA} are not there: {}", missing.join(", "))));
            }
            (false, false) => {
                let what = format!("{} is not there: the other files were read", missing.join(", "));
                notes.push(Finding::of_file(&shown, "rosbag2", what));
            }
            (false, true) => {}
        }
        Ok(Parts { files: there, compressed_messages, notes })
    }

    /// The format of the first one.
    pub(super) fn format(&self) -> Result<Format, LogError> {
        self.files.first().map_or(Ok(Format::Mcap), |file| Format::of_file(file))
    }

    /// Reads them all.
    pub(super) fn read(self, topics: &mut Topics, notes: &mut Vec<Finding>) -> Result<(), LogError> {
        notes.extend(self.notes);
        topics.compressed = self.compressed_messages;
        for path in &self.files {
            topics.next_file();
            let file = path.display().to_string();
            let unpacked = unpacked(path)
                .map_err(|e| LogError::of_file(&file, "zstd", format!("cannot be unpacked: {e}")))?;
            let own = unpacked.as_ref().map_or(path.as_path(), tempfile::NamedTempFile::path);
            let (kind, read) = match Format::of_file(own)? {
                Format::Mcap => ("MCAP", mcap(own, topics)),
                Format::Rosbag => ("rosbag2", rosbag(own, topics)),
                Format::Bag => ("ROS 1 bag", bag1(own, topics)),
                _ => ("file", Err(io::Error::other("is not a recording of topics: unpack it first"))),
            };
            let wrong = read.map_err(|e| LogError::of_file(&file, kind, format!("cannot be read: {e}")))?;
            notes.extend(wrong.into_iter().map(|wrong| Finding::of_file(&file, kind, wrong)));
        }
        Ok(())
    }
}

/// The recordings in a folder by the numbers in their names: `bag_2` before `bag_10`.
fn unlisted(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let plain = name.strip_suffix(".zstd").unwrap_or(&name);
        if let Some(stem) = plain.strip_suffix(".mcap").or_else(|| plain.strip_suffix(".db3")) {
            let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
            let number: u64 = stem[stem.len() - digits..].parse().unwrap_or(0);
            files.push((number, path));
        }
    }
    files.sort();
    Ok(files.into_iter().map(|(_, path)| path).collect())
}

/// A file's unpacked content as a temporary file, which is deleted when dropped; `None` if it is not
/// compressed.
fn unpacked(path: &Path) -> io::Result<Option<tempfile::NamedTempFile>> {
    let mut file = File::open(path)?;
    let mut head = Vec::new();
    (&mut file).take(ZSTD.len() as u64).read_to_end(&mut head)?;
    if head != ZSTD {
        return Ok(None);
    }
    let mut out = tempfile::NamedTempFile::new()?;
    io::copy(&mut zstd::Decoder::new(File::open(path)?)?, &mut out)?;
    Ok(Some(out))
}

/// The first bytes of the content of a compressed file.
pub(super) fn unpacked_head(path: &Path, length: u64) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    zstd::Decoder::new(File::open(path)?)?.take(length).read_to_end(&mut head)?;
    Ok(head)
}

/// The message for a format that a build lacks.
macro_rules! reader {
    ($feature:literal, $function:ident, $read:expr) => {
        #[cfg(feature = $feature)]
        fn $function(path: &Path, topics: &mut Topics) -> io::Result<Vec<String>> {
            $read(path, topics)
        }

        #[cfg(not(feature = $feature))]
        fn $function(_: &Path, _: &mut Topics) -> io::Result<Vec<String>> {
            Err(io::Error::other(super::NOT_READ))
        }
    };
}

reader!("mcap", mcap, super::mcap::read);
reader!("rosbag", rosbag, super::rosbag::read);
reader!("bag1", bag1, super::bag1::read);
