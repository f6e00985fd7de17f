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
    let done = part(target).and_then(|mut part| {
        part.write_all(bytes)?;
        part.as_file().sync_all()?;
        part.persist(target).map_err(|e| e.error)
    });
    done.map(drop).map_err(|e| format!("{}: cannot be written: {e}", target.display()))
}

/// A file next to the target, which becomes it or is gone.
fn part(target: &Path) -> io::Result<tempfile::NamedTempFile> {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut part = tempfile::Builder::new();
    part.prefix(".").suffix(".part");
    // As any new file: who may read it is the umask's to say.
    #[cfg(unix)]
    part.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    part.tempfile_in(folder.unwrap_or(Path::new(".")))
}
