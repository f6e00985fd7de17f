//! Fits of logs whose truth is known: the virtual arm's, on random paths.

#![allow(clippy::unwrap_used)]

mod coverage;
mod estimators;
mod friction;
mod mountings;
mod noise_free;
pub(crate) mod plant;
mod summaries;
