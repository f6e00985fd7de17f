//! Joints whose samples say nothing, and why.

use super::Recording;
use dyngen::arm::JointKind;

/// A joint that moves by less than this in all logs only winds up its gear and its seals: its friction is not sliding friction,
/// and nothing that depends on position or speed can be told from a constant. rad, and m for prismatic joints.
const LEAST_TRAVEL: [f64; 2] = [0.05, 0.01];

/// Why a joint's samples cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Silent {
    /// It does not move.
    Still,
    /// It moves by so little, with the least that would do.
    HardlyMoves(f64, f64),
    /// Its torque never changes while it moves.
    Dead,
}

impl Silent {
    /// Why a joint says nothing in any recording; `None` where it does.
    pub(super) fn of(recordings: &[Recording], joint: usize, kind: JointKind) -> Option<Silent> {
        let positions = recordings.iter().flat_map(|r| r.position(joint));
        let (low, high) =
            positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(q), h.max(q)));
        let travel = (high - low).max(0.0);
        let least = LEAST_TRAVEL[usize::from(kind == JointKind::Prismatic)];
        if travel < 1e-4 * least {
            Some(Silent::Still)
        } else if travel < least {
            Some(Silent::HardlyMoves(travel, least))
        } else if recordings.iter().all(|r| dead(r, joint)) {
            Some(Silent::Dead)
        } else {
            None
        }
    }

    /// In words, for the joint numbered from 1.
    pub(super) fn note(&self, joint: usize, unit: &str) -> String {
        let lost = "neither its friction nor any effect on it can be judged, and its torque was not used";
        match self {
            Silent::Still => format!(
                "joint {joint} does not move in these logs: {lost}; record paths on which it swings (powerball excite). If it did \
                 move, its encoder is dead and the other joints are judged wrongly too"
            ),
            Silent::HardlyMoves(travel, least) => format!(
                "joint {joint} moves by {travel:.4} {unit} only: {lost}; record paths on which it moves by {least} {unit} or more and \
                 turns back several times (powerball excite)"
            ),
            Silent::Dead => format!(
                "joint {joint} moves, but its torque never changes: its sensor or drive is dead, or it was not recorded; {lost}; \
                 mend it and record again"
            ),
        }
    }
}

/// Whether a joint's torque is one number all along a recording.
pub(super) fn dead(recording: &Recording, joint: usize) -> bool {
    let torque = &recording.torque[joint];
    torque.first().is_none_or(|first| torque.iter().all(|t| t == first))
}
