//! Phases of rest: friction is undetermined while a joint stands still, so those samples say nothing of it.

use super::Butterworth;

/// A joint that is slower than this for [`LONGEST_REVERSAL`] is at rest, rad/s (m/s), unless it is a slow
/// joint.
pub const REST_SPEED: f64 = 0.03;
/// A slow joint's limit: this share of the velocity it stays under in 95 % of its samples.
pub const REST_SHARE: f64 = 0.03;
/// Below this share of its velocity limit a joint rests whatever else it does: it may only tremble all along.
pub const REST_OF_LIMIT: f64 = 1e-3;
/// A reversal that takes longer than this is a stop, s.
pub const LONGEST_REVERSAL: f64 = 0.5;
/// Velocities are judged below this frequency, Hz: encoder steps at rest look fast above it.
const SMOOTHING: f64 = 2.0;

/// The velocity below which a joint counts as resting, from samples of |q̇| of all its recordings and its
/// velocity limit if known.
#[must_use]
pub fn rest_velocity(mut velocities: Vec<f64>, limit: Option<f64>) -> f64 {
    if velocities.is_empty() {
        return REST_SPEED;
    }
    let high = (velocities.len() * 95 / 100).min(velocities.len() - 1);
    let (_, p95, _) = velocities.select_nth_unstable_by(high, f64::total_cmp);
    REST_SPEED.min((REST_SHARE * *p95).max(REST_OF_LIMIT * limit.unwrap_or(0.0)))
}

/// Which samples of a joint's velocity `v` (rad/s, at `rate` Hz) are motion; heads and tails at rest and
/// stops are not.
///
/// Rest is a stretch of at least [`LONGEST_REVERSAL`] in which the velocity, smoothed to 2 Hz, stays below
/// `limit`.
#[must_use]
pub fn moving(v: &[f64], rate: f64, limit: f64) -> Vec<bool> {
    let smooth = match Butterworth::low_pass(2, SMOOTHING, rate) {
        Some(filter) => filter.zero_phase(v),
        None => v.to_vec(),
    };
    let shortest = (LONGEST_REVERSAL * rate).ceil() as usize;
    let mut keep = vec![true; v.len()];
    let mut start = 0;
    for k in 0..=v.len() {
        if k < v.len() && smooth[k].abs() < limit {
            continue;
        }
        // A head or tail at rest counts however short it is.
        let at_end = start == 0 || k == v.len();
        if k > start && (at_end || k - start >= shortest) {
            keep[start..k].fill(false);
        }
        start = k + 1;
    }
    keep
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_tails_and_stops_go_but_reversals_stay() {
        let rate = 100.0;
        let velocity = |k: usize| match k {
            0..200 => 0.0,
            200..1000 => 0.5 * (2.0 * std::f64::consts::PI * (k - 200) as f64 / 400.0).sin(),
            1000..1200 => 0.0,
            1200..1600 => 0.3,
            _ => 0.0,
        };
        let v: Vec<f64> = (0..1800).map(velocity).collect();
        let keep = moving(&v, rate, REST_SPEED);
        assert!(keep[..180].iter().all(|k| !k), "head");
        assert!(keep[260..940].iter().all(|k| *k), "motion with its reversals");
        assert!(keep[1040..1160].iter().all(|k| !k), "stop");
        assert!(keep[1250..1550].iter().all(|k| *k));
        assert!(keep[1650..].iter().all(|k| !k), "tail");
    }

    #[test]
    fn slow_joints_have_a_lower_limit() {
        assert_eq!(rest_velocity(vec![1.5; 100], Some(2.0)), REST_SPEED);
        approx::assert_relative_eq!(rest_velocity(vec![0.1; 100], None), 0.003);
        assert_eq!(rest_velocity(Vec::new(), None), REST_SPEED);
        approx::assert_relative_eq!(rest_velocity(vec![1e-4; 100], Some(1.2)), 0.0012);
    }
}
