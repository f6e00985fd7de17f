//! The runtime of an arm: friction, filters, identification and the residual loop.
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "std")]
pub mod demo;
#[cfg(feature = "std")]
pub mod excite;
pub mod friction;
pub mod model;
#[cfg(feature = "std")]
pub mod motion;
#[cfg(feature = "std")]
pub mod report;
#[cfg(feature = "std")]
pub mod virtual_arm;
