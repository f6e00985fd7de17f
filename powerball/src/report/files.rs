//! The files of a result: what the commands write into their folder.

use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;

/// The files of a result by name.
#[derive(Clone, Debug, Default)]
pub struct Files(Vec<(&'static str, Vec<u8>)>);

impl Files {
    /// Adds a result as JSON, which is what `--json` prints where it is the first.
    ///
    /// # Errors
    /// A value that is no JSON.
    pub fn json(mut self, name: &'static str, value: &impl Serialize) -> Result<Files, String> {
        self.0.push((name, json(value)?.into_bytes()));
        Ok(self)
    }

    /// Adds a file as it is.
    #[must_use]
    pub fn with(mut self, name: &'static str, content: impl Into<Vec<u8>>) -> Files {
        self.0.push((name, content.into()));
        self
    }

    /// The text of the first file.
    #[must_use]
    pub fn first(&self) -> String {
        self.0.first().map_or(String::new(), |(_, content)| String::from_utf8_lossy(content).into_owned())
    }

    /// Writes all of them into a folder, which is made where it is missing.
    ///
    /// # Errors
    /// The path that cannot be written, and why.
    pub fn write(&self, folder: &Path) -> Result<(), String> {
        make_folder(folder)?;
        self.0.iter().try_for_each(|(name, content)| write_whole(&folder.join(name), content))
    }
}

/// A result as JSON text.
///
/// # Errors
/// A value that is no JSON.
pub fn json(value: &impl Serialize) -> Result<String, String> {
    serde_json::to_string_pretty(value).map_err(|e| format!("the result is no JSON: {e}"))
}

/// Makes a folder for results, where it is missing.
///
/// # Errors
/// The folder, and why it cannot be made.
pub fn make_folder(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: cannot be made: {e}", folder.display()))
}

/// Writes a file whole or not at all: a reader never sees half of it.
///
/// # Errors
/// The file, and why it cannot be written.
pub fn write_whole(target: &Path, bytes: &[u8]) -> Result<(), String> {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let part = target.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let done = std::fs::File::create(&part).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&part, target)
    });
    done.map_err(|e: io::Error| {
        let _ = std::fs::remove_file(&part);
        format!("{}: cannot be written: {e}", target.display())
    })
}
