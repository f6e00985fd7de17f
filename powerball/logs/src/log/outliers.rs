//! Samples of which one number cannot be: a telegram that was torn, a bit that fell over.
//!
//! A few of them are left out, as samples without a number are, and are named. Where there are many the
//! signal is what it is.

use super::Finding;
use super::check::{farthest, of_column};
use super::read::{Effort, GOAL, Raw};
use dyngen::Arm;
use dyngen::arm::JointKind;
use std::f64::consts::TAU;

/// Times as far from the median as 99 of 100 samples are: no motion and no knock reaches that.
const FAR: f64 = 20.0;
/// … and times a joint's torque limit, where the arm file has one.
const ABOVE_LIMIT: f64 = 5.0;
/// A position that comes back within this many samples did not move there.
const LONGEST_JUMP: usize = 3;
/// More samples than this share, and than [`FEW`], are no rare fault.
const MOST: f64 = 1e-3;
const FEW: usize = 3;

/// Leaves out the samples of which a position or a torque cannot be; times rise.
pub(super) fn leave_out(
    raw: &mut Raw,
    effort: &Effort,
    (arm, file): (&Arm, &str),
    findings: &mut Vec<Finding>,
) {
    let name = effort.name();
    let mut keep = vec![true; raw.t.len()];
    for j in 0..arm.dof() {
        let limit = match (effort, of_column(arm, j).torque) {
            (Effort::Current(constants), Some(limit)) => Some(limit / constants[j].abs()),
            (Effort::Torque, limit) => limit,
            (Effort::Current(_) | Effort::Goal, _) => None,
        };
        let positions = jumps(raw, j, arm);
        // A set-point may step as it likes.
        let torques = if name == GOAL { Vec::new() } else { far(&raw.effort[j], limit) };
        for (quantity, values, found) in [
            (format!("q{}", j + 1), &raw.q[j], positions),
            (format!("{name}{}", j + 1), &raw.effort[j], torques),
        ] {
            let Some(first) = found.first() else { continue };
            let is_rare = found.len() <= FEW || found.len() as f64 <= MOST * raw.t.len() as f64;
            let what = match is_rare {
                true => "left out",
                false => {
                    "too many to be left out; if they are spikes, identify with --estimator robust, which \
                    gives them less weight"
                }
            };
            let more = match found.len() {
                1 => String::new(),
                several => format!(" ({several} such samples, the first is this one)"),
            };
            let message = format!(
                "at {:.3} s: {:.4e} cannot be where the other samples are right{more}: {what}",
                raw.t[*first], values[*first]
            );
            findings.push(Finding {
                file: file.to_string(),
                line: Some(raw.line[*first]),
                quantity,
                message,
            });
            found.iter().filter(|_| is_rare).for_each(|k| keep[*k] = false);
        }
    }
    if keep.contains(&false) {
        raw.retain(&keep);
    }
}

/// Samples that lie far beyond all others.
fn far(x: &[f64], limit: Option<f64>) -> Vec<usize> {
    let Some(median) = quantile(x.iter().copied(), 0.5) else { return Vec::new() };
    let spread = quantile(x.iter().map(|v| (v - median).abs()), 0.99).unwrap_or(0.0);
    // A signal that never changes has no spread that would say what is far.
    let far = FAR * spread.max(1e-3 * median.abs());
    let least = limit.map_or(far, |limit| far.max(ABOVE_LIMIT * limit));
    if least <= 0.0 {
        return Vec::new();
    }
    (0..x.len()).filter(|k| (x[*k] - median).abs() > least).collect()
}

/// The value below which a share of some values lies.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let last = values.len().checked_sub(1)?;
    let at = (share * last as f64) as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Positions that the joint leaves and comes back to within a few samples, faster than it can move.
fn jumps(raw: &Raw, j: usize, arm: &Arm) -> Vec<usize> {
    let (q, t) = (&raw.q[j], &raw.t);
    let turns = of_column(arm, j).kind == JointKind::Revolute;
    let apart = |a: usize, b: usize| {
        let step = (q[b] - q[a]).abs();
        // A whole turn is a wrap of the angle.
        if turns { step.min((step - TAU).abs()) } else { step }
    };
    let within = |a: usize, b: usize| apart(a, b) <= farthest(arm, j, t[b] - t[a]);
    let (mut found, mut k) = (Vec::new(), 1);
    while k < q.len() {
        let back = (1..=LONGEST_JUMP).find(|m| k + m < q.len() && within(k - 1, k + m));
        match back {
            Some(m) if (k..k + m).all(|i| !within(k - 1, i) && !within(i, k + m)) => {
                found.extend(k..k + m);
                k += m + 1;
            }
            _ => k += 1,
        }
    }
    found
}
