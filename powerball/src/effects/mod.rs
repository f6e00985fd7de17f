//! What a torque model may lack: one file an effect, all behind one trait.
//!
//! Adding an effect means adding a file with its [`Effect`] and naming it in [`all`].

mod asymmetry;
mod axis;
mod backlash;
mod base_tilt;
mod broken_symmetry;
mod candidate;
mod contact_wrench;
mod context;
mod encoder_offset;
mod hysteresis;
mod joint_coupling;
mod joint_elasticity;
mod load_friction;
pub(crate) mod payload;
mod position_ripple;
mod spring;
mod stribeck;
mod temperature;
mod time_delay;
mod torque_constant;
mod velocity_nonlinearity;
mod window_sums;

pub use axis::Axis;
pub use candidate::{Candidate, Found, Window};
pub use context::Context;

use crate::regression::Column;
use serde_json::Value;

/// Effects of one class look alike: a wrong law of one is easily mended by another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// Of a joint's speed and its history.
    Friction,
    /// Of the joints' positions.
    Position,
    /// Of the torque that the model itself predicts, or of its timing.
    Dynamics,
    /// During some time.
    Event,
}

impl Class {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Class::Friction => "depends on speed and its history",
            Class::Position => "depends on position",
            Class::Dynamics => "depends on the torque and its timing",
            Class::Event => "depends on time",
        }
    }
}

/// A physical term that a model may lack.
pub trait Effect: Sync {
    /// Its name in results.
    fn name(&self) -> &'static str;

    /// What it is easily confused with.
    fn class(&self) -> Class;

    /// The signal over which a joint's residual shows it.
    fn shown_by(&self, candidate: &Candidate) -> Axis;

    /// The ways in which it could show in these data, worth a look each.
    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate>;

    /// The columns of a candidate on the context's data; the same on every data set.
    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column>;

    /// Whether the coefficients are physically possible.
    fn admissible(&self, _candidate: &Candidate, _coefficients: &[f64]) -> bool {
        true
    }

    /// Whether no coefficient may be negative (friction dissipates).
    fn non_negative(&self) -> bool {
        false
    }

    /// A better candidate near an accepted one: columns that depend on estimates are taken anew from there.
    fn refined(&self, _candidate: &Candidate, _coefficients: &[f64]) -> Option<Candidate> {
        None
    }

    /// Nearby settings of a candidate's search, tried once it is accepted.
    fn neighbours(&self, _candidate: &Candidate) -> Vec<Candidate> {
        Vec::new()
    }

    /// The physical reading of all that was found of this effect, as in the results.
    fn parameters(&self, context: &Context<'_>, found: &[Found<'_>]) -> Value;
}

/// Every effect, in the order in which equals are preferred.
#[must_use]
pub fn all() -> Vec<Box<dyn Effect>> {
    vec![
        Box::new(load_friction::LoadFriction),
        Box::new(stribeck::Stribeck),
        Box::new(velocity_nonlinearity::VelocityNonlinearity),
        Box::new(asymmetry::Asymmetry),
        Box::new(hysteresis::Hysteresis),
        Box::new(payload::Payload),
        Box::new(spring::Spring),
        Box::new(position_ripple::PositionRipple),
        Box::new(temperature::Temperature),
        Box::new(time_delay::TimeDelay),
        Box::new(torque_constant::TorqueConstant),
        Box::new(encoder_offset::EncoderOffset),
        Box::new(base_tilt::BaseTilt),
        Box::new(broken_symmetry::BrokenSymmetry),
        Box::new(contact_wrench::ContactWrench),
        Box::new(joint_coupling::JointCoupling),
        Box::new(backlash::Backlash),
        Box::new(joint_elasticity::JointElasticity),
    ]
}
