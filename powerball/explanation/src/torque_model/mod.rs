//! A torque model of an arm with all its effects: `identify` and `explain` write it, `verify` judges
//! it, `generate` makes a controller's code of it, and the next identification begins with it.
//!
//! τ = rigid(q, q̇, q̈) + Eq. 16 friction + the terms of [`powerball_controller::correction`], in the units
//! of the logs, at true positions: an encoder's offset is subtracted first.

mod at_rest;
mod c_api;
mod colour;
mod detector;
mod file;
mod known;
mod on_arm;
mod planned;
mod ros;
mod rows;
mod source;
#[cfg(test)]
pub(crate) mod tests;

use crate::effects::{PASSES, SOFT, Window, each_instant, move_link};
pub use at_rest::RestLimits;
pub(crate) use at_rest::{Rest, RestPush, Usual, rests};
pub use colour::{Colour, JointColour};
pub use detector::Detector;
use dyngen::arm::ParameterKind;
pub use file::FileError;
pub use known::{ModelFile, Unchanged};
pub use on_arm::ModelOnArm;
pub use planned::PlannedTorque;
use powerball_controller::JointNumber;
use powerball_controller::correction::{Law, Memory, Term, add_torques};
use powerball_controller::friction::TanhFriction;
use powerball_identification::estimate::{JointFriction, ParameterEstimate, in_set_of};
use powerball_logs::parallel;
use powerball_logs::regression::{Data, Recording, RigidArm, Signals};
use powerball_logs::signal::resample::later;
pub use rows::{BAND, Rows, Shown, rows_a_second};
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
    /// The end of each joint's band, Hz, in which it was fitted and judged; none where that is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_bands: Vec<f64>,
    /// The effects beyond the rigid arm and its friction.
    #[serde(flatten)]
    pub additions: Additions,
    /// Colour of its residual while it holds, for `powerball watch`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<Colour>,
}

/// The additions of an explanation to a base model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Additions {
    /// Torques beyond rigid arm and friction.
    pub terms: Vec<NamedTerm>,
    /// Differences of the arm from its file.
    pub arm_changes: ArmChanges,
    /// Errors of the logs, not of the arm.
    pub log_changes: LogChanges,
    /// Bodies that the last link held in some logs: no part of the bare arm.
    pub payloads: Vec<Payload>,
}

/// A term with the name of its effect.
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

/// Differences of the arm from its file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ArmChanges {
    /// Gravity in the base frame, m/s², where the base is tilted.
    pub gravity: Option<[f64; 3]>,
    /// Parameters that the file declares zero and that are not.
    pub not_zero: Vec<String>,
}

/// Errors of the logs; one entry per joint, or none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LogChanges {
    /// Logged less true position, rad.
    pub encoder_offset: Vec<f64>,
    /// Delay of the logged torques, s.
    pub delay: Vec<f64>,
}

/// A body that a link carries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Payload {
    /// Mass of the payload, kg.
    pub mass: f64,
    /// Centre of mass in the link's frame, m; the payload counts as a point.
    pub com: [f64; 3],
    /// The link, from 1; the last where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<JointNumber>,
    /// The logs it is in.
    pub logs: Vec<String>,
    /// Start times, in each log's own t, s.
    pub start_time: Vec<f64>,
    /// Until when, in each log's own t, s: null where it stays to the end; nothing where it does in all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub end_time: Vec<Option<f64>>,
}

impl Payload {
    /// The parameters that it adds to its link: m mx my mz Ixx Ixy Ixz Iyy Iyz Izz.
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

    /// Delay of a joint's torque, s.
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
    /// mountings determine together, say. Errors of converted values are not known. If the parameters do not
    /// determine it, the model is unchanged.
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

    /// The usual error of each joint's torque at rest, N·m; `errors` is that in motion, rms by joint.
    pub(crate) fn usual_at_rest(&self, errors: &[f64]) -> Vec<Usual> {
        let friction = self.gammas().into_iter().map(|g| g[0].abs() + g[2].abs());
        friction.zip(errors).map(|(friction, error)| Usual { friction, error: *error }).collect()
    }

    /// γ1 … γ5 by joint.
    #[must_use]
    pub fn gammas(&self) -> Vec<[f64; 5]> {
        self.friction.iter().map(JointFriction::gamma).collect()
    }
}

// The model along logs: the same laws in the same order as in the controller's code.

