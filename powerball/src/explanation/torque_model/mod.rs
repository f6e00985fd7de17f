//! A torque model of an arm with all that is known of it: `identify` and `explain` write it, `verify` judges
//! it, `generate` makes a controller's code of it, and the next identification begins with it.
//!
//! τ = rigid(q, q̇, q̈) + Eq. 16 friction + the terms of [`crate::controller::correction`], in the units of
//! the logs, at true positions: an encoder's offset is taken off first.

mod along;
mod c_api;
mod file;
mod known;
mod ros;
mod source;
#[cfg(test)]
mod tests;

use crate::controller::JointNumber;
use crate::controller::correction::{Law, Term};
use crate::identification::estimate::{JointFriction, ParameterEstimate, in_set_of};
use crate::logs::regression::RigidArm;
pub use file::FileError;
pub use known::{ModelFile, Unchanged};
use serde::{Deserialize, Serialize};
pub use source::{ForC, Scalar, SourceError};

/// The model of one arm; as JSON the keys are those of `identified.json` and more.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TorqueModel {
    /// The arm's name.
    #[serde(default)]
    pub arm: String,
    /// The parameter set: "minimal".
    #[serde(default)]
    pub set: String,
    /// The set's values, SI units.
    pub parameters: Vec<ParameterEstimate>,
    /// Eq. 16 by joint.
    pub friction: Vec<JointFriction>,
    /// What goes beyond these.
    #[serde(flatten)]
    pub additions: Additions,
}

/// What an explanation adds to a base model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Additions {
    /// Torques beyond rigid arm and friction.
    pub terms: Vec<NamedTerm>,
    /// What is otherwise than the arm file says.
    pub arm_changes: ArmChanges,
    /// What is wrong with the logs rather than with the arm.
    pub log_changes: LogChanges,
    /// Bodies that the last link held in some logs: no part of the bare arm.
    pub payloads: Vec<Payload>,
}

/// A term with the effect that it stands for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "file::TermEntry", into = "file::TermEntry")]
pub struct NamedTerm {
    /// The effect's name.
    pub effect: String,
    /// Joint, law and coefficient.
    pub term: Term<f64>,
    /// Standard error of the coefficient, where it is known.
    pub std: Option<f64>,
}

/// Where the arm is not as its file says.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ArmChanges {
    /// Gravity in the base frame, m/s², where the base is tilted.
    pub gravity: Option<[f64; 3]>,
    /// Parameters that the file declares zero and that are not.
    pub not_zero: Vec<String>,
}

/// Where logs are not what the arm did; one entry a joint, or none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LogChanges {
    /// Logged less true position, rad.
    pub encoder_offset: Vec<f64>,
    /// By how much logged torques are late, s.
    pub delay: Vec<f64>,
}

/// A body that a link carries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Payload {
    /// Its mass, kg.
    pub mass: f64,
    /// Its centre in the link's frame, m; it counts as a point.
    pub com: [f64; 3],
    /// The link, from 1; the last where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<JointNumber>,
    /// The logs it is in.
    pub logs: Vec<String>,
    /// From when on, in each log's own t, s.
    pub start_time: Vec<f64>,
    /// Until when, in each log's own t, s: null where it stays to the end; nothing where it does in all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub end_time: Vec<Option<f64>>,
}

impl Payload {
    /// What it adds to its link: m mx my mz Ixx Ixy Ixz Iyy Iyz Izz.
    #[must_use]
    pub fn parameters(&self) -> [f64; 10] {
        let (m, [x, y, z]) = (self.mass, self.com);
        let squares = [y * y + z * z, x * y, x * z, x * x + z * z, y * z, x * x + y * y];
        let [a, b, c, d, e, f] = squares.map(|s| m * s);
        [m, m * x, m * y, m * z, a, b, c, d, e, f]
    }
}

impl LogChanges {
    /// A joint's logged less true position, rad.
    #[must_use]
    pub fn offset(&self, joint: usize) -> f64 {
        self.encoder_offset.get(joint).copied().unwrap_or(0.0)
    }

    /// By how much a joint's torque is late, s.
    #[must_use]
    pub fn late(&self, joint: usize) -> f64 {
        self.delay.get(joint).copied().unwrap_or(0.0)
    }

    /// Both changes together.
    #[must_use]
    fn and(&self, more: &LogChanges) -> LogChanges {
        let sum = |a: &[f64], b: &[f64]| {
            let at = |x: &[f64], j: usize| x.get(j).copied().unwrap_or(0.0);
            (0..a.len().max(b.len())).map(|j| at(a, j) + at(b, j)).collect()
        };
        LogChanges {
            encoder_offset: sum(&self.encoder_offset, &more.encoder_offset),
            delay: sum(&self.delay, &more.delay),
        }
    }
}

impl TorqueModel {
    /// Everything beyond rigid torque and Eq. 16: constant torques of the friction law, and the terms.
    #[must_use]
    pub fn terms(&self) -> Vec<NamedTerm> {
        let constant = |f: &JointFriction| {
            let term = Term { joint: f.joint.saturating_sub(1), coefficient: f.offset?, law: Law::Constant };
            Some(NamedTerm { effect: "constant torque".to_string(), term, std: None })
        };
        self.friction.iter().filter_map(constant).chain(self.additions.terms.iter().cloned()).collect()
    }

    /// The model in the minimal set of a body, whose parameters its own determine: those that logs of several
    /// mountings determine together, say. Errors of converted values are not known. As it is where they do
    /// not.
    #[must_use]
    pub fn in_set_of(mut self, body: &RigidArm) -> TorqueModel {
        if let Some(parameters) = in_set_of(&self.parameters, &self.arm, body) {
            self.parameters = parameters;
        }
        self
    }

    /// The minimal set's values in order.
    #[must_use]
    pub fn inertial(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// γ1 … γ5 by joint.
    #[must_use]
    pub fn gammas(&self) -> Vec<[f64; 5]> {
        self.friction.iter().map(JointFriction::gamma).collect()
    }
}
