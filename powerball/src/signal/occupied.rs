//! The frequencies that a signal occupies.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// The frequency below which a share of the power of signals of `rate` Hz lies, Hz: by periodograms with a Hann window, each signal's
/// mean taken off. `None` where there is no power.
#[must_use]
pub fn occupied(signals: &[Vec<f64>], rate: f64, share: f64) -> Option<f64> {
    // Power by frequency on a grid fine enough for motions, whatever the signals' lengths.
    const STEP: f64 = 0.02;
    let mut power = vec![0.0; (0.5 * rate / STEP).ceil() as usize + 1];
    let mut planner = FftPlanner::new();
    for signal in signals.iter().filter(|signal| signal.len() > 8) {
        let n = signal.len();
        let mean = signal.iter().sum::<f64>() / n as f64;
        let window = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / n as f64).cos();
        let mut buffer: Vec<Complex<f64>> =
            signal.iter().enumerate().map(|(k, x)| Complex::new((x - mean) * window(k), 0.0)).collect();
        planner.plan_fft_forward(n).process(&mut buffer);
        for (k, x) in buffer.iter().enumerate().take(n / 2 + 1) {
            let bin = (k as f64 * rate / n as f64 / STEP).round() as usize;
            if let Some(power) = power.get_mut(bin) {
                *power += x.norm_sqr() / n as f64;
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

#[cfg(test)]
mod tests {
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
    }
}
