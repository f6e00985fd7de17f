//! Whether the torque columns are late.

use super::fit::{Judged, judge};
use super::reading::Torques;
use super::rows::{LONGEST, Rows};

/// Steps of the first look and of the last, s.
const COARSE: f64 = 0.02;
const FINE: f64 = 0.0025;
/// A delay that is worth telling, s.
const SEEN: f64 = 0.04;
/// The two parts agree on a delay within this, or within a tenth of it, s.
const AGREE: f64 = 0.01;

/// How late all torque columns are by both parts, s; `None` where they disagree or the best is at the end of
/// what is tried.
pub(super) fn common(rows: &Rows<'_>, read: &Torques, ridge: f64) -> Option<f64> {
    let largest = read.late.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest > 0.0 {
        return None;
    }
    let at = |late: f64| judge(rows, &read.later(late), ridge);
    let count = (LONGEST / COARSE).round() as i32;
    let coarse: Vec<(f64, Judged)> =
        (-count..=count).map(|k| f64::from(k) * COARSE).map(|late| (late, at(late))).collect();
    let best = |tried: &[(f64, Judged)], parts: &[usize]| {
        let score = |judged: &Judged| parts.iter().map(|part| sum(&judged.left[*part])).sum::<f64>();
        tried.iter().map(|(late, judged)| (*late, score(judged))).min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let [one, other] = [0, 1].map(|part| best(&coarse, &[part]));
    let (one, other, both) = (one?.0, other?.0, best(&coarse, &[0, 1])?.0);
    if both.abs() > LONGEST - 0.5 * COARSE || both == 0.0 && one == 0.0 && other == 0.0 {
        return if both == 0.0 { fine(&at, both).filter(|late| *late != 0.0) } else { None };
    }
    if (one - other).abs() > COARSE + AGREE.max(0.1 * both.abs()) {
        return None;
    }
    fine(&at, both)
}

/// The best near a coarse one.
fn fine(at: &impl Fn(f64) -> Judged, near: f64) -> Option<f64> {
    let (mut best, mut step) = ((near, both(&at(near))), 0.5 * COARSE);
    while step >= FINE {
        for late in [best.0 - step, best.0 + step] {
            let left = both(&at(late));
            if left < best.1 {
                best = (late, left);
            }
        }
        step *= 0.5;
    }
    Some(best.0)
}

fn both(judged: &Judged) -> f64 {
    sum(&judged.left[0]) + sum(&judged.left[1])
}

fn sum(left: &[f64]) -> f64 {
    left.iter().filter(|x| x.is_finite()).map(|x| (x + 4e-4).ln()).sum()
}

/// Whether a delay of [`SEEN`] either way would show: errors rise by a tenth at least.
pub(super) fn would_show(rows: &Rows<'_>, read: &Torques, ridge: f64, judged: &Judged) -> bool {
    let joints = judged.left[0].iter().filter(|x| x.is_finite()).count().max(1) as f64;
    [-SEEN, SEEN].iter().all(|by| both(&judge(rows, &read.later(*by), ridge)) - both(judged) > 0.2 * joints)
}
