//! What is special of some logs, found before and beside the search.
//!
//! A validation set that repeats the path of the fitted logs cannot judge functions of that path
//! (`one_path`); there a fit of each joint by itself may predict better than one multibody model
//! (`per_joint`). Something may be held in logs of the validation set only, or in all others (`held`), or push an arm that stands
//! still (`at_rest`). And where the times of
//! logs do not tell when they were recorded, what warms does (`running_time`).

mod at_rest;
mod one_path;
mod per_joint;
mod running_time;
mod validation_only;

pub(super) use at_rest::{RestPush, pushes_at_rest};
pub(super) use one_path::repeats;
pub(super) use per_joint::predicts_better;
pub(super) use running_time::{Clock, choose_clock};
pub(super) use validation_only::{ValidationOnlyEffect, validation_only_effects};
