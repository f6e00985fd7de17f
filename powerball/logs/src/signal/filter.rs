//! The band of an analysis: one low-pass filter and one decimation for every signal and every column alike.
//!
//! The module also has a recursive filter that runs over the pieces of one long signal at the same time.

use super::Butterworth;
use super::butterworth::Biquad;
use crate::batch::{self, Work};

/// The bands of an analysis, Hz, widest first, an octave apart: each is made of the one before. Above the
/// widest, accelerations are noise of positions differentiated twice, and arms are hardly rigid; a motion and
/// the friction at its reversals are slower than the narrowest.
pub const BANDS: [f64; 3] = [7.0, 3.5, 1.75];
/// Time that is left out at each end of a stretch, s.
const ENDS: f64 = 0.3;

/// A low-pass band with its decimation, the same on both sides of a regression.
///
/// The narrower ones of [`BANDS`] are made of the samples of the one before at five times its cutoff:
/// filtered again at that rate. It costs a fraction of a filter at full rate, and differs from one by 3 % of
/// amplitude at most, around its end. What the wider band leaves of faster signals and folds into this one (a
/// ten-thousandth) is the same on both sides, as is everything that is linear.
#[derive(Clone, Debug)]
pub struct Band {
    /// −3 dB frequency in Hz of the zero-phase filter.
    pub cutoff: f64,
    /// Every how many samples one is kept.
    pub decimation: usize,
    /// Samples of the even grid left out at each end, where the filter has not seen both sides.
    pub trim: usize,
    /// The widest first.
    stages: Vec<Stage>,
}

/// A filter and a decimation.
#[derive(Clone, Debug)]
struct Stage {
    /// The filter at the rate of its samples.
    filter: Option<Butterworth>,
    /// The filter at full rate, for what is not decimated.
    whole: Option<Butterworth>,
    /// Every how many of its samples one is kept.
    decimation: usize,
    /// Every how many of them the next stage gets.
    onward: usize,
    /// Which of its samples is the first one that is not trimmed.
    first: usize,
}

impl Stage {
    fn new(cutoff: f64, rate: f64, whole: f64, first: usize) -> Stage {
        // Two passes lower the −3 dB point of an order-4 section pair by (√2 − 1)^(1/8).
        let single = cutoff / (2f64.sqrt() - 1.0).powf(1.0 / 8.0);
        let at = |rate: f64| if cutoff < 0.4 * rate { Butterworth::low_pass(4, single, rate) } else { None };
        let filter = at(rate);
        let every = |share: f64| {
            // A rate of 99.99…9 is one of 100: rows of all stretches are as many a second.
            if filter.is_some() { ((rate / (share * cutoff) + 1e-6).floor() as usize).max(1) } else { 1 }
        };
        let (decimation, onward) = (every(2.5), every(5.0));
        Stage { whole: filter.as_ref().and_then(|_| at(whole)), filter, decimation, onward, first }
    }

    fn filtered(&self, x: &[f64]) -> Vec<f64> {
        self.filter.as_ref().map_or_else(|| x.to_vec(), |f| f.zero_phase(x))
    }
}

impl Band {
    /// A band up to `cutoff` Hz for signals of `rate` Hz; one of [`BANDS`] is made of those before it.
    ///
    /// The kept rate is at least 2.5 times the cutoff. Where the rate is too low to hold the band, nothing is
    /// filtered and the band ends at half the rate.
    #[must_use]
    pub fn new(cutoff: f64, rate: f64) -> Band {
        Band::with_ends(cutoff, rate, ENDS)
    }

    /// Like [`Band::new`], with `ends` seconds left out at each end.
    #[must_use]
    pub fn with_ends(cutoff: f64, rate: f64, ends: f64) -> Band {
        let wider = BANDS.iter().position(|band| *band == cutoff).unwrap_or(0);
        let trim = (ends * rate).ceil() as usize;
        let none = Band { cutoff, decimation: 1, trim, stages: Vec::new() };
        BANDS[..wider].iter().chain([&cutoff]).fold(none, |band, cutoff| band.with(*cutoff, rate))
    }

    fn with(mut self, cutoff: f64, rate: f64) -> Band {
        let onward: usize = self.stages.iter().map(|stage| stage.onward).product();
        // Every stage hands on the first sample that is not trimmed.
        let first = self.stages.iter().fold(self.trim, |first, stage| first / stage.onward);
        let own = rate / onward as f64;
        let stage = Stage::new(cutoff, own, rate, first);
        self.cutoff = if stage.filter.is_some() { cutoff } else { own / 2.0 };
        self.decimation = onward * stage.decimation;
        self.stages.push(stage);
        self
    }

    /// The indices of the even grid that are kept of `n` samples.
    #[must_use]
    pub fn kept(&self, n: usize) -> Vec<usize> {
        (self.trim..n.saturating_sub(self.trim)).step_by(self.decimation).collect()
    }

