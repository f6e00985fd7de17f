//! What an identification of position servos gives.

use super::constants::Found;
use powerball_controller::JointNumber;
use serde::Serialize;

/// What was fitted, in the file.
pub(super) const SET: &str = "servo";

/// Why the JSON of a result is no torque model, where it is that of position servos.
#[must_use]
pub fn no_torques(json: &serde_json::Value) -> Option<String> {
    let why = "is of position servos and has no torque model; dyngen export --to mjcf takes it";
    (json["set"] == SET).then(|| why.to_string())
}

/// Servos with their errors; as JSON it is `identified.json`.
#[derive(Clone, Debug, Serialize)]
pub struct IdentifiedServos {
    /// Why this result should not be used; empty where it can be.
    pub unusable: Vec<String>,
    /// The arm's name.
    pub arm: String,
    /// What was fitted: "servo".
    pub set: &'static str,
    /// Inertial parameters that were fitted; empty where they are known.
    pub parameters: Vec<Found>,
    /// Friction by joint.
    pub friction: Vec<ServoFriction>,
    /// Drives by joint.
    pub servo: Vec<JointServo>,
    /// What the simulation leaves of the logs to fit.
    pub fit: PositionStats,
    /// What it leaves of the validation set, where there is one.
    pub validate: Option<PositionStats>,
    /// What is to be reported about the logs, the arm file and the fit.
    pub warnings: Vec<String>,
    /// Measured and simulated positions of the validation set, or of the fitted logs where there is none.
    #[serde(skip)]
    pub along: Vec<Along>,
}

/// The drive of a joint.
#[derive(Clone, Debug, Serialize)]
pub struct JointServo {
    /// The joint.
    pub joint: JointNumber,
    /// Whether torques are in N·m; else they are shares of the torque at full duty.
    pub absolute: bool,
    /// The joint's constants: those that were fitted, and those of the arm file.
    pub parameters: Vec<Found>,
}

/// The friction of a joint: coulomb + load·½·|motor's torque + body's torque|, and viscous·q̇.
#[derive(Clone, Debug, Serialize)]
pub struct ServoFriction {
    /// The joint.
    pub joint: JointNumber,
    /// N·m, or a share of the torque at full duty.
    pub coulomb: f64,
    /// N·m·s/rad, likewise.
    pub viscous: f64,
    /// 1.
    pub load: f64,
}

/// How far simulated positions are from measured ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PositionStats {
    /// rms by joint, rad.
    pub position_error: Vec<f64>,
    /// That of the logged goal with its best delay, rms by joint, rad; `None` where the drive was always
    /// switched off.
    pub goal_error: Vec<Option<f64>>,
    /// Samples.
    pub samples: usize,
}

/// A joint along logs, one piece after the other.
#[derive(Clone, Debug, Default)]
pub struct Along {
    /// s.
    pub t: Vec<f64>,
    /// Measured, rad.
    pub measured: Vec<f64>,
    /// Simulated, rad.
    pub simulated: Vec<f64>,
    /// Set-point, rad.
    pub goal: Vec<f64>,
}
