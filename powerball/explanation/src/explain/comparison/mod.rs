//! The name of a residual: **this module decides that a name is given, and when it is taken back.**
//!
//! The candidate group that a step chose is compared with all others on its joints (`naming`). Two names that
//! fit equally well are a question for an experiment; the decisions of the steps and the open questions are
//! the history (`open`). Once everything that fits is in the model, a name is taken back (`withhold`) if its
//! effect is missing at some speed of motion, if it cannot be distinguished from others while much error
//! remains, or if it raises the error on the validation logs.

mod naming;
mod open;
mod withhold;

pub(super) use naming::{Comparison, compare, relative_score};
pub(super) use open::{History, Question, Step, open};
pub use open::{Hypothesis, Open};
pub(super) use withhold::{leftover, withhold, withhold_harmful};
