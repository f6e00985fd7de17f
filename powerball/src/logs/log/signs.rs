//! Whether torques have the signs of their joints: friction only ever takes.
//!
//! Between one reversal of a joint and the next its mean torque holds gravity, inertia and friction. Over
//! many half swings the first two come out alike in both directions, friction does not: forward swings take
//! more torque than backward ones. Where it is clearly the other way round, torque or position has the wrong
//! sign. On sound logs of a UR10e the difference is 1 to 40 standard errors above zero.

use super::raw::Raw;
use super::{Severity, Warnings};

/// Half swings in either direction, at least.
const SWINGS: usize = 4;
/// Standard errors below zero.
const CLEAR: f64 = 5.0;
/// Range of a joint that moves, rad.
const MOVES: f64 = 0.1;

/// Looks at each joint's torque or current.
pub(super) fn look(raw: &Raw, step: f64, name: &str, warnings: &mut Warnings<'_>) {
    for (j, (q, effort)) in raw.q.iter().zip(&raw.effort).enumerate() {
        let range = q.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        if range.1 - range.0 < MOVES {
            continue;
        }
        let stride = ((0.05 / step) as usize).max(1);
        let velocities: Vec<f64> = (stride..q.len().saturating_sub(stride))
            .map(|k| (q[k + stride] - q[k - stride]) / (raw.t[k + stride] - raw.t[k - stride]))
            .collect();
        let top = velocities.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        // Mean effort of every half swing; what is slow belongs to none.
        let direction = |v: f64| if v.abs() < 0.1 * top { 0.0 } else { v.signum() };
        let mut swings: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        let (mut sum, mut count, mut now) = (0.0, 0usize, 0.0);
        for (k, v) in velocities.iter().enumerate() {
            let next = direction(*v);
            if next != 0.0 && next != now {
                if count as f64 * step > 0.1 {
                    swings[usize::from(now > 0.0)].push(sum / count as f64);
                }
                (sum, count, now) = (0.0, 0, next);
            }
            if next != 0.0 {
                sum += effort[k + stride];
                count += 1;
            }
        }
        let [backward, forward] = swings.map(|means| mean(&means));
        let (Some((b, eb)), Some((f, ef))) = (backward, forward) else { continue };
        let error = (eb + ef).sqrt();
        if f - b < -CLEAR * error && error > 0.0 {
            let message = format!(
                "is {:.3} less on the way forward than on the way back, {:.0} standard errors: friction \
                    would have to drive the joint. Its sign, or that of q{}, is wrong",
                b - f,
                (b - f) / error,
                j + 1
            );
            warnings.add(None, format!("{name}{}", j + 1), message, Severity::Warning);
        }
    }
}

/// Mean and the square of its standard error; `None` with too few.
fn mean(x: &[f64]) -> Option<(f64, f64)> {
    if x.len() < SWINGS {
        return None;
    }
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    Some((mean, x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n))
}
