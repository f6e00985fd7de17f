//! From a robot arm's logs to a torque model with everything that the rigid model lacks; the model on a
//! controller; the arm on its CAN bus.
//!
//! [`identify()`] fits base parameters and friction to logs of positions and torques, with confidence
//! intervals. [`explain()`] finds the residual, names effects that cause it (payload, hysteresis, spring,
//! delay, …), and checks each on a path that was not fitted. [`compare()`] reports what differs between two
//! fits. The arm comes from an arm file ([`dyngen::Arm`](https://docs.rs/dyngen)).
//!
//! Each module is a package of its own (`powerball-controller` and so on) and a Cargo feature here: you build
//! only what you use. A module uses those above it in this table, never one below it.
//!
//! | module | feature | `std` | contents |
//! |---|---|---|---|
//! | [`controller`] | always; `lwa4p` adds the LWA 4P's generated model | no | friction, effects and control laws in the control loop |
//! | [`bus`] | `driver`; `bus` adds the ways to a bus | no; yes | CANopen, CiA 402, the arm's driver |
//! | [`logs`] | `identify` | yes | log files, signals, rows of the regression, summaries |
//! | [`identification`] | `identify` | yes | from rows to parameters, and the paths that excite them |
//! | [`comparison`] | `identify` | yes | two fits compared: which differences are significant |
//! | [`explanation`] | `explain` | yes | from the residual to named effects, and the model with them |
//! | [`virtual_arm`] | `virtual-arm` | yes | a simulated arm on a bus |
//! | [`procedure`] | `procedure` | yes | the paper's steps on a bus |
//! | [`report`] | `report` | yes | pages and figures of results |
//! | [`commands`] | `cli`; `offline` for the commands that need only files | yes | the `powerball` command, the demo |
//!
//! "The paper" is *Modeling and dynamic parameter identification of the SCHUNK Powerball robotic arm*;
//! equations and tables that are cited by number are its own.
//!
//! # From logs to a model
//!
#![cfg_attr(feature = "identify", doc = "```")]
#![cfg_attr(not(feature = "identify"), doc = "```ignore")]
//! use powerball::{Arrays, IdentifyOptions, Log, identify};
//! # let arm = "name = \"pendulum\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\n\
//! #     kind = \"revolute\"\na = 0.5\nalpha = 0\nd = 0\ntheta = 0\n";
//! let arm = dyngen::Arm::parse(arm, "pendulum.toml")?;
//! let t: Vec<f64> = (0..4000).map(|k| 0.005 * f64::from(k)).collect();
//! let q: Vec<f64> = t.iter().map(|t| (3.0 * t).sin()).collect();
//! // 1 kg at 0.5 m, without friction.
//! let torque = q.iter().map(|q| 0.25 * -9.0 * q + 0.5 * 9.81 * q.cos()).collect();
//! let arrays = Arrays { t: &t, q: &[q], torque: &[torque], ..Arrays::default() };
//! let (log, _findings) = Log::from_arrays("swing", &arm, &arrays)?;
//! let model = identify(&arm, [&log], [], &IdentifyOptions::default())?;
//! assert!(model.fit.relative[0] < 1e-3);
//! println!("{}", serde_json::to_string_pretty(&model)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # From logs to an explanation
//!
#![cfg_attr(feature = "explain", doc = "```no_run")]
#![cfg_attr(not(feature = "explain"), doc = "```ignore")]
//! use powerball::{ExplainOptions, explain, logs::log::read_logs};
//! let arm = dyngen::Arm::read("arm.toml".as_ref())?;
//! let (logs, _findings) = read_logs(&["a.csv", "b.csv", "c.csv"], &arm)?;
//! let (validate, _findings) = read_logs(&["another_path.csv"], &arm)?;
//! let explained = explain(&arm, &logs, &validate, &ExplainOptions::default())?;
//! for found in &explained.effects {
//!     println!("{} on joints {:?}", found.effect, found.joints);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A model in a control step
//!
//! [`controller`] has an example with the LWA 4P's model; `powerball generate` writes the same for any arm,
//! with every effect that was named.
#![no_std]

#[cfg(feature = "driver")]
#[doc(inline)]
pub use powerball_bus as bus;
#[cfg(any(feature = "demo", feature = "offline"))]
#[doc(inline)]
pub use powerball_commands::commands;
#[cfg(feature = "procedure")]
#[doc(inline)]
pub use powerball_commands::procedure;
#[cfg(feature = "report")]
#[doc(inline)]
pub use powerball_commands::report;
#[doc(inline)]
pub use powerball_controller as controller;
#[cfg(feature = "explain")]
#[doc(inline)]
pub use powerball_explanation as explanation;
#[cfg(feature = "identify")]
#[doc(inline)]
pub use powerball_identification::{self as identification, comparison};
#[cfg(feature = "identify")]
#[doc(inline)]
pub use powerball_logs as logs;
#[cfg(feature = "virtual-arm")]
#[doc(inline)]
pub use powerball_virtual_arm as virtual_arm;

#[cfg(feature = "identify")]
pub use comparison::{CompareOptions, Comparison, Side, compare};
#[cfg(feature = "explain")]
pub use explanation::{ExplainError, ExplainOptions, Explained, Rule, explain};
#[cfg(feature = "identify")]
pub use identification::{Identified, IdentifyError, IdentifyOptions, Source, identify};
#[cfg(feature = "identify")]
pub use logs::log::{Arrays, Log};
