//! Butterworth low-pass filters of any even order, as biquads, and their zero-phase use.
//!
//! The module also has a recursive filter of second order.

use super::filter;
use std::f64::consts::PI;

/// Filters samples in place through `N` sections, which start settled on the first sample, so a constant is
/// not changed.
///
/// A section waits for its own last result alone: the sections of one loop are worked on at the same time.
fn run<'x, const N: usize>(sections: [Biquad; N], samples: impl Iterator<Item = &'x mut f64>) {
    let mut states: Option<[[f64; 2]; N]> = None;
    for x in samples {
        let states = states.get_or_insert_with(|| {
            let mut first = *x;
            sections.each_ref().map(|section| {
                let settled = section.settled().map(|s| s * first);
                first = section.step(&mut settled.clone(), first);
                settled
            })
        });
        for (section, state) in sections.iter().zip(states) {
            *x = section.step(state, *x);
        }
    }
}

/// A Butterworth low-pass filter.
#[derive(Clone, Debug, PartialEq)]
pub struct Butterworth {
    /// The sections, in the order of rising quality.
    pub sections: Vec<Biquad>,
    /// Samples of padding at each end for zero-phase use: the filter has rung out after them.
    padding: usize,
    /// Number of samples after which a state has decayed in double precision.
    memory: usize,
}

impl Butterworth {
    /// Designs a low-pass filter by the bilinear transform.
    ///
    /// `order` is rounded up to the next even number; `cutoff` is the −3 dB frequency in Hz of one pass,
    /// `rate` the sample rate in Hz. `None` unless 0 < cutoff < rate/2.
    #[must_use]
    pub fn low_pass(order: usize, cutoff: f64, rate: f64) -> Option<Butterworth> {
        if !(cutoff > 0.0 && cutoff < rate / 2.0) || order == 0 || !rate.is_finite() {
            return None;
        }
        let pairs = order.div_ceil(2);
        // The prewarped cutoff for s = (1 − z⁻¹)/(1 + z⁻¹).
        let w = (PI * cutoff / rate).tan();
        let sections: Vec<Biquad> = (0..pairs)
            .map(|k| {
                // A conjugate pair of poles at angle φ from the imaginary axis: s² + 2·sin(φ)·w·s + w².
                let phi = PI * (2 * (pairs - 1 - k) + 1) as f64 / (4 * pairs) as f64;
                let damping = 2.0 * phi.sin() * w;
                let a0 = 1.0 + damping + w * w;
                let b = w * w / a0;
                Biquad { b: [b, 2.0 * b, b], a: [2.0 * (w * w - 1.0) / a0, (1.0 - damping + w * w) / a0] }
            })
            .collect();
        let padding = (3.0 * rate / cutoff).ceil() as usize;
        let memory = filter::memory(&sections);
        Some(Butterworth { sections, padding, memory })
    }

    /// Filters forwards and backwards, so nothing is delayed and the attenuation is squared.
    ///
    /// The ends are continued by point reflection, which keeps value and slope.
    #[must_use]
    pub fn zero_phase(&self, x: &[f64]) -> Vec<f64> {
        let n = x.len();
        if n < 2 {
            return x.to_vec();
        }
        let pad = self.padding.min(n - 1);
        let mut y = Vec::with_capacity(n + 2 * pad);
        y.extend((1..=pad).rev().map(|k| 2.0 * x[0] - x[k]));
        y.extend_from_slice(x);
        y.extend((1..=pad).map(|k| 2.0 * x[n - 1] - x[n - 1 - k]));
        if filter::worthwhile(y.len(), self.memory) {
            y = filter::there_and_back(&self.sections, self.memory, &y);
        } else {
            self.there_and_back(&mut y);
        }
        y.truncate(n + pad);
        y.drain(..pad);
        y
    }

    fn there_and_back(&self, y: &mut [f64]) {
        for pair in self.sections.chunks(2) {
            match *pair {
                [a, b] => run([a, b], y.iter_mut()),
                [a, ..] => run([a], y.iter_mut()),
                [] => {}
            }
        }
        for pair in self.sections.chunks(2) {
            match *pair {
                [a, b] => run([a, b], y.iter_mut().rev()),
                [a, ..] => run([a], y.iter_mut().rev()),
                [] => {}
            }
        }
    }

    /// Power gain |H|⁴ of the zero-phase filter at frequency `f` in Hz.
    #[must_use]
    pub fn zero_phase_gain(&self, f: f64, rate: f64) -> f64 {
        let w = 2.0 * PI * f / rate;
        let square = |c0: f64, c1: f64, c2: f64| {
            let re = c0 + c1 * w.cos() + c2 * (2.0 * w).cos();
            let im = c1 * w.sin() + c2 * (2.0 * w).sin();
            re * re + im * im
        };
        self.sections
            .iter()
            .map(|s| square(s.b[0], s.b[1], s.b[2]) / square(1.0, s.a[0], s.a[1]))
            .product::<f64>()
            .powi(2)
    }
}

// A recursive filter of second order.

/// One second-order section with a0 = 1: y = b0·x + b1·x₋₁ + b2·x₋₂ − a1·y₋₁ − a2·y₋₂.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Biquad {
    /// b0, b1, b2.
    pub b: [f64; 3],
    /// a1, a2.
    pub a: [f64; 2],
}

impl Biquad {
    /// The state that a long constant input of 1 leaves behind (transposed direct form II).
    pub(super) fn settled(&self) -> [f64; 2] {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        let gain = (b0 + b1 + b2) / (1.0 + a1 + a2);
        [gain - b0, b2 - a2 * gain]
    }

