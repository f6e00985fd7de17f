//! Regular files for reading. Pipes and devices are refused: reading one may never begin or never end.

use std::fs::File;
use std::io;
use std::path::Path;

/// Refuses a path that is neither a file nor a folder, before it is opened.
///
/// # Errors
/// The kind of the path and what to do, or the system's error if there is nothing.
pub fn regular(path: &Path) -> io::Result<()> {
    let kind = std::fs::metadata(path)?.file_type();
    match kind.is_file() || kind.is_dir() {
        true => Ok(()),
        false => Err(io::Error::other(
            "it is a pipe or a device, which may never end: write its data to a file and give that file",
        )),
    }
}

/// Opens a file.
///
/// # Errors
/// Those of [`regular`].
pub fn open(path: &Path) -> io::Result<File> {
    regular(path)?;
    File::open(path)
}

/// The bytes of a file.
///
/// # Errors
/// Those of [`regular`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    regular(path)?;
    std::fs::read(path)
}

/// The text of a file.
///
/// # Errors
/// The errors of [`regular`], and text that is not UTF-8.
pub fn text(path: &Path) -> io::Result<String> {
    regular(path)?;
    std::fs::read_to_string(path)
}
