//! The way back: what was identified, in a copy of the robot description that the arm was imported from.

mod body;
mod edit;
mod known;
mod mjcf;
mod share;
mod urdf;

pub use known::{Friction, Known};
pub use mjcf::mjcf;
pub use urdf::{Exported, urdf};
