//! The band of an analysis: one low-pass filter and one decimation for every signal and every column alike.

use super::Butterworth;

/// A low-pass band with its decimation, the same on both sides of a regression.
#[derive(Clone, Debug)]
pub struct Band {
    /// −3 dB frequency in Hz of the zero-phase filter.
    pub cutoff: f64,
    /// Every how many samples one is kept.
    pub decimation: usize,
    /// Samples of the even grid left out at each end, where the filter has not seen both sides.
    pub trim: usize,
    filter: Option<Butterworth>,
}

impl Band {
    /// A band up to `cutoff` Hz for signals of `rate` Hz.
    ///
    /// The kept rate is at least 2.5 times the cutoff. Where the rate is too low to hold the band, nothing is filtered
    /// and the band ends at half the rate.
    #[must_use]
    pub fn new(cutoff: f64, rate: f64) -> Band {
        // Two passes lower the −3 dB point of an order-4 section pair by (√2 − 1)^(1/8).
        let single = cutoff / (2f64.sqrt() - 1.0).powf(1.0 / 8.0);
        let filter = if cutoff < 0.4 * rate { Butterworth::low_pass(4, single, rate) } else { None };
        let decimation = if filter.is_some() { ((rate / (2.5 * cutoff)).floor() as usize).max(1) } else { 1 };
        let cutoff = if filter.is_some() { cutoff } else { rate / 2.0 };
        Band { cutoff, decimation, trim: (0.3 * rate).ceil() as usize, filter }
    }

    /// The indices of the even grid that are kept of `n` samples.
    #[must_use]
    pub fn kept(&self, n: usize) -> Vec<usize> {
        (self.trim..n.saturating_sub(self.trim)).step_by(self.decimation).collect()
    }

    /// Filters without decimating.
    #[must_use]
    pub fn filtered(&self, x: &[f64]) -> Vec<f64> {
        self.filter.as_ref().map_or_else(|| x.to_vec(), |f| f.zero_phase(x))
    }

    /// Filters and keeps the samples of [`Band::kept`].
    #[must_use]
    pub fn pass(&self, x: &[f64]) -> Vec<f64> {
        // A column that is zero everywhere stays so; most entries of a regressor are.
        if x.iter().all(|v| *v == 0.0) {
            return vec![0.0; self.kept(x.len()).len()];
        }
        let y = self.filtered(x);
        self.kept(x.len()).into_iter().map(|k| y[k]).collect()
    }

    /// Standard deviation that white noise of deviation 1 at `rate` Hz keeps in the band.
    #[must_use]
    pub fn white_share(&self, rate: f64) -> f64 {
        mean_over_frequencies(rate, |f| self.amplitude(f, rate).powi(2)).sqrt()
    }

    /// The same for what passes `wider`, a band with a higher cutoff, and not this one.
    #[must_use]
    pub fn white_share_between(&self, wider: &Band, rate: f64) -> f64 {
        mean_over_frequencies(rate, |f| (wider.amplitude(f, rate) - self.amplitude(f, rate)).powi(2)).sqrt()
    }

    /// Amplitude that is kept at a frequency, Hz.
    fn amplitude(&self, frequency: f64, rate: f64) -> f64 {
        self.filter.as_ref().map_or(1.0, |f| f.zero_phase_gain(frequency, rate).sqrt())
    }
}

fn mean_over_frequencies(rate: f64, value: impl Fn(f64) -> f64) -> f64 {
    let steps = 400;
    let at = |k: i32| value(rate / 2.0 * (f64::from(k) + 0.5) / f64::from(steps));
    (0..steps).map(at).sum::<f64>() / f64::from(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_keeps_what_is_in_it() {
        let band = Band::new(10.0, 200.0);
        assert_eq!(band.decimation, 8);
        approx::assert_relative_eq!(
            band.filter.as_ref().unwrap().zero_phase_gain(10.0, 200.0),
            0.5,
            max_relative = 0.02
        );
        let ones = vec![1.0; 1000];
        let out = band.pass(&ones);
        assert_eq!(out.len(), band.kept(1000).len());
        assert!(out.iter().all(|v| (v - 1.0).abs() < 1e-9));
        approx::assert_relative_eq!(band.white_share(200.0), (0.1f64).sqrt(), max_relative = 0.05);
        assert!(Band::new(10.0, 20.0).filter.is_none());
        assert!(band.kept(10).is_empty());
    }
}
