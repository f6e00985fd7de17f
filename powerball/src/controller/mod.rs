//! What runs in the control loop of an arm: no `std`, no allocation, no panic.

pub mod correction;
pub mod friction;
#[cfg(feature = "lwa4p")]
pub mod model;
pub mod online;
