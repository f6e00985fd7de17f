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
    let mut sum = 0.0;
    for j in i - 1..=i + 2 {
        let mut weight = 1.0;
        for m in i - 1..=i + 2 {
            if m != j {
                weight *= (at - t[m]) / (t[j] - t[m]);
            }
        }
        sum += weight * x[j];
    }
    sum
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
}
