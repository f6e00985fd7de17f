//! What is reported about the findings.
//!
//! `conclude` makes the result ([`Explained`], in `explained` with its plots and what an experiment would decide) and the
//! warnings that a reader must know: `compose` the model of what was accepted and what that leaves, `unattributed` what stays
//! without a name and what it depends on, `explainable` how much of the rest some law could be, `unnamed` the formulas of what has no name, `logs` what is different in which log, `verdict` how far each joint is explained, whether all of it agrees, and how
//! often such a name is right.
//! JSON is made of these types by whoever writes it, and nothing here reads it.

mod compose;
mod conclude;
mod explainable;
mod explained;
mod logs;
mod unattributed;
mod unnamed;
mod verdict;

pub(super) use conclude::conclude;
pub use explained::{Change, Experiment, Explained, NextExperiment, Shown, TorqueCurve, Trajectory, curves};
pub use logs::{Difference, LogResult};
pub use unattributed::Unattributed;
pub use unnamed::{LawCoefficient, UnnamedLaw};
pub use verdict::{Evidence, FEATURES, State, Verdict, contradictions};
