//! The report on the findings.
//!
//! `conclude` makes the result ([`Explained`], in `explained` with its plots and what an experiment would
//! decide) and the warnings that a reader must know: `compose` makes the model with the accepted effects and
//! its residual, `unattributed` the residual without a name and its dependencies, `explainable` the share of
//! it that a smooth law could explain, `unnamed` the formulas of effects without a name, `logs` the
//! differences of each log, `verdict` how far each joint is explained, whether all parts agree, and how often
//! such a name is right. The caller writes these types as JSON, and no module here reads that.

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
