//! The runtime of an arm: friction, filters, identification and the residual loop.
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "std")]
pub mod effects;
#[cfg(feature = "std")]
pub mod estimate;
#[cfg(feature = "std")]
pub mod explain;
pub mod friction;
#[cfg(feature = "std")]
pub mod log;
#[cfg(feature = "std")]
mod parallel;
#[cfg(feature = "std")]
pub mod regression;
#[cfg(feature = "std")]
pub mod signal;
