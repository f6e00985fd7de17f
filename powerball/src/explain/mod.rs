//! From what a model leaves to named effects: the rule that accepts, names or refuses them.
//!
//! The rule, in the order of the files: `screen` refits the base with each candidate, `evidence` asks clusters,
//! folds and another path, `placebo` measures how often the same questions are answered by chance on these very
//! data, `rule` holds every threshold with its reason, `family` keeps what may stand together, `forward` adds one effect
//! at a time, `naming` compares rivals, `leftover` says what stays, `compose` makes the model of what was accepted, `conclude` writes the result.

mod compose;
mod conclude;
mod curves;
mod evidence;
mod family;
mod folds;
mod forward;
mod leftover;
mod naming;
mod one_path;
mod other_path;
mod page;
mod placebo;
mod result;
mod rule;
mod screen;

pub use curves::{TorqueCurve, curves};
pub use forward::{ExplainError, Session, explain};
pub use page::add_to_page;
pub use result::{Explained, NamedEffect, Rival, Unattributed};

#[cfg(test)]
mod tests;
