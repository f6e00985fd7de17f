//! What the effects that an explanation accepted add to the torque, at control rate: no allocation, no `std`.
//!
//! Each [`Law`] is one basis function of the motion at one joint; a [`Term`] is a law with its coefficient.
//! The columns of the regression (`effects`) are these same laws along a log, and `powerball generate` copies
//! this module's source into the controller's file: there is one implementation of every formula.

mod law;

pub use law::{Corrector, Instant, Law, Memory, Term, add_torques, move_links};

#[cfg(test)]
mod tests;
/// The source of the laws, which `powerball generate` copies into a controller's file.
pub const SOURCE: &str = include_str!("law.rs");
