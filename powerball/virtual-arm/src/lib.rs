//! The virtual arm: numeric dynamics of its own and, on top of them, a plant to record logs from.
//!
//! Nothing here uses the generator's symbolics, so these numbers are an independent reference for generated
//! code.

mod dynamics;
mod effect;
pub mod lwa4p;
mod plant;
mod simulation;
pub mod slave;

pub use dynamics::{Body, Dynamics, PER_LINK, bodies, solve_positive_definite};
pub use effect::{Gear, Instant, Places, PlantEffect, State};
pub use plant::{Plant, Sensors, SimulatedLog, Undeclared};
pub use simulation::{Gains, Servo, Simulation};
pub use slave::VirtualArm;
