//! From where an arm is to where a motion begins.

use crate::identification::motion::Motion;

/// A motion from rest at `from` to rest at `to`, rad, every `period` s: all joints along 10x³ − 15x⁴ + 6x⁵,
/// as slowly as the joint needs that has the farthest to go at `velocity` (rad/s) and `acceleration` (rad/s²),
/// and for `least` s at least.
pub fn approach(
    from: &[f64],
    to: &[f64],
    velocity: &[f64],
    acceleration: &[f64],
    period: f64,
    least: f64,
) -> Motion {
    // The polynomial's greatest velocity is 15/8, its greatest acceleration 10/√3, for a unit way in a unit
    // time.
    let (top_velocity, top_acceleration) = (1.875, 10.0 / 3f64.sqrt());
    let mut time = least.max(period);
    for i in 0..from.len() {
        let way = (to[i] - from[i]).abs();
        time =
            time.max(top_velocity * way / velocity[i]).max((top_acceleration * way / acceleration[i]).sqrt());
    }
    let steps = (time / period).ceil().max(1.0);
    let time = steps * period;
    let mut motion = Motion::new(from.len(), period);
    for k in 0..=steps as usize {
        let x = k as f64 / steps;
        let shape = x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x);
        let slope = 30.0 * (x * (1.0 - x)).powi(2) / time;
        let bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / (time * time);
        motion.push(from.iter().zip(to).map(|(a, b)| [a + (b - a) * shape, (b - a) * slope, (b - a) * bend]));
    }
    motion
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_begins_and_ends_at_rest_and_keeps_its_limits() {
        let (from, to) = ([0.0, 1.0, -0.5], [2.0, -1.0, -0.5]);
        let (velocity, acceleration) = ([0.5, 1.0, 1.0], [2.0, 0.8, 1.0]);
        let motion = approach(&from, &to, &velocity, &acceleration, 0.005, 1.0);
        let samples: Vec<_> = motion.samples().collect();
        assert_eq!(samples[0], [&from[..], &[0.0; 3], &[0.0; 3]]);
        for (got, want) in samples[samples.len() - 1][0].iter().zip(to) {
            approx::assert_relative_eq!(*got, want, max_relative = 1e-12);
        }
        let mut share = 0.0f64;
        for pair in samples.windows(2) {
            for i in 0..3 {
                let v = (pair[1][0][i] - pair[0][0][i]) / 0.005;
                let a = pair[0][2][i];
                share = share.max(v.abs() / velocity[i]).max(a.abs() / acceleration[i]);
                approx::assert_relative_eq!(v, 0.5 * (pair[0][1][i] + pair[1][1][i]), epsilon = 1e-4);
            }
        }
        assert!(share <= 1.0 + 1e-9 && share > 0.98, "{share}");
    }
}
