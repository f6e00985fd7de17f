//! From logs to the rows of a regression: minimal-set regressor, friction columns, one band for all.

mod hidden;
mod kept;
pub(crate) mod newton_euler;
mod per_joint;
mod prepare;
mod recording;
mod rest_notes;
mod rigid;
mod rows;
mod saturated;
mod silent;

pub use prepare::{Data, DataError, DataOptions, PULLED, column_in_bands};
pub(crate) use prepare::{FRICTION, top_velocity};
pub use recording::Recording;
pub(crate) use rest_notes::{FEWEST_ROWS, rest_note};
pub use rigid::RigidArm;
pub use rows::{Block, Column, JointRows};
pub use silent::silent_joints;
