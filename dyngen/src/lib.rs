//! From a DH table, declared symmetries and a rotor model to the arm's dynamics.
//!
//! "The paper" is *Modeling and dynamic parameter identification of the SCHUNK Powerball robotic arm*; equations
//! and tables that are cited by number are its own.

pub mod arm;
pub mod base;
mod config;
pub mod consistency;
pub mod describe;
pub mod diagnostic;
pub mod dynamics;
pub mod emit;
mod evaluator;
pub mod exact;
#[cfg(feature = "urdf")]
pub mod export;
pub mod file;
pub mod graph;
#[cfg(feature = "urdf")]
pub mod import;
pub mod lagrangian;
mod model;
pub mod optimize;
pub mod parameters;
pub mod prove;
pub mod rounding;
mod values;
pub mod verify;

pub use arm::Arm;
pub use config::{Config, GenerateError, Language};
pub use diagnostic::{Diagnostic, Diagnostics};
pub use dynamics::Function;
pub use emit::FrictionTerm;
pub use evaluator::{Evaluator, Samples};
pub use model::{Error, Model};
pub use parameters::{ParameterSet, SetKind};
pub use values::Values;