    /// One sample through the section in the given state.
    ///
    /// The next state is written in the present one alone, not in the output: a sample waits for one product
    /// and one sum of the sample before it.
    #[inline(always)]
    pub(super) fn step(&self, [s1, s2]: &mut [f64; 2], x: f64) -> f64 {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        let (state, y) = (*s1, b0 * x + *s1);
        *s1 = ((b1 - a1 * b0) * x + *s2) - a1 * state;
        *s2 = (b2 - a2 * b0) * x - a2 * state;
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    /// Order, cutoff, rate, a1 and a2 by section, product of the sections' b0.
    type Design = (usize, f64, f64, &'static [[f64; 2]], f64);

    /// scipy.signal.butter(order, cutoff, fs=rate, output="sos"), sections without their gain: a1, a2 each.
    const SCIPY: &[Design] = &[
        (2, 10.0, 200.0, &[[-1.561018075800718, 0.641351538057563]], 0.020083365564211232),
        (
            4,
            8.0,
            200.0,
            &[[-1.575239977788152, 0.626334259159141], [-1.768827859923721, 0.826201332947616]],
            0.0001832160233696094,
        ),
        (
            4,
            20.0,
            100.0,
            &[[-0.328975677370953, 0.064587654916443], [-0.453119520652385, 0.466325570763237]],
            0.046582906636443676,
        ),
        (
            6,
            5.0,
            250.0,
            &[
                [-1.769954139848481, 0.784021683685792],
                [-1.822694925196308, 0.837181651256023],
                [-1.921886056121375, 0.937161150394224],
            ],
            4.863987500780837e-08,
        ),
        (
            8,
            40.0,
            100.0,
            &[
                [1.026351474261055, 0.26864019099379],
                [1.086858461362894, 0.343430940165366],
                [1.219725365124023, 0.507663465174044],
                [1.451579594247836, 0.794251053241888],
            ],
            0.19287327479664115,
        ),
    ];

    #[test]
    fn coefficients_are_those_of_scipy() {
        for (order, cutoff, rate, sections, gain) in SCIPY {
            let filter = Butterworth::low_pass(*order, *cutoff, *rate).unwrap();
            assert_eq!(filter.sections.len(), sections.len());
            for (ours, theirs) in filter.sections.iter().zip(*sections) {
                for k in 0..2 {
                    approx::assert_relative_eq!(ours.a[k], theirs[k], epsilon = 1e-12);
                }
            }
            let product: f64 = filter.sections.iter().map(|s| s.b[0]).product();
            approx::assert_relative_eq!(product, *gain, max_relative = 1e-9);
        }
    }

    #[test]
    fn zero_phase_keeps_lines_and_does_not_delay() {
        let rate = 200.0;
        let filter = Butterworth::low_pass(4, 10.0, rate).unwrap();
        let line: Vec<f64> = (0..300).map(|k| 2.0 - 0.01 * k as f64).collect();
        for (a, b) in line.iter().zip(filter.zero_phase(&line)) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-4);
        }
        let wave = |f: f64| (0..1000).map(|k| (2.0 * PI * f * k as f64 / rate).sin()).collect::<Vec<_>>();
        let slow = wave(1.0);
        let out = filter.zero_phase(&slow);
        for k in 200..800 {
            approx::assert_abs_diff_eq!(slow[k], out[k], epsilon = 1e-3);
        }
        let fast = filter.zero_phase(&wave(20.0));
        let rms = (fast[200..800].iter().map(|v| v * v).sum::<f64>() / 600.0).sqrt();
        let expected = (filter.zero_phase_gain(20.0, rate) / 2.0).sqrt();
        approx::assert_relative_eq!(rms, expected, max_relative = 0.01);
    }

    /// Pieces worked on at the same time are the signal worked on from end to end: noise with a step and a
    /// large constant, of any length, at bands from a tenth of the rate to a hundredth.
    #[test]
    fn pieces_are_the_whole() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut in_pieces = 0;
        for (order, cutoff, n) in
            [(4, 20.0, 3000), (4, 2.0, 20_000), (2, 10.0, 4001), (6, 10.0, 9999), (4, 20.0, 300)]
        {
            let filter = Butterworth::low_pass(order, cutoff, 200.0).unwrap();
            let x: Vec<f64> =
                (0..n).map(|k| f64::from(k > n / 3) * 5.0 + 100.0 + rng.random_range(-1.0..1.0)).collect();
            in_pieces += usize::from(filter::worthwhile(n, filter.memory));
            let mut whole = x.clone();
            filter.there_and_back(&mut whole);
            for (a, b) in whole.iter().zip(filter::there_and_back(&filter.sections, filter.memory, &x)) {
                approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-11);
            }
        }
        assert_eq!(in_pieces, 4);
    }

    #[test]
    fn impossible_designs_and_short_inputs_are_no_panic() {
        assert!(Butterworth::low_pass(4, 0.0, 100.0).is_none());
        assert!(Butterworth::low_pass(4, 50.0, 100.0).is_none());
        assert!(Butterworth::low_pass(4, f64::NAN, 100.0).is_none());
        let filter = Butterworth::low_pass(3, 10.0, 100.0).unwrap();
        assert_eq!(filter.sections.len(), 2);
        for n in 0..5 {
            let out = filter.zero_phase(&[1.5; 5][..n]);
            assert!(out.len() == n && out.iter().all(|v| (v - 1.5).abs() < 1e-12));
        }
    }
}
