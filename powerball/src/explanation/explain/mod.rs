//! From what a model leaves to named effects: the rule that accepts, names or refuses them.
//!
//! The rule, in the order of the files: `screen` refits the base with each candidate, `evidence` asks
//! clusters, folds and another path, `placebo` measures how often the same questions are answered by chance
//! on these very data, `rule` holds every threshold with its reason, `family` keeps what may stand together,
//! `forward` adds one effect at a time, `taken_back` removes what does not stay, `settings` moves what stays
//! to where everything together fits best, `naming` compares rivals, `open` keeps those that are not told
//! apart, `leftover` says what stays, `correction` takes off of it what it can, `shown` draws what each name
//! is seen by, `compose` makes the model of what was accepted, `conclude` writes the result.

mod apart;
mod compose;
mod conclude;
mod constancy;
mod correction;
mod curves;
mod doubts;
mod evidence;
mod family;
mod folds;
mod forward;
mod leftover;
mod naming;
mod one_path;
mod open;
mod other_path;

mod placebo;
mod result;
mod rule;
mod running_time;
mod screen;
mod settings;
mod shown;
mod taken_back;

pub use correction::{Correction, Curve};
pub use curves::{TorqueCurve, curves};
pub use forward::{ExplainError, Options, RuledOut, Session, explain, explain_with};
pub use open::{Hypothesis, Open};

pub use result::{Change, Explained, NamedEffect, Rival, Unattributed};
pub use shown::Shown;

#[cfg(test)]
mod tests;
