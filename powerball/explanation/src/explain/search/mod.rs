//! The search for candidates, and the evidence for them.
//!
//! A screen refits the base model with each candidate (`screen`); the best ones of each effect are a
//! candidate group (`groups`); for the group that could reach most the evidence is gathered from independent
//! blocks, from held-out folds and from the validation set, and judged (`evidence`); time-shift surrogates
//! show how often these data agree by chance (`surrogates`). The settings in the model are refined until
//! everything together fits best, and effects that later additions made unnecessary are removed
//! (`elimination`).

mod cross_validation;
mod elimination;
mod evidence;
mod groups;
mod screen;
mod surrogates;

pub(super) use cross_validation::CrossValidation;
pub(super) use elimination::{eliminate, gains, keep_needed, refine};
pub(super) use evidence::{Extent, evidence, refusal};
pub(super) use groups::{CandidateKind, Group, Member, Tester, groups, is_left};
pub(super) use screen::Screen;
pub(super) use surrogates::{false_positives, level_by_chance, level_of_search};
