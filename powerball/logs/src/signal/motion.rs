//! Phases of rest: friction is undetermined while a joint stands still, so those samples carry no information
//! about it.
//!
//! The module also finds the samples at which a joint reverses, and the band of its motion.

use super::Butterworth;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

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

// A signal by cycles of a turn: what repeats with a joint's or its motor's position.

/// Amplitudes of a signal by order, cycles a joint turn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turns {
    /// Cycles a turn.
    pub orders: Vec<f64>,
    /// Amplitude of that order alone, in the signal's unit.
    pub amplitudes: Vec<f64>,
}

/// The amplitudes of `signal` at positions `q` (rad), from `least` to `most` cycles a turn.
///
/// Each order is fitted alone with a constant, a·cos(order·q) + b·sin(order·q) + c, by least squares:
/// positions need not be even. Orders stand near enough that none is missed between two: a quarter of one
/// cycle over the range of q apart.
#[must_use]
pub fn turns(q: &[f64], signal: &[f64], least: f64, most: f64) -> Turns {
    let (low, high) = q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(*q), h.max(*q)));
    let range = high - low;
    if q.len() < 20 || q.len() != signal.len() || !(range > 0.05 && most > least) {
        return Turns::default();
    }
    let step = 0.25 * TAU / range;
    let first = (least / step).ceil().max(4.0) as usize;
    let orders: Vec<f64> = (first..).map(|k| k as f64 * step).take_while(|order| *order <= most).collect();
    let amplitudes = orders.iter().map(|order| amplitude(q, signal, *order)).collect();
    Turns { orders, amplitudes }
}

fn amplitude(q: &[f64], signal: &[f64], order: f64) -> f64 {
    let n = q.len() as f64;
    let [mut sc, mut ss, mut scc, mut sss, mut scs, mut sy, mut scy, mut ssy] = [0.0; 8];
    for (q, y) in q.iter().zip(signal) {
        let (s, c) = (order * q).sin_cos();
        sc += c;
        ss += s;
        scc += c * c;
        sss += s * s;
        scs += c * s;
        sy += y;
        scy += c * y;
        ssy += s * y;
    }
    // Without the constant.
    let (cc, cs, s2) = (scc - sc * sc / n, scs - sc * ss / n, sss - ss * ss / n);
    let (cy, sy) = (scy - sc * sy / n, ssy - ss * sy / n);
    let determinant = cc * s2 - cs * cs;
    if determinant <= 1e-9 * n * n {
        return 0.0;
    }
    let (a, b) = ((s2 * cy - cs * sy) / determinant, (cc * sy - cs * cy) / determinant);
    a.hypot(b)
}

// The frequencies that a signal occupies.

/// The frequency below which a share of the power of signals of `rate` Hz lies, Hz: by periodograms with a
/// Hann window, each signal's mean taken off. `None` where there is no power.
#[must_use]
pub fn occupied(signals: &[Vec<f64>], rate: f64, share: f64) -> Option<f64> {
    // Power by frequency on a grid fine enough for motions, whatever the signals' lengths.
    const STEP: f64 = 0.02;
    let mut power = vec![0.0; (0.5 * rate / STEP).ceil() as usize + 1];
    for signal in signals {
        for (frequency, here) in periodogram(signal, rate) {
            if let Some(power) = power.get_mut((frequency / STEP).round() as usize) {
                *power += here;
            }
        }
    }
    let total: f64 = power.iter().sum();
    let mut sum = 0.0;
    let found = power.iter().position(|p| {
        sum += p;
        sum >= share * total
    });
    found.filter(|_| total > 0.0).map(|bin| bin as f64 * STEP)
}

/// The sum of squares of a signal of `rate` Hz that lies between two frequencies, Hz, but for a factor that
/// all signals of one length share.
#[must_use]
pub fn between(signal: &[f64], rate: f64, [low, high]: [f64; 2]) -> f64 {
    periodogram(signal, rate).filter(|(f, _)| (low..high).contains(f)).map(|(_, power)| power).sum()
}

