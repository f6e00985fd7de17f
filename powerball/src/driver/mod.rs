//! The arm as one thing.
pub mod budget;
pub mod cause;
pub mod dictionary;
mod guard;
#[cfg(feature = "std")]
pub mod import;
pub mod lwa4p;
pub mod profile;
pub mod units;

pub use cause::{Cause, Refusal};
pub use guard::Rejection;
pub use profile::{ControlMode, JointProfile, Profile};
