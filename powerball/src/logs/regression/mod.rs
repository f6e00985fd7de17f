//! From logs to the rows of a regression: minimal-set regressor, friction columns, one band for all.

mod gravity_unobservable;
mod inactive;
pub(crate) mod newton_euler;
mod per_joint;
mod prepare;
mod recording;
mod rest_notes;
mod rigid;
mod row_selection;
mod rows;
mod saturated;

pub use inactive::inactive_joints;
pub use prepare::{Data, DataError, DataOptions, PULLED, column_in_bands};
pub(crate) use prepare::{FRICTION, top_velocity};
pub use recording::Recording;
pub(crate) use rest_notes::{FEWEST_ROWS, rest_note};
pub use rigid::RigidArm;
pub use rows::{Block, Column, JointRows};
