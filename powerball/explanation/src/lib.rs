//! From the residual of a model to named effects, and to a model with these effects.
//!
//! | module | content |
//! |---|---|
//! | [`effects`] | one file for each effect that a model may lack: **how a log row becomes a column** |
//! | [`mod@explain`] | the pipeline that finds effects; its `comparison` **decides that a name is given** |
//! | [`experiment`] | for open names: the path on which they differ most, and the decision by its log |
//! | [`torque_model`] | a model with its effects: its file, its torque along logs, its controller's code |
//! | [`fmu`] | such a model as an FMU: it moves under torques, in C |
//! | [`watch`] | tests along a stream whether a model still holds: since when not, on which joints and why |
//!
//! [`explain()`] is the API, and [`Rule`] holds every threshold.
//!
//! ```no_run
//! use powerball_explanation::{ExplainOptions, explain};
//! use powerball_logs::log::read_logs;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let arm = dyngen::Arm::read("arm.toml".as_ref())?;
//! let (logs, _) = read_logs(&["a.csv", "b.csv", "c.csv"], &arm)?;
//! let (validate, _) = read_logs(&["another_path.csv"], &arm)?;
//! let explained = explain(&arm, &logs, &validate, &ExplainOptions::default())?;
//! for found in &explained.effects {
//!     println!("{} on joints {:?}: {:?}", found.effect, found.joints, found.figures);
//! }
//! std::fs::write("explained.json", serde_json::to_string_pretty(&explained)?)?;
//! # Ok(())
//! # }
//! ```

mod api;
pub mod effects;
pub mod experiment;
pub mod explain;
pub mod fmu;
mod options;
mod rule;
pub mod servo;
pub mod simulate;
pub mod torque_model;
pub mod watch;

pub use api::{Prepared, explain};
pub use explain::{Explained, explain_body};
pub use options::{ExplainError, ExplainOptions, RuledOut};
pub use rule::{Rule, RuleError};
