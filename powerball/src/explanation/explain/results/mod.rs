//! What is said of what was found.
//!
//! `conclude` makes the result ([`Explained`], in `explained`) and the warnings that a reader must know: `compose` the model
//! of what was accepted and what that leaves, `unattributed` what stays without a name and what it depends on, `laws` the
//! formulas of what has no name, `logs` what is different in which log, `correction` the curves that take a part of it off,
//! `verdict` how far each joint is explained, and whether all of it agrees, `probability` how often such a name is right,
//! `shown` the figures, `next` what an experiment would decide.
//! JSON is made of these types by whoever writes it, and nothing here reads it.

mod compose;
mod conclude;
pub(super) mod correction;
mod explained;
mod laws;
mod logs;
mod next;
mod probability;
mod shown;
pub(in super::super) mod unattributed;
mod verdict;

pub(super) use conclude::conclude;
pub use correction::{Correction, Curve};
pub use explained::{Change, Explained, TorqueCurve, curves};
pub use laws::{LawCoefficient, UnnamedLaw};
pub use logs::{Difference, LogResult};
pub use next::{Experiment, NextExperiment, Trajectory};
pub use probability::{Evidence, FEATURES};
pub use shown::Shown;
pub use unattributed::Unattributed;
pub use verdict::{State, Verdict, contradictions};
