//! What is to be said of joints that rest in the logs.

use super::{JointRows, Recording};
use crate::controller::JointNumber;
use crate::logs::signal::{Band, rest};

/// With fewer rows than these nothing is said of a joint: 0.8 s of motion in the widest band.
pub(crate) const FEWEST_ROWS: usize = 14;

/// A note where a joint with so many of all `samples` in the band rests in most or much of them. `limit`
/// is the velocity below which it rests, rad/s, where it is one for all logs.
#[must_use]
pub(crate) fn rest_note(
    joint: JointNumber,
    rows: usize,
    samples: usize,
    limit: Option<f64>,
) -> Option<String> {
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
            rest::LONGEST_REVERSAL
        )
    })
}

/// What was left out, and what is to be said of joints that rested.
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
