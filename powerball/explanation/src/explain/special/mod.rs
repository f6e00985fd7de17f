//! Special properties of some logs, found before the search and separately from it.
//!
//! A validation set that repeats the path of the fitted logs cannot judge functions of that path
//! (`one_path`); there a fit of each joint by itself may predict better than one multibody model, and if the
//! times of logs do not show when they were recorded, the warming of the arm does. A body may be held in logs
//! of the validation set only, or in all others (`validation_only`), or push an arm that stands still
//! (`at_rest`).

mod at_rest;
mod one_path;
mod validation_only;

pub(super) use at_rest::pushes_at_rest;
pub(super) use one_path::{Clock, choose_clock, predicts_better, repeats};
pub(super) use validation_only::{Baseline, ValidationOnlyEffect, validation_only_effects};
