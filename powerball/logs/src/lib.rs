//! From log files to rows of the regression.
//!
//! [`tables`] reads files, [`log`] finds an arm's signals in them and checks them, [`signal`] filters and
//! differentiates, [`regression`] makes rows, [`summary`] reduces them to the statistics that a fit needs.

pub mod batch;
pub mod chain;
pub mod log;
#[cfg(test)]
#[path = "../../../tests/support/measured.rs"]
mod measured;
pub mod motion;
pub mod parallel;
pub mod regression;
pub mod signal;
pub mod summary;
pub mod tables;
pub mod vector;

use std::fmt;

/// A reader of short messages about the progress of a long computation; none by default.
#[derive(Clone, Copy, Default)]
pub struct Progress<'a>(Option<&'a (dyn Fn(&str) + Sync)>);

impl<'a> Progress<'a> {
    /// Calls this function.
    #[must_use]
    pub fn to(listener: &'a (dyn Fn(&str) + Sync)) -> Self {
        Progress(Some(listener))
    }

    /// Says what is being done now.
    pub fn say(&self, what: &str) {
        if let Some(listener) = self.0 {
            listener(what);
        }
    }
}

impl fmt::Debug for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Progress(somebody)" } else { "Progress(nobody)" })
    }
}