impl TorqueModel {
    /// Measured less predicted torque, by joint and row, N·m. `body` is the arm with the model's changes; the
    /// last link holds the model's latest payload during the windows `held`.
    #[must_use]
    pub fn residual(&self, body: &RigidArm, data: &Data<'_>, held: &[Window]) -> Signals {
        let recordings: Vec<usize> = (0..data.recordings.len()).collect();
        let torque = parallel::map(&recordings, |r| {
            let recording = &data.recordings[*r];
            self.torque_in(body, &data.logs[recording.log], recording, held)
        });
        data.residual(&torque)
    }

    /// The torque along a recording of the log `log`, which has the model's latest payload during the windows
    /// `held`.
    pub(crate) fn torque_in(
        &self,
        body: &RigidArm,
        log: &str,
        recording: &Recording,
        held: &[Window],
    ) -> Vec<f64> {
        let here: Vec<&Window> = held.iter().filter(|w| w.log == log).collect();
        self.torque(body, recording, &|t| here.iter().any(|w| t >= w.from && t <= w.to))
    }

    /// The torque along one recording, n a sample, N·m as logged; `held` says by the log's time whether the
    /// payload is there.
    #[must_use]
    pub fn torque(&self, body: &RigidArm, recording: &Recording, held: &dyn Fn(f64) -> bool) -> Vec<f64> {
        let n = recording.dof;
        let mut true_places = recording.clone();
        for (k, q) in true_places.q.iter_mut().enumerate() {
            *q -= self.additions.log_changes.offset(k % n);
        }
        let recording = &true_places;
        let motors = [recording.q.clone(), recording.v.clone(), recording.a.clone()];
        let at_motors = self.rigid(body, &motors, recording, held);
        let terms: Vec<Term<f64>> = self.terms().iter().map(|t| t.term).collect();
        let mut rigid = at_motors.clone();
        let moving: Vec<&Term<f64>> = terms.iter().filter(|t| t.law.moves_link()).collect();
        let passes = if moving.is_empty() { 0 } else { PASSES };
        for _ in 0..passes {
            let mut motion = motors.clone();
            for term in &moving {
                // Only an elastic part deflects under the load that it has there; play has a side.
                let load = if term.law == Law::Compliance { &rigid } else { &at_motors };
                move_link(&mut motion, recording, load, term.joint, term.law, (term.coefficient, SOFT));
            }
            rigid = self.rigid(body, &motion, recording, held);
        }
        let laws: Vec<TanhFriction<f64>> = self.gammas().into_iter().map(TanhFriction::new).collect();
        let friction: Vec<f64> =
            recording.v.iter().enumerate().map(|(k, v)| laws[k % n].torque(*v)).collect();
        let mut torque: Vec<f64> = rigid.iter().zip(&friction).map(|(r, f)| r + f).collect();
        let mut memory = vec![Memory::default(); terms.len()];
        each_instant(recording, &rigid, &friction, |k, now| {
            add_torques(&terms, &mut memory, now, &mut torque[k * n..(k + 1) * n]);
        });
        for j in (0..n).filter(|j| self.additions.log_changes.late(*j) != 0.0) {
            let shift = self.additions.log_changes.late(j) * recording.rate;
            let own: Vec<f64> = torque.iter().skip(j).step_by(n).copied().collect();
            let late = later(&own, shift);
            torque.iter_mut().skip(j).step_by(n).zip(late).for_each(|(value, late)| *value = late);
        }
        torque
    }

    /// The torque of the rigid arm with its payload.
    fn rigid(
        &self,
        body: &RigidArm,
        [q, v, a]: &[Vec<f64>; 3],
        recording: &Recording,
        held: &dyn Fn(f64) -> bool,
    ) -> Vec<f64> {
        let mut torque = body.torque(q, v, a, &self.inertial());
        let n = recording.dof;
        let time = |k: usize| recording.start + k as f64 / recording.rate;
        let holds: Vec<bool> = (0..recording.len()).map(|k| held(time(k))).collect();
        let Some(payload) = self.additions.payloads.last().filter(|_| holds.contains(&true)) else {
            return torque;
        };
        let added = payload.parameters();
        let first = payload.link.map_or(body.dof() - 1, JointNumber::index) * ParameterKind::ALL.len();
        let of_link: Vec<usize> = (first..first + added.len()).collect();
        let Some(columns) = body.parameter_columns(&of_link, q, v, a) else { return torque };
        for (row, columns) in columns.chunks_exact(added.len()).enumerate().filter(|(row, _)| holds[row / n])
        {
            torque[row] += columns.iter().zip(&added).map(|(c, p)| c * p).sum::<f64>();
        }
        torque
    }
}
