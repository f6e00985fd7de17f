//! Kinematics, the Lagrangian (exact), and the recursions that are emitted (graph).

pub mod elements;
pub mod lagrangian;
