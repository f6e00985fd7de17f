//! The torque of a motion that is planned and not logged yet: what a controller feeds forward.

use super::{ArmChanges, LogChanges, TorqueModel};
use crate::controller::correction::Law;
use crate::identification::motion::Motion;
use crate::logs::regression::{Recording, RigidArm};

/// Torques of a planned motion by what causes them, n values a sample, N·m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlannedTorque {
    /// The rigid arm at its links' true places.
    pub rigid: Vec<f64>,
    /// Eq. 16.
    pub friction: Vec<f64>,
    /// What goes beyond both; a payload that was held to the end of the logs is held here.
    pub effects: Vec<f64>,
}

impl TorqueModel {
    /// What a motion takes that begins `running` s after the arm began to work, as cold as when it was recorded. `body` is the
    /// arm with the model's changes. A delay of logs is no part of it; terms of a measured temperature count as 0.
    #[must_use]
    pub fn planned(&self, body: &RigidArm, motion: &Motion, running: f64) -> PlannedTorque {
        let recording = Recording {
            log: 0,
            start: 0.0,
            clock: running,
            rate: 1.0 / motion.period,
            q: motion.q.clone(),
            v: motion.dq.clone(),
            a: motion.ddq.clone(),
            torque: Vec::new(),
            temperature: None,
            smoothing: 0.0,
            dof: motion.dof(),
        };
        let mut whole = self.clone();
        whole.additions.log_changes.delay.clear();
        let held = whole.additions.payloads.last().is_some_and(|p| p.end_time.iter().all(Option::is_none));
        let base = whole.base();
        let without = base.torque(body, &recording, &|_| false);
        let all = whole.torque(body, &recording, &|_| held);
        let n = motion.dof();
        let places: Vec<f64> =
            motion.q.iter().enumerate().map(|(k, q)| q - self.additions.log_changes.offset(k % n)).collect();
        let rigid = body.torque(&places, &motion.dq, &motion.ddq, &self.inertial());
        let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        PlannedTorque { friction: less(&without, &rigid), effects: less(&all, &without), rigid }
    }

    /// The same parameters and friction without the effects; the arm's changes and its encoders' zeros stay.
    #[must_use]
    pub fn base(&self) -> TorqueModel {
        let mut base = self.clone();
        let arm_changes: ArmChanges = std::mem::take(&mut base.additions.arm_changes);
        let encoder_offset = std::mem::take(&mut base.additions.log_changes.encoder_offset);
        base.additions = super::Additions {
            arm_changes,
            log_changes: LogChanges { encoder_offset, ..LogChanges::default() },
            ..super::Additions::default()
        };
        base
    }

    /// The terms that depend on positions alone, constant torques among them: what an arm that a hand guides is held
    /// against besides its weight.
    #[must_use]
    pub fn holding_terms(&self) -> Vec<crate::controller::correction::Term<f64>> {
        let of_position = |law: &Law<f64>| {
            matches!(
                law,
                Law::Constant
                    | Law::Position
                    | Law::Cosine { .. }
                    | Law::Sine { .. }
                    | Law::OtherPosition { .. }
                    | Law::PositionProduct { .. }
                    | Law::CosineOfTwo { .. }
                    | Law::SineOfTwo { .. }
            )
        };
        self.terms().into_iter().map(|t| t.term).filter(|term| of_position(&term.law)).collect()
    }
}
