//! What runs in the control loop of an arm: no `std`, no allocation, no panic.

#![cfg_attr(not(test), no_std)]

pub mod change;
pub mod correction;
pub mod dynamics;
pub mod friction;
mod joint_number;
pub mod laws;
#[cfg(feature = "lwa4p")]
pub mod model;
pub mod online;

pub use joint_number::JointNumber;
