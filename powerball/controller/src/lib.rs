//! Code for the control loop of an arm: no `std`, no allocation, no panic.
//!
//! # A model in a control step
//!
//! This example uses the LWA 4P (feature `lwa4p`); `powerball generate` writes such a model for any arm, with
//! every effect that was named.
//!
#![cfg_attr(feature = "lwa4p", doc = "```")]
#![cfg_attr(not(feature = "lwa4p"), doc = "```ignore")]
//! use powerball_controller::friction::{TABLE_2, TanhFriction};
//! use powerball_controller::model::minimal::{PARAMETERS, inverse_dynamics};
//! # let parameters = nalgebra::SVector::<f64, PARAMETERS>::from_element(0.1);
//! # let [q, dq, ddq] = [0.3, 0.1, 0.0].map(nalgebra::SVector::<f64, 6>::from_element);
//! let friction = TABLE_2.map(TanhFriction::new);
//! // In the loop: no allocation, no panic.
//! let mut torque = inverse_dynamics(&q, &dq, &ddq, &parameters);
//! for (j, friction) in friction.iter().enumerate() {
//!     torque[j] += friction.torque(dq[j]);
//! }
//! # assert!(torque.iter().all(|t| t.is_finite()));
//! ```

#![cfg_attr(not(test), no_std)]

pub mod change;
pub mod correction;
pub mod dynamics;
pub mod friction;
mod joint_number;
pub mod laws;
#[cfg(feature = "lwa4p")]
pub mod model;
pub mod online;

pub use joint_number::JointNumber;
