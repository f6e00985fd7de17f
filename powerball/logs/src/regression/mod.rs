//! From logs to the rows of a regression: minimal-set regressor, friction columns, one band for all.

pub mod newton_euler;
mod prepare;
mod recording;
mod rigid;
mod row_selection;
mod rows;
mod signals;

pub use prepare::{Data, DataError, DataOptions, PULLED, column_in_bands};
pub use prepare::{FRICTION, top_velocity};
pub use recording::Recording;
pub use rigid::RigidArm;
pub use row_selection::inactive_joints;
pub use row_selection::{FEWEST_ROWS, rest_note};
pub use rows::{Block, Column, JointRows};
pub use signals::Signals;
