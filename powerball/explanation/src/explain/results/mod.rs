//! What is said of what was found.
//!
//! `conclude` makes the result ([`Explained`], in `explained` with its plots and what an experiment would decide) and the
//! warnings that a reader must know: `compose` the model of what was accepted and what that leaves, `unattributed` what stays
//! without a name and what it depends on, `correction` the formulas of what has no name and the curves that take a part of it
//! off, `logs` what is different in which log, `verdict` how far each joint is explained, whether all of it agrees, and how
//! often such a name is right.
//! JSON is made of these types by whoever writes it, and nothing here reads it.

mod compose;
mod conclude;
pub(super) mod correction;
mod explained;
mod logs;
pub(in super::super) mod unattributed;
mod verdict;

pub(super) use conclude::conclude;
pub use correction::{Correction, Curve, LawCoefficient, UnnamedLaw};
pub use explained::{Change, Experiment, Explained, NextExperiment, Shown, TorqueCurve, Trajectory, curves};
pub use logs::{Difference, LogResult};
pub use unattributed::Unattributed;
pub use verdict::{Evidence, FEATURES, State, Verdict, contradictions};
