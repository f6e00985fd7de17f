//! From samples as they were logged to samples a regression can use: filters, even grids, derivatives, rest.

pub mod butterworth;
pub mod difference;
pub mod filter;
pub mod motion;
pub mod resample;

pub use butterworth::{Biquad, Butterworth};
pub use filter::{BANDS, Band};
