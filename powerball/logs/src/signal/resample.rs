//! Uneven time stamps onto an even grid.

/// The even grid that fits time stamps `t` in s: the same span, the median step.
///
/// Returns the first time, the step and the number of samples; `None` with fewer than two stamps.
#[must_use]
pub fn even_grid(t: &[f64]) -> Option<(f64, f64, usize)> {
    let (first, last) = (*t.first()?, *t.last()?);
    let step = median_step(t)?;
    let count = ((last - first) / step).floor() as usize + 1;
    Some((first, step, count))
}

/// The median of the steps between rising time stamps, s.
#[must_use]
pub fn median_step(t: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}

/// Values `x` at rising times `t` onto the grid `start + k·step`, by cubic interpolation through the four
/// nearest samples (linear at the ends): smooth signals such as positions keep their second derivative.
#[must_use]
pub fn cubic(t: &[f64], x: &[f64], start: f64, step: f64, count: usize) -> Vec<f64> {
    onto_grid(t, start, step, count, |i, at| cubic_at(t, x, i, at))
}

/// Like [`cubic`], at one time between samples `i` and `i + 1`.
#[must_use]
pub fn cubic_at(t: &[f64], x: &[f64], i: usize, at: f64) -> f64 {
    let linear = || x[i] + (x[i + 1] - x[i]) * (at - t[i]) / (t[i + 1] - t[i]);
    if i == 0 || i + 2 >= t.len() {
        return linear();
    }
    let weights = weights(&[t[i - 1], t[i], t[i + 1], t[i + 2]], at);
    weights.iter().zip(&x[i - 1..=i + 2]).map(|(w, x)| w * x).sum()
}

/// Values `x` at rising times `t` onto the grid `start + k·step`, by straight lines: noisy signals such as
/// currents are not amplified.
#[must_use]
pub fn linear(t: &[f64], x: &[f64], start: f64, step: f64, count: usize) -> Vec<f64> {
    onto_grid(t, start, step, count, |i, at| x[i] + (x[i + 1] - x[i]) * (at - t[i]) / (t[i + 1] - t[i]))
}

/// Values `x` at rising times `t` at one time, by linear interpolation; the first or last value beyond them.
#[must_use]
pub fn linear_at(t: &[f64], x: &[f64], at: f64) -> f64 {
    let above = t.partition_point(|t| *t <= at);
    match (above.checked_sub(1), x.get(above)) {
        (Some(i), Some(next)) => x[i] + (next - x[i]) * (at - t[i]) / (t[above] - t[i]),
        (Some(i), None) => x[i],
        (None, _) => x.first().copied().unwrap_or(0.0),
    }
}

/// Samples that [`later`] and [`smooth_at`] compute a value between samples from.
const AROUND: usize = 8;
/// The largest sum of the sizes of their weights. At even times it is at most 1.5; where two samples are
/// much closer to each other than to the rest, noise would grow.
const MOST_WEIGHT: f64 = 2.0;

/// A signal at even times that is late by a number of samples; the first or last value beyond its ends.
///
/// By the polynomial through the eight nearest samples: a straight line between two of them makes a signal
/// also weaker where it is fast, by 19 % at half a sample and a fifth of the sample rate, and a log whose
/// torque is weaker there would seem to be late.
#[must_use]
pub fn later(x: &[f64], by: f64) -> Vec<f64> {
    let Some(last) = x.len().checked_sub(1) else { return Vec::new() };
    let whole = by.ceil() as isize;
    let near: [isize; AROUND] = std::array::from_fn(|m| m as isize + 1 - AROUND as isize / 2);
    let weights = weights(&near.map(|m| m as f64), by.ceil() - by);
    let at = |k: usize| {
        let sample =
            |(m, w): (&isize, &f64)| w * x[k.saturating_add_signed(m.saturating_sub(whole)).min(last)];
        near.iter().zip(&weights).map(sample).sum()
    };
    (0..x.len()).map(at).collect()
}

/// Values `x` at rising times `t` at one time, as in [`later`]; by a straight line near the ends and where
/// times are very uneven, and the first or last value beyond them.
#[must_use]
pub fn smooth_at(t: &[f64], x: &[f64], at: f64) -> f64 {
    let first = t.partition_point(|t| *t <= at).checked_sub(AROUND / 2);
    let around = |first: usize| {
        let near = first..first.checked_add(AROUND)?;
        Some((<&[f64; AROUND]>::try_from(t.get(near.clone())?).ok()?, x.get(near)?))
    };
    let Some((times, values)) = first.and_then(around) else { return linear_at(t, x, at) };
    let weights = weights(times, at);
    if weights.iter().map(|w| w.abs()).sum::<f64>() > MOST_WEIGHT {
        return linear_at(t, x, at);
    }
    weights.iter().zip(values).map(|(w, x)| w * x).sum()
}

