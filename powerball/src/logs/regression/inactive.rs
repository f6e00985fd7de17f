//! Joints whose samples say nothing, and why.

use super::Recording;
use crate::logs::log::{Log, logs_of_motors};
use dyngen::Arm;
use dyngen::arm::JointKind;

/// A joint that moves by less than this in all logs only winds up its gear and its seals: its friction is not
/// sliding friction, and nothing that depends on position or velocity can be told from a constant. rad, and m
/// for prismatic joints.
const LEAST_TRAVEL: [f64; 2] = [0.05, 0.01];

/// Why a joint's samples cannot be used.
#[derive(Clone, Debug, PartialEq)]
enum Inactive {
    /// It does not move.
    Still,
    /// It moves by so little, with the least that would do.
    HardlyMoves(f64, f64),
    /// Its torque never changes while it moves.
    Dead,
}

/// For each joint why nothing can be said of it from these logs, and what to record instead; `None` where
/// there can. Where a transmission couples joints it is their motors that must move.
#[must_use]
pub fn inactive_joints(arm: &Arm, logs: &[Log]) -> Vec<Option<String>> {
    let logs = &*logs_of_motors(arm, logs);
    let why = |(j, joint): (usize, &dyngen::arm::Joint)| {
        let unit = if joint.kind == JointKind::Prismatic { "m" } else { "rad" };
        Inactive::of(logs, j, joint.kind).map(|inactive| inactive.note(j + 1, unit))
    };
    arm.joints.iter().enumerate().map(why).collect()
}

impl Inactive {
    fn of(logs: &[Log], joint: usize, kind: JointKind) -> Option<Inactive> {
        // Within a log: that a joint was elsewhere in another one is no motion.
        let within = |log: &Log| {
            let ends = [f64::INFINITY, f64::NEG_INFINITY];
            let [low, high] = log.q[joint].iter().fold(ends, |[low, high], q| [low.min(*q), high.max(*q)]);
            high - low
        };
        let travel = logs.iter().map(within).fold(0.0, f64::max);
        let least = LEAST_TRAVEL[usize::from(kind == JointKind::Prismatic)];
        let changes = |log: &Log| log.torque[joint].windows(2).any(|pair| pair[0] != pair[1]);
        if travel < 1e-4 * least {
            Some(Inactive::Still)
        } else if travel < least {
            Some(Inactive::HardlyMoves(travel, least))
        } else if !logs.iter().any(changes) {
            Some(Inactive::Dead)
        } else {
            None
        }
    }

    /// In words, for the joint numbered from 1.
    fn note(&self, joint: usize, unit: &str) -> String {
        let lost = "neither its friction nor any effect on it can be judged, and its torque was not used";
        match self {
            Inactive::Still => format!(
                "joint {joint} does not move in these logs: {lost}; record paths on which it swings \
                    (powerball excite). If it did \
                 move, its encoder is dead and the other joints are judged wrongly too"
            ),
            Inactive::HardlyMoves(travel, least) => format!(
                "joint {joint} moves by {travel:.4} {unit} at most in a log: {lost}; record paths on which \
                    it moves by {least} {unit} or more and \
                 turns back several times (powerball excite)"
            ),
            Inactive::Dead => format!(
                "joint {joint} moves, but its torque never changes: its sensor or drive is dead, or it was \
                    not recorded; {lost}; \
                 correct it and record again"
            ),
        }
    }
}

/// Whether a joint's torque is one number all along a recording.
pub(super) fn dead(recording: &Recording, joint: usize) -> bool {
    let torque = &recording.torque[joint];
    torque.first().is_none_or(|first| torque.iter().all(|t| t == first))
}
