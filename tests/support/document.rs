//! Measured tables in the documentation: each stands between two markers and is written by the command that
//! measures it.

use std::io::{Error, ErrorKind};
use std::path::Path;

/// Replaces what stands between `<!-- NAME -->` and `<!-- end of NAME -->` in a file.
///
/// # Errors
/// Where the file cannot be read or written, or lacks the markers.
pub fn write_section(path: &Path, name: &str, text: &str) -> Result<(), Error> {
    let page = std::fs::read_to_string(path)?;
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let missing =
        || Error::new(ErrorKind::InvalidData, format!("{} has no section '{name}'", path.display()));
    let (before, rest) = page.split_once(&begin).ok_or_else(missing)?;
    let (_, after) = rest.split_once(&end).ok_or_else(missing)?;
    std::fs::write(path, format!("{before}{begin}{}\n{end}{after}", text.trim_end()))
}
