//! Whether an arm is warm: the mean torque of each cycle, its exponential (Fig. 3), and a test of its trend.
//!
//! The module also moves the arm to the beginning of a motion.

use powerball_identification::estimate::distribution::t_quantile_975;
use powerball_logs::motion::Motion;

/// The mean of τ·sign(q̇) over one cycle of a periodic motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Middle of the cycle, s.
    pub time: f64,
    /// Mean torque against the motion, N·m. Gravity does the same work both ways and cancels.
    pub torque: f64,
}

/// The mean torque of every whole cycle; samples slower than a tenth of the greatest velocity are left out.
#[must_use]
pub fn cycles(t: &[f64], velocity: &[f64], torque: &[f64], period: f64) -> Vec<Cycle> {
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return Vec::new() };
    let top = velocity.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let count = ((last - first) / period + 1e-9).floor() as usize;
    let mut sums = vec![(0.0, 0usize); count];
    for ((t, v), tau) in t.iter().zip(velocity).zip(torque) {
        let cycle = ((t - first) / period) as usize;
        if let Some((sum, n)) = sums.get_mut(cycle)
            && v.abs() > 0.1 * top
        {
            *sum += tau * v.signum();
            *n += 1;
        }
    }
    let middle = |k: usize| first + (k as f64 + 0.5) * period;
    let cycle =
        |(k, (sum, n)): (usize, (f64, usize))| Cycle { time: middle(k), torque: sum / n.max(1) as f64 };
    sums.into_iter().enumerate().map(cycle).collect()
}

/// y = settled + excess·exp(−t/time_constant), fitted to cycles; t from the first cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponential {
    /// Torque when warm, N·m.
    pub settled: f64,
    /// Torque beyond it at the first cycle, N·m.
    pub excess: f64,
    /// s
    pub time_constant: f64,
    /// rms of the residual of the curve, N·m.
    pub rms: f64,
}

/// Steps of the search for the time constant.
const STEPS: usize = 200;

/// Fits the exponential of Fig. 3; `None` with fewer than five cycles.
///
/// For each time constant the rest is linear least squares; time constants from one cycle to three times the
/// whole duration are tried.
#[must_use]
pub fn exponential(cycles: &[Cycle]) -> Option<Exponential> {
    if cycles.len() < 5 {
        return None;
    }
    let start = cycles[0].time;
    let span = cycles[cycles.len() - 1].time - start;
    let shortest = span / (cycles.len() - 1) as f64;
    let fit = |time_constant: f64| {
        let n = cycles.len() as f64;
        let (mut se, mut see, mut sy, mut sey) = (0.0, 0.0, 0.0, 0.0);
        for c in cycles {
            let e = (-(c.time - start) / time_constant).exp();
            se += e;
            see += e * e;
            sy += c.torque;
            sey += e * c.torque;
        }
        let excess = (sey - se * sy / n) / (see - se * se / n);
        let settled = (sy - excess * se) / n;
        let square: f64 = cycles
            .iter()
            .map(|c| (c.torque - settled - excess * (-(c.time - start) / time_constant).exp()).powi(2))
            .sum();
        Exponential { settled, excess, time_constant, rms: (square / n).sqrt() }
    };
    let ratio = 3.0 * span / shortest;
    (0..=STEPS)
        .map(|k| fit(shortest * ratio.powf(k as f64 / STEPS as f64)))
        .filter(|f| f.rms.is_finite())
        .min_by(|a, b| a.rms.total_cmp(&b.rms))
}

/// Cycles over which the trend is judged, at least; a third of all where there are more.
const LEAST_CYCLES: usize = 6;

/// The trend of the last cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Greatest change of the torque over as many cycles more that the data allow, as a share of it, at 95 %.
    pub change: f64,
    /// Cycles that it was judged on.
    pub cycles: usize,
}

