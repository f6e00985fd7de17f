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
pub(crate) mod time_delay;
mod torque_constant;
mod velocity_nonlinearity;
mod window_sums;

pub use axis::Axis;
pub use candidate::{Candidate, Found, Window};
pub use context::Context;
pub(crate) use context::{PASSES, SOFT, each_instant, move_link};

use crate::controller::correction::Law;
use crate::logs::regression::Column;
use dyngen::arm::Parameter;
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

/// What an effect is in a model of the arm.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// Torques: its laws with their coefficients.
    Laws,
    /// A rigid arm with another value of a parameter that was taken for zero.
    Parameter(Parameter, f64),
    /// A rigid arm under another gravity, m/s² in the base frame, and what all its parameters gain by what
    /// that shows; empty for nothing.
    Gravity([f64; 3], Vec<f64>),
    /// A body that the last link may hold: mass in kg and centre in m, in the last frame.
    Payload(f64, [f64; 3]),
    /// Logs whose position of the candidate's joints is so many rad above the true one.
    EncoderOffset(f64),
    /// Logs whose torque of the candidate's joints is so many s late.
    Delay(f64),
    /// Nothing that lasts.
    Event,
}

/// A physical term that a model may lack.
pub trait Effect: Sync {
    /// Its name in results.
    fn name(&self) -> &'static str;

    /// What it is easily confused with.
    fn class(&self) -> Class;

    /// Whether the instants at which it sets in are known only roughly, so that nothing can be said of its
    /// fast part.
    fn abrupt(&self) -> bool {
        self.class() == Class::Event
    }

    /// Whether it is a property of the body that all joints share.
    fn of_the_body(&self) -> bool {
        false
    }

    /// The signal over which a joint's residual shows it.
    fn shown_by(&self, candidate: &Candidate) -> Axis;

    /// The ways in which it could show in these data, worth a look each.
    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate>;

    /// The laws of a candidate at its first joint, one a column; none where it is no torque of a joint.
    fn laws(&self, _context: &Context<'_>, _candidate: &Candidate) -> Vec<Law<f64>> {
        Vec::new()
    }

    /// The columns of a candidate on the context's data; the same on every data set.
    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let laws = self.laws(context, candidate);
        laws.into_iter().map(|law| context.law_column(candidate.joints[0], law)).collect()
    }

    /// What an accepted candidate is in a model of the arm.
    fn part(&self, _context: &Context<'_>, _candidate: &Candidate, _coefficients: &[f64]) -> Part {
        Part::Laws
    }

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

    /// What logs that were not fitted say themselves of an accepted candidate that may be in some logs and
    /// not in others; `context` holds their residual without it.
    fn seen_in(
        &self,
        _context: &Context<'_>,
        _candidate: &Candidate,
        _coefficients: &[f64],
    ) -> Option<Candidate> {
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
