//! The way back: what was identified, in a copy of the robot description that the arm was imported from.

mod body;
mod dcmotor;
mod edit;
mod known;
mod mjcf;
mod share;
mod term;
mod urdf;

pub use known::{Friction, Known};
pub use mjcf::mjcf;
pub use term::{Law, Term};
pub use urdf::{Exported, urdf};
