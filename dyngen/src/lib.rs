//! From a robot arm's geometry to its dynamics: exact base parameters, and code for a controller that is
//! proven equal to the Lagrangian.
//!
//! What goes in is an arm file: DH table, declared symmetries, rotors, limits ([`Arm`]; `dyngen import`
//! writes one from a URDF or a MuJoCo model). What comes out: the parameters that torques depend on
//! ([`ParameterSet`]), and any function of the arm ([`Function`]: regressor, B, C, g, inverse and forward
//! dynamics, derivatives, kinematics) as Rust without allocation, C99, CUDA or WGSL, or evaluated here.
//! Nothing is emitted or evaluated before it was proven.
//!
//! # In a build script
//!
//! ```no_run
//! // build.rs, with dyngen = { version = "0.1", default-features = false } under [build-dependencies].
//! dyngen::Config::new("arm.toml").build("arm.rs").unwrap_or_else(|e| e.exit());
//! // In the crate: mod arm { include!(concat!(env!("OUT_DIR"), "/arm.rs")); }
//! ```
//!
//! # At run time
//!
//! ```
//! use dyngen::{Arm, Evaluator, Function, Model, Samples, SetKind};
//!
//! // One link of 0.5 m that swings in the x-y plane, gravity along −y.
//! let text = r#"
//! name = "pendulum"
//! convention = "standard"
//! gravity = [0, -9.81, 0]
//! [[joint]]
//! kind = "revolute"
//! a = 0.5
//! alpha = 0
//! d = 0
//! theta = 0
//! "#;
//! let model = Model::derive(Arm::parse(text, "pendulum.toml")?)?;
//! let minimal = model.set(SetKind::Minimal)?;
//! assert_eq!(minimal.parameters.len(), 3); // two moments of mass and one of inertia
//!
//! // The regressor Y(q, q̇, q̈), one row a joint: τ = Y·π.
//! let regressor = Evaluator::new(&model, Function::Regressor, SetKind::Minimal)?;
//! let mut y = [0.0; 3];
//! let samples = Samples { q: &[0.3], dq: &[0.0], ddq: &[2.0], ..Samples::default() };
//! regressor.run(&samples, &mut y);
//! assert!(y.iter().any(|entry| (entry - 2.0).abs() < 1e-12)); // q̈ times the moment of inertia
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Modules, in the order of use
//!
//! [`arm`] describes an arm, [`import`] reads other files, [`describe`] reports what is known of it,
//! [`consistency`] checks values, [`emit`] writes code, [`verify`] proves a file that was written, [`export`]
//! writes values back into a URDF or a MuJoCo model, [`rounding`] bounds the error of floating point.
//!
//! "The paper" is *Modeling and dynamic parameter identification of the SCHUNK Powerball robotic arm*;
//! equations and tables that are cited by number are its own.

pub mod base;
mod config;
pub mod consistency;
pub mod describe;
pub mod dynamics;
pub mod emit;
mod evaluator;
#[cfg(feature = "urdf")]
pub mod export;
#[doc(hidden)]
pub mod graph;
#[cfg(feature = "urdf")]
pub mod import;
#[doc(hidden)]
pub mod lagrangian;
mod model;
#[doc(hidden)]
pub mod optimize;
pub mod parameters;
#[doc(hidden)]
pub mod prove;
pub mod rounding;
mod values;

pub use config::{Config, GenerateError};
pub use dyngen_arm::{Arm, Diagnostic, Diagnostics, Function, Language, arm, diagnostic};
#[doc(hidden)]
pub use dyngen_arm::{exact, file};
pub use dyngen_verify as verify;
pub use emit::FrictionTerm;
pub use evaluator::{Evaluator, Samples};
pub use model::{Error, Model};
pub use parameters::{ParameterSet, SetKind};
pub use values::Values;
