//! From log files to rows of the regression.
//!
//! [`tables`] reads files, [`log`] finds an arm's signals in them and doubts them, [`signal`] filters and
//! differentiates, [`regression`] makes rows, [`summary`] keeps of them what a fit needs.

pub mod batch;
pub mod log;
pub(crate) mod parallel;
mod progress;
pub mod regression;
pub mod signal;
pub mod summary;
pub mod tables;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod vector;

pub use progress::Progress;
