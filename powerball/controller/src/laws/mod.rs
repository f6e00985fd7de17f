//! Control laws: model and state in, torque out. Each file has one law with its source, its units and its
//! conditions of stability; none was run on hardware.
//!
//! Every law gives the torque of the rigid arm and its feedback. The caller adds what the model has beyond
//! the rigid arm (friction, effects), at the reference; [`Limiter`] comes last. Nothing here allocates or
//! panics.

mod cartesian;
mod computed_torque;
mod contact;
mod hand_guiding;
mod impedance;
mod limits;
mod observer;
mod stability;
#[cfg(test)]
mod test_arm;

pub use cartesian::{CartesianImpedance, Goal};
pub use computed_torque::{ComputedTorque, Integrator};
pub use contact::{Contact, ContactDetector};
pub use hand_guiding::{HandGuiding, Softening};
pub use impedance::JointImpedance;
pub use limits::Limiter;
pub use observer::{MomentumObserver, tool_force};
pub use stability::{LargestPole, largest_pole};

/// A number of the scalar type.
fn number<T: nalgebra::RealField>(x: f64) -> T {
    nalgebra::convert(x)
}
