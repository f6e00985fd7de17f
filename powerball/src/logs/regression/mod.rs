//! From logs to the rows of a regression: minimal-set regressor, friction columns, one band for all.

mod apart;
mod hidden;
#[cfg(test)]
pub(crate) mod newton_euler;
mod prepare;
mod recording;
mod rigid;
mod rows;
mod silent;

pub use prepare::{Data, DataError, DataOptions, column_in_bands};
pub use recording::Recording;
pub use rigid::RigidBody;
pub use rows::{Block, Column, JointRows};
pub use silent::silent_joints;
