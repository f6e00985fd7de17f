//! Torques over time on the validation set, for people to look at.

pub use crate::identification::estimate::{TorqueCurve, curves};
