//! The frequencies that a signal occupies.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

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
