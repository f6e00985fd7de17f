//! The runtime of a robot arm: friction and torque corrections on a controller, a CANopen driver, and the way
//! from logs to a model that explains them.
//!
//! The crate is a house of a few rooms. A room uses the rooms above it in this list and never one below it;
//! each has a feature of its own, so that nobody builds what he does not use.
//!
//! | room | feature | `std` | who lives there |
//! |---|---|---|---|
//! | [`controller`] | always; `lwa4p` adds the LWA 4P's generated model | no | what runs in the control loop |
//! | [`bus`] | `driver`; `bus` adds the ways to a bus | no; yes | CANopen, CiA 402, the arm's driver |
//! | [`logs`] | `identify` | yes | log files, signals, rows of the regression, summaries |
//! | [`identification`] | `identify` | yes | from rows to parameters, and the paths that excite them |
//! | [`explanation`] | `explain` | yes | from what a model leaves to named effects, and to the model with them |
//! | [`virtual_arm`] | `virtual-arm` | yes | an arm to try all of it on |
//! | [`procedure`] | `procedure` | yes | the paper's steps on a bus |
//! | [`report`] | `report` | yes | pages and figures of results |
//! | [`commands`] | `cli` | yes | the `powerball` command, its pages, the demo |
//!
//! "The paper" is *Modeling and dynamic parameter identification of the SCHUNK Powerball robotic arm*;
//! equations and tables that are cited by number are its own.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

#[cfg(feature = "driver")]
pub mod bus;
#[cfg(feature = "cli")]
pub mod commands;
pub mod controller;
#[cfg(feature = "explain")]
pub mod explanation;
#[cfg(feature = "identify")]
pub mod identification;
#[cfg(feature = "identify")]
pub mod logs;
#[cfg(feature = "procedure")]
pub mod procedure;
#[cfg(feature = "report")]
pub mod report;
#[cfg(feature = "virtual-arm")]
pub mod virtual_arm;

#[cfg(feature = "explain")]
pub use explanation::{ExplainError, ExplainOptions, Explained, Rule, explain};
