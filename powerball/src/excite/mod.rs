//! Exciting trajectories: finite Fourier series within the arm's limits whose base regressor is well conditioned,
//! Eq. 17 to 20 of the paper.

mod fourier;
mod limits;
mod objective;
mod search;

pub use fourier::{Fourier, Harmonics};
pub use limits::{JointLimits, Limits, MissingLimits};
pub use objective::{Figures, Objective};
pub use search::{Excitation, Settings, optimise, search};

use std::fmt;

/// Why there is no exciting trajectory.
#[derive(Clone, Debug)]
pub enum Error {
    /// The arm file does not say what the joints may do.
    Limits(MissingLimits),
    /// The arm's model or its regressor is not to be had.
    Model(dyngen::Error),
    /// A setting makes no sense: what is wrong with it.
    Setting(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Limits(e) => e.fmt(f),
            Error::Model(e) => e.fmt(f),
            Error::Setting(what) => f.write_str(what),
        }
    }
}

impl std::error::Error for Error {}

impl From<MissingLimits> for Error {
    fn from(e: MissingLimits) -> Self {
        Error::Limits(e)
    }
}

impl From<dyngen::Error> for Error {
    fn from(e: dyngen::Error) -> Self {
        Error::Model(e)
    }
}
