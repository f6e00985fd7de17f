//! From a DH table, declared symmetries and a rotor model to the arm's dynamics.

pub mod arm;
pub mod base;
pub mod diagnostic;
pub mod dynamics;
pub mod exact;

pub use arm::Arm;
pub use diagnostic::{Diagnostic, Diagnostics};
