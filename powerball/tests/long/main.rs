//! Tests that take tens of seconds each on one core. They are one program, so that they run next to each
//! other.

#![allow(clippy::unwrap_used, clippy::panic)]

mod contact;
mod coupled_wrist;
mod generated;
mod mountings;
mod poor_logs;
mod round_trip;
