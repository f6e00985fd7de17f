//! Exciting trajectories: finite Fourier series whose base regressor is well conditioned, within the arm's
//! limits, off the floor and clear of the arm itself, for one mounting of the base or several. Eq. 17 to 20
//! of the paper. [`excite`] makes trajectories from an arm in one call.

mod acceleration;
mod constraints;
mod fourier;
mod load;
mod objective;
mod search;
mod shape;
mod trajectories;

pub use crate::mounting::Mounting;
pub use constraints::{
    CLEARANCE, Constraints, FloorAt, JointLimits, Limits, MissingLimits, RADIUS, Segment, Space, Tightest,
    surroundings,
};
pub use fourier::{Fourier, Harmonics};
pub use load::{Load, Masses};
pub use objective::{Conditioning, Conditions, Criterion, Objective};
pub use search::{
    Excitation, ExcitationSettings, SEARCH, Task, optimise, optimise_all, search, search_all, searches,
};
pub use shape::{Contact, Floor, Nearness, Shape};
pub use trajectories::{Collision, ExciteOptions, Excited, MassSource, Trajectory, excite};

/// Why there is no exciting trajectory.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    /// The arm file does not say what the joints may do.
    #[error(
        "{0}. The acceleration of a joint that has a `torque` limit can be taken from that: give the masses \
                 with --values (`dyngen import` writes ARM.values.json)"
    )]
    Limits(MissingLimits),
    /// The arm's model or its regressor cannot be derived.
    #[error("{0}")]
    Model(dyngen::Error),
    /// A setting is invalid: the reason.
    #[error("{0}")]
    Setting(String),
    /// The arm touches itself or the floor in every pose.
    #[error(
        "the arm touches itself or the floor in every pose that was tried: its capsules are too \
                    thick for it, or the floor is too high"
    )]
    NoPose,
    /// No path was found that keeps all constraints: where the best one breaks them.
    #[error("no trajectory was found that keeps all constraints; in the best one {0}")]
    NoPath(String),
    /// The arm cannot stand at the stated pose before the trajectory.
    #[error("the arm cannot stand at --from, base {mounting}: {why}")]
    NoStart {
        /// How the base stands.
        mounting: Mounting,
        /// The obstacle.
        why: String,
    },
    /// The trajectory does not keep its constraints between the instants of the search: where.
    #[error("the trajectory that was found breaks a limit: {0}")]
    Broken(String),
}

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
