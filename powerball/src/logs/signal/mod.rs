//! From samples as they were logged to samples a regression can use: filters, even grids, derivatives, rest.

mod biquad;
pub mod butterworth;
pub mod difference;
pub mod filter;
mod lanes;
pub mod occupied;
pub mod resample;
pub mod rest;
pub mod turns;

pub use biquad::Biquad;
pub use butterworth::Butterworth;
pub use filter::{BANDS, Band};