/// The trend, by a straight line through the last third of the cycles; `None` with fewer than six.
///
/// Equivalence, not significance: noise makes the change that is still possible larger, so an arm is never
/// called warm because nothing could be seen.
#[must_use]
pub fn trend(cycles: &[Cycle]) -> Option<Trend> {
    let count = (cycles.len() / 3).max(LEAST_CYCLES);
    let last = cycles.get(cycles.len().checked_sub(count)?..)?;
    let n = count as f64;
    let mean_t = last.iter().map(|c| c.time).sum::<f64>() / n;
    let mean_y = last.iter().map(|c| c.torque).sum::<f64>() / n;
    let stt: f64 = last.iter().map(|c| (c.time - mean_t).powi(2)).sum();
    let sty: f64 = last.iter().map(|c| (c.time - mean_t) * (c.torque - mean_y)).sum();
    let slope = sty / stt;
    let square: f64 = last.iter().map(|c| (c.torque - mean_y - slope * (c.time - mean_t)).powi(2)).sum();
    let error = (square / (n - 2.0) / stt).sqrt();
    let span = last[count - 1].time - last[0].time;
    let bound = slope.abs() + t_quantile_975(n - 2.0) * error;
    Some(Trend { change: bound * span / mean_y.abs().max(f64::MIN_POSITIVE), cycles: count })
}

// The path from an arm's position to the beginning of a motion.

/// A motion from rest at `from` to rest at `to`, rad, every `period` s: all joints along 10x³ − 15x⁴ + 6x⁵,
/// as slowly as the joint needs that has the farthest to go at `velocity` (rad/s) and `acceleration`
/// (rad/s²), and for `least` s at least.
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
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn warming(count: usize, noise: f64, seed: u64) -> Vec<Cycle> {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .map(|k| {
                let time = 5.0 * (k as f64 + 0.5);
                let e: f64 = StandardNormal.sample(&mut rng);
                Cycle { time, torque: 8.0 + 0.9 * (-(time - 2.5) / 100.0).exp() + noise * e }
            })
            .collect()
    }

    #[test]
    fn the_exponential_of_figure_3_is_recovered() {
        let fit = exponential(&warming(100, 0.01, 1)).unwrap();
        approx::assert_abs_diff_eq!(fit.settled, 8.0, epsilon = 0.01);
        approx::assert_abs_diff_eq!(fit.excess, 0.9, epsilon = 0.03);
        approx::assert_relative_eq!(fit.time_constant, 100.0, max_relative = 0.06);
        approx::assert_abs_diff_eq!(fit.rms, 0.01, epsilon = 0.003);
        assert!(exponential(&warming(4, 0.0, 1)).is_none());
    }

    /// Warm is reported late enough: what is left to change is then below the tolerance, whatever the noise.
    #[test]
    fn an_arm_is_called_warm_when_it_is() {
        for (noise, seed) in [(0.0, 1), (0.01, 2), (0.05, 3)] {
            let all = warming(400, noise, seed);
            let warm = (6..all.len()).find(|k| trend(&all[..*k]).unwrap().change < 0.01).unwrap();
            let left = 0.9 * (-(all[warm].time) / 100.0).exp() / 8.0;
            assert!(left < 0.01, "{noise}: {left} is left after {warm} cycles");
            assert!(warm < 300, "{noise}: {warm} cycles");
        }
        // Noise alone never makes an arm warm early.
        assert!(trend(&warming(12, 0.5, 4)).unwrap().change > 0.01);
    }

    /// Against an integral by hand: friction of constant size both ways, gravity that follows the position.
    #[test]
    fn gravity_cancels_over_a_cycle() {
        let t: Vec<f64> = (0..4001).map(|k| f64::from(k) * 0.005).collect();
        let w = std::f64::consts::TAU / 5.0;
        let velocity: Vec<f64> = t.iter().map(|t| w * (w * t).cos()).collect();
        let torque: Vec<f64> = t
            .iter()
            .zip(&velocity)
            .map(|(t, v)| 3.0 * v.signum() + 7.0 * ((w * t).sin() + 0.3).cos())
            .collect();
        let cycles = cycles(&t, &velocity, &torque, 5.0);
        assert_eq!(cycles.len(), 4);
        for c in cycles {
            approx::assert_abs_diff_eq!(c.torque, 3.0, epsilon = 0.02);
        }
    }
}

#[cfg(test)]
mod approach_tests {
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