    /// Filters without decimating.
    #[must_use]
    pub fn filtered(&self, x: &[f64]) -> Vec<f64> {
        self.whole().fold(x.to_vec(), |x, filter| filter.zero_phase(&x))
    }

    fn whole(&self) -> impl Iterator<Item = &Butterworth> {
        self.stages.iter().filter_map(|stage| stage.whole.as_ref())
    }

    /// Filters and keeps the samples of [`Band::kept`].
    #[must_use]
    pub fn pass(&self, x: &[f64]) -> Vec<f64> {
        self.pass_bands(x, 1).pop().unwrap_or_default()
    }

    /// Like [`Band::pass`], for the last `count` of the bands that this one is made of, with this one as the
    /// last.
    #[must_use]
    pub fn pass_bands(&self, x: &[f64], count: usize) -> Vec<Vec<f64>> {
        let skipped = self.stages.len().saturating_sub(count);
        // A column that is zero everywhere stays so; most entries of a regressor are.
        let zero = x.iter().all(|v| *v == 0.0);
        let end = x.len().saturating_sub(self.trim).max(self.trim);
        let (mut samples, mut onward, mut bands) = (None, 1, Vec::with_capacity(count));
        for (k, stage) in self.stages.iter().enumerate() {
            let kept = (end - self.trim).div_ceil(onward * stage.decimation);
            onward *= stage.onward;
            if zero {
                bands.extend((k >= skipped).then(|| vec![0.0; kept]));
                continue;
            }
            let filtered = stage.filtered(samples.as_deref().unwrap_or(x));
            if k >= skipped {
                let from = filtered.get(stage.first..).unwrap_or_default();
                bands.push(from.iter().step_by(stage.decimation).take(kept).copied().collect());
            }
            let onward = filtered.into_iter().skip(stage.first % stage.onward).step_by(stage.onward);
            samples = Some(onward.collect::<Vec<f64>>());
        }
        bands
    }

    /// Standard deviation that white noise of deviation 1 at `rate` Hz keeps in the band.
    #[must_use]
    pub fn white_share(&self, rate: f64) -> f64 {
        mean_over_frequencies(rate, |f| self.amplitude(f, rate).powi(2)).sqrt()
    }

    /// Like [`Band::white_share`], for the noise that passes `wider`, a band with a higher cutoff, but not
    /// this band.
    #[must_use]
    pub fn white_share_between(&self, wider: &Band, rate: f64) -> f64 {
        mean_over_frequencies(rate, |f| (wider.amplitude(f, rate) - self.amplitude(f, rate)).powi(2)).sqrt()
    }

    /// Amplitude that is kept at a frequency, Hz.
    #[must_use]
    pub fn amplitude(&self, frequency: f64, rate: f64) -> f64 {
        self.whole().map(|f| f.zero_phase_gain(frequency, rate).sqrt()).product()
    }
}

fn mean_over_frequencies(rate: f64, value: impl Fn(f64) -> f64) -> f64 {
    let steps = 400;
    let at = |k: i32| value(rate / 2.0 * (f64::from(k) + 0.5) / f64::from(steps));
    (0..steps).map(at).sum::<f64>() / f64::from(steps)
}

// A recursive filter over the pieces of one long signal at the same time.
//
// A sample waits for the one before it, so that one filter leaves most of a processor idle. What a filter was
// fed long ago is of no matter to it: each piece begins as many samples early as it takes to forget the state
// that it begins with. The result is that of the whole signal but for rounding.

/// Pieces worked on at once.
const LANES: usize = 8;

/// Samples after which sections have forgotten their state, in double precision.
pub(super) fn memory(sections: &[Biquad]) -> usize {
    // Complex poles have the radius √a₂. Sections in a row forget later than the slowest of them.
    let radius = sections.iter().map(|section| section.a[1].abs().sqrt()).fold(0.0, f64::max);
    let samples = 1.3 * f64::EPSILON.ln() / radius.ln();
    if samples.is_finite() && samples >= 0.0 { samples.ceil() as usize } else { usize::MAX / 2 }
}

/// Whether pieces take less time than the whole.
pub(super) fn worthwhile(samples: usize, memory: usize) -> bool {
    samples / 4 > memory
}

/// Filters forwards, then backwards; either way the filter starts settled on the first sample that it meets.
pub(super) fn there_and_back(sections: &[Biquad], memory: usize, samples: &[f64]) -> Vec<f64> {
    let [Some(first), Some(last)] = [samples.first(), samples.last()] else { return Vec::new() };
    let length = samples.len().div_ceil(LANES);
    // A constant before either end keeps the filter as it starts.
    let mut y = Vec::with_capacity(LANES * length + 2 * memory);
    y.resize(memory, *first);
    y.extend_from_slice(samples);
    let end = y.len();
    y.resize(LANES * length + 2 * memory, *last);
    for pair in sections.chunks(2) {
        pass(pair, &mut y, memory, length, |k| k);
    }
    let last = y[end - 1];
    y[end..].fill(last);
    let from = y.len() - 1;
    for pair in sections.chunks(2) {
        pass(pair, &mut y, memory, length, |k| from - k);
    }
    y.truncate(end);
    y.drain(..memory);
    y
}

