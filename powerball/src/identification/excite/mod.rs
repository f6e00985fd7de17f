//! Exciting trajectories: finite Fourier series whose base regressor is well conditioned, within the arm's
//! limits, off the floor and clear of the arm itself, for one mounting of the base or several. Eq. 17 to 20
//! of the paper. [`excite`] is the whole way from an arm to trajectories.

mod acceleration;
mod constraints;
mod fourier;
mod load;
mod objective;
mod search;
mod shape;
mod trajectories;

pub use crate::identification::mounting::Mounting;
pub use constraints::{
    CLEARANCE, Constraints, FloorAt, JointLimits, Limits, MissingLimits, RADIUS, Segment, Space, Tightest,
    surroundings,
};
pub use fourier::{Fourier, Harmonics};
pub use load::{Load, Masses};
pub use objective::{Conditions, Criterion, Figures, Objective};
pub use search::{Excitation, SEARCH, Settings, Task, optimise, optimise_all, search, search_all, searches};
pub use shape::{Contact, Floor, Nearness, Shape};
use std::fmt;
pub use trajectories::{Collision, ExciteOptions, Excited, MassSource, Trajectory, excite};

/// Why there is no exciting trajectory.
#[derive(Clone, Debug)]
pub enum Error {
    /// The arm file does not say what the joints may do.
    Limits(MissingLimits),
    /// The arm's model or its regressor is not to be had.
    Model(dyngen::Error),
    /// A setting makes no sense: what is wrong with it.
    Setting(String),
    /// There is no room for the arm in any pose.
    NoPose,
    /// No path was found that keeps all constraints: where the best one breaks them.
    NoPath(String),
    /// The arm cannot stand where it is said to be before the trajectory.
    NoStart {
        /// How the base stands.
        mounting: Mounting,
        /// What is in the way.
        why: String,
    },
    /// The trajectory does not keep its constraints between the instants of the search: where.
    Broken(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Limits(e) => write!(
                f,
                "{e}. The acceleration of a joint that has a `torque` limit can be taken from that: give the masses with \
                 --values (`dyngen import` writes ARM.values.json)"
            ),
            Error::Model(e) => e.fmt(f),
            Error::Setting(what) => f.write_str(what),
            Error::NoPose => f.write_str(
                "the arm touches itself or the floor in every pose that was tried: its capsules are too \
                    thick for it, or the floor is too high",
            ),
            Error::NoPath(why) => {
                write!(f, "no trajectory was found that keeps all constraints; in the best one {why}")
            }
            Error::NoStart { mounting, why } => {
                write!(f, "the arm cannot stand at --from, base {mounting}: {why}")
            }
            Error::Broken(why) => write!(f, "the trajectory that was found does not hold: {why}"),
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
