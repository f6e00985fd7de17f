//! The arm on its CAN bus: CANopen and the drive profile as values, the driver above them, and ways to a bus.
//!
//! [`canopen`], [`cia402`] and [`driver`] need no `std`: frames go in and out, and time is handed in.
//! [`transport`] sends and receives the frames.

#![cfg_attr(not(any(feature = "std", test)), no_std)]

pub mod canopen;
pub mod cia402;
pub mod driver;
#[cfg(test)]
#[cfg(feature = "std")]
mod mutated;
#[cfg(feature = "std")]
pub mod transport;
