//! Which name a residual gets: **here it is decided that a name is given, and where it is taken back.**
//!
//! The candidate group that a step chose is compared with all others on its joints (`naming`). Two names that
//! fit alike are a question for an experiment; what the steps decided and left open is their history (`open`). Once
//! everything that fits is in the model, a name is taken back (`withhold`) that says something of a pace
//! of motion that is not there, that is not distinguished from others while much is left, or that does harm
//! on logs to judge on.

mod naming;
mod open;
mod withhold;

pub(super) use naming::{Comparison, compare, relative_score};
pub(super) use open::{History, Question, Step, open};
pub use open::{Hypothesis, Open};
pub(super) use withhold::{leftover, withhold, withhold_harmful};
