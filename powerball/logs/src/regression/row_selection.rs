//! Which samples of a joint become rows: those in which it moves and its torque carries information.
//!
//! The module also finds joints whose samples carry no information, with the reason, and the notes about
//! joints that rest in the logs.

use super::rows::{saturated, saturation_notes};
use super::{JointRows, Recording};
use crate::log::{Log, logs_of_motors};
use crate::signal::{Band, motion};
use dyngen::Arm;
use dyngen::arm::JointKind;
use powerball_controller::JointNumber;

/// By band, joint and recording: the samples that are kept, counted in those of the band.
pub(super) type Kept = Vec<Vec<Vec<Vec<usize>>>>;

/// The samples that are kept, and what was left out for another reason than rest, in words.
pub(super) fn kept_samples(
    logs: &[Log],
    recordings: &[Recording],
    bands: &[Band],
    rest_velocity: &[f64],
    inactive: &[Option<String>],
) -> (Kept, Vec<String>) {
    let n = inactive.len();
    let mut left_out = Vec::new();
    let mut kept = keep_moving(recordings, bands, rest_velocity, n);
    for j in 0..n {
        let at_limit = saturated(logs, j);
        let count = |kept: &Kept| -> usize { kept[0][j].iter().map(Vec::len).sum() };
        let moving = count(&kept);
        leave_out(&at_limit, recordings, bands, kept.iter_mut().map(|kept| &mut kept[j]));
        // A torque that stays while its joint rests is none.
        if count(&kept) < moving {
            left_out.extend(saturation_notes(logs, j, &at_limit));
        }
        for (r, recording) in recordings.iter().enumerate() {
            let is_dead = dead(recording, j);
            if is_dead || inactive[j].is_some() {
                kept.iter_mut().for_each(|kept| kept[j][r].clear());
            }
            if is_dead && inactive[j].is_none() {
                left_out.push(format!(
                    "{}: the torque of joint {} never changes: the joint was left out of this log",
                    logs[recording.log].file,
                    j + 1
                ));
            }
        }
    }
    (kept, left_out)
}

/// By band, joint and recording: which of the band's kept samples are rows.
fn keep_moving(recordings: &[Recording], bands: &[Band], limit: &[f64], n: usize) -> Kept {
    let mut all = vec![vec![Vec::with_capacity(recordings.len()); n]; bands.len()];
    for j in 0..n {
        for r in recordings {
            let moving = motion::moving(&r.velocity(j).collect::<Vec<_>>(), r.rate, limit[j]);
            for (of_band, band) in all.iter_mut().zip(bands) {
                // A joint that never moves has the limit 0 and is never below it.
                let kept = if limit[j] < 1e-5 { Vec::new() } else { band.kept(r.len()) };
                of_band[j].push((0..kept.len()).filter(|k| moving[kept[*k]]).collect());
            }
        }
    }
    all
}

/// Leaves out a joint's samples in some spans of its logs, and those that the band's filter mixes with them.
fn leave_out<'k>(
    spans: &[Vec<[f64; 2]>],
    recordings: &[Recording],
    bands: &[Band],
    kept: impl Iterator<Item = &'k mut Vec<Vec<usize>>>,
) {
    for (kept, band) in kept.zip(bands) {
        for (kept, recording) in kept.iter_mut().zip(recordings) {
            let spans = &spans[recording.log];
            if spans.is_empty() {
                continue;
            }
            let (samples, guard) = (band.kept(recording.len()), 1.0 / band.cutoff);
            let outside = |k: &usize| {
                let t = recording.start + samples[*k] as f64 / recording.rate;
                spans.iter().all(|[from, to]| t < from - guard || t > to + guard)
            };
            kept.retain(outside);
        }
    }
}

// Joints whose samples carry no information, and the reason.

/// A joint that moves by less than this in all logs only winds up its gear and its seals: its friction is not
/// sliding friction, and nothing that depends on position or velocity can be distinguished from a constant.
/// rad, and m for prismatic joints.
const LEAST_TRAVEL: [f64; 2] = [0.05, 0.01];

/// Why a joint's samples cannot be used.
#[derive(Clone, Debug, PartialEq)]
enum Inactive {
    /// The joint does not move.
    Still,
    /// The joint moves too little: its travel, and the least travel that suffices.
    HardlyMoves(f64, f64),
    /// The torque never changes while the joint moves.
    Dead,
}

/// For each joint why nothing can be concluded about it from these logs, and what to record instead; `None`
/// where there can. Where a transmission couples joints it is their motors that must move.
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
        // Within a log: that a joint was elsewhere in another one is not a motion.
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

    /// The note in words, for the joint numbered from 1.
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

// Notes about joints that rest in the logs.

/// Least number of rows of a joint for a result about it: 0.8 s of motion in the widest band.
pub const FEWEST_ROWS: usize = 14;

/// A note where a joint with `rows` rows of all `samples` in the band rests in most or much of them. `limit`
/// is the velocity below which it rests, rad/s, where it is one for all logs.
#[must_use]
pub fn rest_note(joint: JointNumber, rows: usize, samples: usize, limit: Option<f64>) -> Option<String> {
    let rested = samples.saturating_sub(rows);
    if rows < FEWEST_ROWS {
        return Some(format!(
            "joint {joint} rests in these logs: neither its friction nor any effect on it can be judged; \
                record paths on which it swings (powerball excite)"
        ));
    }
    let limit = limit.map_or(String::new(), |limit| format!("|velocity| below {limit:.4} for "));
    (rested * 4 > samples).then(|| {
        format!(
            "joint {joint} rests in {:.0} % of the samples ({limit}{} s or longer, or at an end of a log); \
                they were left out",
            100.0 * rested as f64 / samples as f64,
            motion::LONGEST_REVERSAL
        )
    })
}

/// Notes on samples that were left out, and on joints that rested.
pub(super) fn notes(
    left_out: &[String],
    recordings: &[Recording],
    band: &Band,
    joints: &[JointRows],
    inactive: &[Option<String>],
    rest_velocity: &[f64],
) -> Vec<String> {
    let samples: usize = recordings.iter().map(|r| band.kept(r.len()).len()).sum();
    let of_joint = |(j, rows): (usize, &JointRows)| {
        let rest = || rest_note(JointNumber::from_index(j), rows.len(), samples, Some(rest_velocity[j]));
        inactive[j].clone().or_else(rest)
    };
    left_out.iter().cloned().chain(joints.iter().enumerate().filter_map(of_joint)).collect()
}
