//! The place of a log: a file, a folder, or an address.

use super::contents::{Format, LogError};
use std::path::{Path, PathBuf};

/// The beginnings of addresses.
const ADDRESSES: [&str; 3] = ["http://", "https://", "s3://"];

/// Whether a path is an address, at which only the feature `remote` reads.
#[must_use]
pub fn is_address(path: &Path) -> bool {
    Place::address(path).is_some()
}

/// A log that was found, and how it is stored.
pub(crate) struct Place {
    /// The file or folder; of an address its copy, where there is one.
    pub(crate) path: PathBuf,
    pub(crate) format: Format,
    #[cfg(feature = "remote")]
    pub(super) remote: super::remote::Remote,
}

impl Place {
    /// Looks at what a path or an address names.
    ///
    /// # Errors
    /// Where it cannot be read or reached, is empty, or is of no format that is known.
    pub(crate) fn of(path: &Path) -> Result<Place, LogError> {
        match Place::address(path) {
            Some(address) => Place::at(address),
            None => Ok(Place {
                path: path.to_path_buf(),
                format: Format::of_file(path)?,
                #[cfg(feature = "remote")]
                remote: super::remote::Remote::No,
            }),
        }
    }

    /// A path that is an address.
    pub(crate) fn address(path: &Path) -> Option<&str> {
        path.to_str().filter(|path| ADDRESSES.iter().any(|begin| path.starts_with(begin)))
    }

    #[cfg(feature = "remote")]
    fn at(address: &str) -> Result<Place, LogError> {
        let (path, format, remote) = super::remote::reached(address)?;
        Ok(Place { path, format, remote })
    }

    #[cfg(not(feature = "remote"))]
    fn at(address: &str) -> Result<Place, LogError> {
        let message = format!("fetch the file, or: {}", super::NOT_READ);
        Err(LogError::of_file(address, "address", message))
    }
}
