//! The runtime of an arm: friction, filters, identification and the residual loop.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

#[cfg(feature = "std")]
pub mod bus;
pub mod canopen;
pub mod cia402;
#[cfg(feature = "cli")]
pub mod cli;
pub mod correction;
#[cfg(feature = "std")]
pub mod demo;
pub mod driver;
#[cfg(feature = "std")]
pub mod effects;
#[cfg(feature = "std")]
pub mod estimate;
#[cfg(feature = "std")]
pub mod excite;
#[cfg(feature = "std")]
pub mod experiment;
#[cfg(feature = "std")]
pub mod explain;
pub mod friction;
#[cfg(feature = "std")]
pub mod log;
pub mod model;
#[cfg(feature = "std")]
pub mod motion;
pub mod online;
#[cfg(feature = "std")]
mod parallel;
#[cfg(feature = "std")]
pub mod procedure;
#[cfg(feature = "std")]
pub mod regression;
#[cfg(feature = "std")]
pub mod report;
#[cfg(feature = "std")]
pub mod signal;
#[cfg(feature = "std")]
pub mod summary;
#[cfg(feature = "std")]
pub mod torque_model;
#[cfg(feature = "std")]
pub mod virtual_arm;
