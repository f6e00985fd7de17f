//! From what a model leaves to named effects, and to the model that has them.

pub mod effects;
pub mod experiment;
pub mod explain;
pub mod torque_model;
