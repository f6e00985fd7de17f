//! A model with the changes since it was made.

use crate::torque_model::{Payload, TorqueModel};
use dyngen::arm::ParameterKind;
use powerball_controller::JointNumber;
use powerball_logs::regression::{Recording, RigidArm};

/// One change of a model.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    /// Friction of a joint: the whole of it, or its viscous part, more by a share of what it was.
    Friction { joint: JointNumber, viscous: bool, by: f64 },
    /// A body that the last link holds, kg and m in its frame.
    Payload { mass: f64, com: [f64; 3] },
    /// A force in the base frame, N, at the origin of a link's frame.
    Force { force: [f64; 3], link: JointNumber },
    /// Logged less true position, rad or m.
    Offset { joint: JointNumber, by: f64 },
    /// Additional delay of torques, s.
    Delay { joints: Vec<JointNumber>, by: f64 },
}

impl Change {
    /// Whether another change is the same one with another size.
    pub(super) fn is_like(&self, other: &Change) -> bool {
        match (self, other) {
            (Change::Friction { joint: a, .. }, Change::Friction { joint: b, .. })
            | (Change::Offset { joint: a, .. }, Change::Offset { joint: b, .. }) => a == b,
            (Change::Delay { joints: a, .. }, Change::Delay { joints: b, .. }) => a == b,
            (Change::Payload { .. }, Change::Payload { .. })
            | (Change::Force { .. }, Change::Force { .. }) => true,
            _ => false,
        }
    }

    /// The joints that changed; none for what pulls at the arm as a whole.
    pub(super) fn joints(&self) -> &[JointNumber] {
        match self {
            Change::Friction { joint, .. } | Change::Offset { joint, .. } => std::slice::from_ref(joint),
            Change::Delay { joints, .. } => joints,
            Change::Payload { .. } | Change::Force { .. } => &[],
        }
    }

    /// The effect's name.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Change::Friction { .. } => "temperature",
            Change::Payload { .. } => "payload",
            Change::Force { .. } => "contact_wrench",
            Change::Offset { .. } => "encoder_offset",
            Change::Delay { .. } => "time_delay",
        }
    }

    /// The body that a link holds with this change and one more: mass and first moments add up.
    fn held_with(mass: f64, com: [f64; 3], more: Option<&Payload>) -> Payload {
        let (other, at) = more.map_or((0.0, [0.0; 3]), |p| (p.mass, p.com));
        let all = mass + other;
        let com = [0, 1, 2].map(|k| if all != 0.0 { (mass * com[k] + other * at[k]) / all } else { 0.0 });
        Payload { mass: all, com, link: None, logs: Vec::new(), start_time: Vec::new(), end_time: Vec::new() }
    }
}

/// The model with some changes.
pub(super) fn with(model: &TorqueModel, changes: &[Change]) -> TorqueModel {
    let mut model = model.clone();
    model.additions.payloads.clear();
    let n = model.friction.len();
    for change in changes {
        let logged = &mut model.additions.log_changes;
        match change {
            Change::Friction { joint, viscous, by } => {
                let friction = &mut model.friction[joint.index()];
                friction.gamma5 *= 1.0 + by;
                if !viscous {
                    friction.gamma1 *= 1.0 + by;
                    friction.gamma3 *= 1.0 + by;
                }
            }
            Change::Payload { mass, com } => {
                let held = Change::held_with(*mass, *com, model.additions.payloads.last());
                model.additions.payloads = vec![held];
            }
            Change::Force { .. } => {}
            Change::Offset { joint, by } => {
                logged.encoder_offset.resize(n, 0.0);
                logged.encoder_offset[joint.index()] += by;
            }
            Change::Delay { joints, by } => {
                logged.delay.resize(n, 0.0);
                joints.iter().for_each(|j| logged.delay[j.index()] += by);
            }
        }
    }
    model
}

/// The torque of a model with some changes along a recording, n a sample, N·m as logged.
pub(super) fn torque(
    body: &RigidArm,
    model: &TorqueModel,
    changes: &[Change],
    recording: &Recording,
) -> Vec<f64> {
    let mut torque = with(model, changes).torque(body, recording, &|_| true);
    for change in changes {
        let Change::Force { force, link } = change else { continue };
        // The static torque of a unit mass under unit gravity is that of a unit force.
        let mass = [link.index() * ParameterKind::ALL.len() + ParameterKind::M as usize];
        for (axis, size) in force.iter().enumerate() {
            let unit = body.gravity_columns(axis, &mass, &recording.q).unwrap_or_default();
            torque.iter_mut().zip(unit).for_each(|(torque, unit)| *torque += size * unit);
        }
    }
    torque
}