/// The weights of samples at some times in the polynomial through them, at one time.
fn weights<const N: usize>(times: &[f64; N], at: f64) -> [f64; N] {
    std::array::from_fn(|m| {
        let others = (0..N).filter(|other| *other != m);
        others.map(|other| (at - times[other]) / (times[m] - times[other])).product()
    })
}

fn onto_grid(t: &[f64], start: f64, step: f64, count: usize, value: impl Fn(usize, f64) -> f64) -> Vec<f64> {
    let Some(last) = t.len().checked_sub(2) else { return vec![0.0; count] };
    let mut i = 0;
    (0..count)
        .map(|k| {
            let at = start + k as f64 * step;
            while i < last && t[i + 1] <= at {
                i += 1;
            }
            value(i, at)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use std::f64::consts::TAU;

    #[test]
    fn a_smooth_signal_survives_jitter() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(1);
        let t: Vec<f64> = (0..400).map(|k| 0.01 * k as f64 + rng.random_range(-0.003..0.003)).collect();
        let f = |t: f64| (3.0 * t).sin();
        let x: Vec<f64> = t.iter().map(|t| f(*t)).collect();
        let (start, step, count) = even_grid(&t).unwrap();
        assert!((step - 0.01).abs() < 1e-3 && count > 380);
        let cubic = cubic(&t, &x, start, step, count);
        let linear = linear(&t, &x, start, step, count);
        for k in 2..count - 3 {
            let at = f(start + k as f64 * step);
            assert!((cubic[k] - at).abs() < 2e-6, "{k}");
            assert!((linear[k] - at).abs() < 1e-3, "{k}");
        }
        assert!(even_grid(&[1.0]).is_none());
    }

    /// A wave that is late by a part of a sample is as strong as before, up to the band of the rows.
    #[test]
    fn what_is_late_is_as_strong_as_before() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(2);
        for (cycles, most) in [(0.02, 1e-8), (0.1, 2e-4), (0.2, 6e-3)] {
            let wave = |t: &[f64], by: f64| -> Vec<f64> {
                t.iter().map(|t| (TAU * cycles * (t - by)).sin()).collect()
            };
            let even: Vec<f64> = (0..500).map(f64::from).collect();
            let uneven: Vec<f64> = even.iter().map(|t| t + rng.random_range(-0.05..0.05)).collect();
            for by in [0.5, 3.3, -0.4, -7.0] {
                let largest = |late: &[f64], truth: &[f64]| {
                    (20..480).map(|k| (late[k] - truth[k]).abs()).fold(0.0, f64::max)
                };
                let late = later(&wave(&even, 0.0), by);
                let error = largest(&late, &wave(&even, by));
                assert!(error < most, "{cycles} cycles a sample, {by} samples: {error}");
                for t in [&even, &uneven] {
                    let x = wave(t, 0.0);
                    let late: Vec<f64> =
                        t.iter().map(|t| smooth_at(&even, &wave(&even, 0.0), t - by)).collect();
                    let error = largest(&late, &wave(t, by));
                    assert!(error < most, "at other times, {cycles}, {by}: {error}");
                    let late: Vec<f64> = even.iter().map(|k| smooth_at(t, &x, k - by)).collect();
                    let error = largest(&late, &wave(&even, by));
                    assert!(error < 2.0 * most, "from other times, {cycles}, {by}: {error}");
                }
            }
        }
    }

    #[test]
    fn a_signal_goes_on_beyond_its_ends() {
        assert_eq!(later(&[1.0, 2.0, 4.0], 5.0), [1.0; 3]);
        assert_eq!(later(&[1.0, 2.0, 4.0], -5.0), [4.0; 3]);
        assert_eq!(later(&[1.0, 2.0, 4.0], 1.0), [1.0, 1.0, 2.0]);
        approx::assert_relative_eq!(later(&[3.0], 0.5)[0], 3.0, max_relative = 1e-12);
        assert!(later(&[], 0.5).is_empty());
        let (t, x) = ([0.0, 1.0, 2.0], [1.0, 2.0, 4.0]);
        assert_eq!([-5.0, 0.5, 1.0, 2.0, 5.0].map(|at| smooth_at(&t, &x, at)), [1.0, 1.5, 2.0, 4.0, 4.0]);
        assert_eq!(smooth_at(&[], &[], 1.0), 0.0);
    }

    /// Two samples at almost the same time do not make noise larger.
    #[test]
    fn noise_does_not_grow_at_uneven_times() {
        let mut t: Vec<f64> = (0..20).map(f64::from).collect();
        t[10] = t[9] + 1e-6;
        let x: Vec<f64> = (0..20).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        for at in (0..190).map(|k| 0.1 * f64::from(k)) {
            assert!(smooth_at(&t, &x, at).abs() <= MOST_WEIGHT, "{at}");
        }
    }
}
