//! The way back: what was identified, in a copy of the robot description that the arm was imported from.

mod body;
mod edit;
mod known;
mod urdf;

pub use known::{Friction, Known};
pub use urdf::{Exported, urdf};
