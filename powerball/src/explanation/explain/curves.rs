//! Torques over time on the other path, for people to look at.

pub use crate::identification::estimate::{TorqueCurve, curves};
