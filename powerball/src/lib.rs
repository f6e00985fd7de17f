//! The runtime of an arm: friction, filters, identification and the residual loop.
#![cfg_attr(not(feature = "std"), no_std)]

pub mod friction;
#[cfg(feature = "std")]
pub mod log;
#[cfg(feature = "std")]
pub mod signal;