/// One or two sections over all pieces; `at` is where the k-th sample in the direction of work stands.
fn pass(sections: &[Biquad], y: &mut [f64], memory: usize, length: usize, at: impl Fn(usize) -> usize) {
    match *sections {
        [a, b] => batch::run(Pass { sections: [a, b], y, memory, length, at }),
        [a, ..] => batch::run(Pass { sections: [a], y, memory, length, at }),
        [] => {}
    }
}

struct Pass<'a, F, const N: usize> {
    sections: [Biquad; N],
    y: &'a mut [f64],
    memory: usize,
    length: usize,
    at: F,
}

impl<F: Fn(usize) -> usize, const N: usize> Work for Pass<'_, F, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Pass { sections, y, memory, length, at } = self;
        let mut states = [[[0.0; LANES]; 2]; N];
        for lane in 0..LANES {
            let mut x = y[at(lane * length)];
            for (section, state) in sections.iter().zip(&mut states) {
                let settled = section.settled().map(|s| s * x);
                [state[0][lane], state[1][lane]] = settled;
                x = section.step(&mut settled.clone(), x);
            }
        }
        for k in 0..memory + length {
            let mut x: [f64; LANES] = std::array::from_fn(|lane| y[at(lane * length + k)]);
            for (section, [first, second]) in sections.iter().zip(&mut states) {
                for lane in 0..LANES {
                    let mut state = [first[lane], second[lane]];
                    x[lane] = section.step(&mut state, x[lane]);
                    [first[lane], second[lane]] = state;
                }
            }
            if k >= memory {
                for lane in 0..LANES {
                    y[at(lane * length + k)] = x[lane];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_keeps_what_is_in_it() {
        let band = Band::new(10.0, 200.0);
        assert_eq!(band.decimation, 8);
        approx::assert_relative_eq!(
            band.stages[0].filter.as_ref().unwrap().zero_phase_gain(10.0, 200.0),
            0.5,
            max_relative = 0.02
        );
        let ones = vec![1.0; 1000];
        let out = band.pass(&ones);
        assert_eq!(out.len(), band.kept(1000).len());
        assert!(out.iter().all(|v| (v - 1.0).abs() < 1e-9));
        approx::assert_relative_eq!(band.white_share(200.0), (0.1f64).sqrt(), max_relative = 0.05);
        assert!(Band::new(10.0, 20.0).stages[0].filter.is_none());
        assert!(band.kept(10).is_empty());
    }

    /// At any rate and length the samples of a narrower band lie at the documented times, and are those of
    /// one filter at full rate but for little; made together with those of wider bands they are the same.
    #[test]
    fn narrower_bands_are_made_of_wider_ones() {
        for (rate, n) in
            [(200.0, 4001), (100.0, 1999), (125.0, 2500), (62.0, 900), (20.0, 300), (1000.0, 9000)]
        {
            let wave = |f: f64, k: usize| (std::f64::consts::TAU * f * k as f64 / rate + 0.3).sin();
            let narrow = Band::new(BANDS[2], rate);
            assert_eq!(narrow.stages.len(), 3);
            for f in [0.3, 0.9, 1.7, 2.2, 3.9] {
                let x: Vec<f64> = (0..n).map(|k| wave(f, k)).collect();
                let bands = narrow.pass_bands(&x, 3);
                for (cutoff, out) in BANDS.into_iter().zip(&bands) {
                    let band = Band::new(cutoff, rate);
                    assert_eq!(*out, band.pass(&x), "{cutoff} Hz of {rate}");
                    let kept = band.kept(n);
                    assert_eq!(out.len(), kept.len());
                    let once = Stage::new(cutoff, rate, rate, 0);
                    let gain = once.filter.map_or(1.0, |once| once.zero_phase_gain(f, rate).sqrt());
                    // Ends are continued by reflection, which a wave does not do.
                    let inner = out.len() / 4..out.len() * 3 / 4;
                    for (y, k) in out[inner.clone()].iter().zip(&kept[inner]) {
                        assert!(
                            (y - gain * wave(f, *k)).abs() < 0.03,
                            "{f} Hz in {cutoff} Hz of {rate}: {y}"
                        );
                    }
                }
            }
            assert!(narrow.pass_bands(&vec![0.0; n], 2).iter().flatten().all(|y| *y == 0.0));
        }
        assert_eq!(Band::new(1.75, 100.0).decimation, 20);
    }
}