/// Frequencies in Hz and the power at each; nothing for a signal of a few samples.
fn periodogram(signal: &[f64], rate: f64) -> impl Iterator<Item = (f64, f64)> {
    let n = if signal.len() > 8 { signal.len() } else { 0 };
    let mean = signal.iter().sum::<f64>() / n.max(1) as f64;
    let window = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / n as f64).cos();
    let mut buffer: Vec<Complex<f64>> =
        signal[..n].iter().enumerate().map(|(k, x)| Complex::new((x - mean) * window(k), 0.0)).collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
    let half = if n > 0 { n / 2 + 1 } else { 0 };
    buffer
        .into_iter()
        .take(half)
        .enumerate()
        .map(move |(k, x)| (k as f64 * rate / n as f64, x.norm_sqr() / n as f64))
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

#[cfg(test)]
mod turns_tests {
    use super::*;

    /// Two ripples and a constant, positions as uneven as those of a swinging joint.
    #[test]
    fn ripples_stand_at_their_orders_with_their_amplitudes() {
        let q: Vec<f64> = (0..6000).map(|k| 1.4 * (0.01 * f64::from(k)).sin() + 0.3).collect();
        let y: Vec<f64> =
            q.iter().map(|q| 5.0 + 0.8 * (161.0 * q + 0.4).cos() + 0.3 * (7.0 * q).sin()).collect();
        let found = turns(&q, &y, 1.0, 400.0);
        let at = |order: f64| {
            let near = found.orders.iter().zip(&found.amplitudes).filter(|(o, _)| (*o - order).abs() < 1.2);
            near.map(|(_, a)| *a).fold(0.0, f64::max)
        };
        approx::assert_abs_diff_eq!(at(161.0), 0.8, epsilon = 0.1);
        approx::assert_abs_diff_eq!(at(7.0), 0.3, epsilon = 0.06);
        // A swing's positions leak like the Bessel function J0, about √(2/(π·1.4·Δ)) at Δ cycles a turn from
        // a ripple: 0.8 of it at 71 and 0.3 of it at 83.
        assert!(at(90.0) < 0.1 && at(322.0) < 0.1 && found.orders.len() > 100);
        assert_eq!(turns(&[1.0; 50], &[0.0; 50], 1.0, 9.0), Turns::default());
    }
}

#[cfg(test)]
mod occupied_tests {
    use super::*;

    #[test]
    fn most_of_the_power_lies_below_the_fastest_strong_part() {
        let signal = |parts: &[(f64, f64)]| -> Vec<f64> {
            (0..6000)
                .map(|k| {
                    3.0 + parts.iter().map(|(f, a)| a * (TAU * f * f64::from(k) * 0.01).sin()).sum::<f64>()
                })
                .collect()
        };
        let of = |parts: &[(f64, f64)]| occupied(&[signal(parts)], 100.0, 0.99).unwrap();
        assert!((of(&[(0.5, 1.0)]) - 0.5).abs() < 0.06);
        assert!((of(&[(0.5, 1.0), (4.0, 0.5)]) - 4.0).abs() < 0.06);
        // Less than a hundredth of the power.
        assert!((of(&[(0.5, 1.0), (4.0, 0.05)]) - 0.5).abs() < 0.06);
        assert_eq!(occupied(&[vec![1.0; 100]], 100.0, 0.99), None);
        // A strong slow part does not leak into an octave where it is not.
        let [inside, outside] =
            [[2.5, 5.0], [5.0, 10.0]].map(|f| between(&signal(&[(0.5, 100.0), (4.0, 0.5)]), 100.0, f));
        assert!(inside > 1e3 * outside && outside >= 0.0, "{inside} {outside}");
        assert_eq!(between(&[1.0; 5], 100.0, [0.0, 50.0]), 0.0);
    }
}
