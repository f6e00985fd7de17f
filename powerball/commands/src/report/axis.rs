//! Axes: ranges, ticks at round numbers.

use powerball_explanation::effects::words::typographic;

/// A linear axis over a range, with ticks at multiples of 1, 2 or 5 times a power of ten.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    step: f64,
}

impl Axis {
    /// An axis over all finite values, widened on both sides by the share `margin`, with about `ticks` ticks.
    pub(super) fn over(values: impl Iterator<Item = f64>, margin: f64, ticks: usize) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|v| v.is_finite()) {
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if high - low < 1e-12 * high.abs().max(1e-6) {
            let half = if high == 0.0 { 1.0 } else { 0.5 * high.abs() };
            (low, high) = (low - half, high + half);
        }
        let widen = margin * (high - low);
        let (low, high) = (low - widen, high + widen);
        Axis { low, high, step: round_step((high - low) / ticks.max(1) as f64) }
    }

    /// The value at which the axis starts.
    pub(super) fn low(&self) -> f64 {
        self.low
    }

    /// The value at which the axis ends.
    pub(super) fn high(&self) -> f64 {
        self.high
    }

    /// The position of a value when `low` lies at `from` and `high` at `to`.
    pub(super) fn place(&self, value: f64, from: f64, to: f64) -> f64 {
        from + (value - self.low) / (self.high - self.low) * (to - from)
    }

    /// The ticks with their labels.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        let first = (self.low / self.step).ceil() as i64;
        let last = (self.high / self.step + 1e-9).floor() as i64;
        (first..=last)
            .map(|k| {
                let value = k as f64 * self.step;
                (value, self.label(value))
            })
            .collect()
    }

    fn label(&self, value: f64) -> String {
        let largest = self.low.abs().max(self.high.abs());
        let text = if largest >= 1e6 || self.step < 1e-4 {
            format!("{value:.1e}")
        } else {
            let decimals = (-(self.step * 1.0001).log10().floor()).max(0.0) as usize;
            format!("{value:.decimals$}")
        };
        typographic(&text)
    }
}

/// The first of 1, 2, 5 times a power of ten that is not much below `rough`.
fn round_step(rough: f64) -> f64 {
    let power = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= 0.7 * rough).unwrap_or(10.0);
    factor * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        for (low, high) in [(-3.2, 7.9), (0.0, 1.0), (1e-5, 3e-5), (-250.0, -100.0), (4.0, 4.0)] {
            let axis = Axis::over([low, high].into_iter(), 0.05, 6);
            let ticks = axis.ticks();
            assert!((3..=13).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            for (value, _) in &ticks {
                assert!(*value >= axis.low() - 1e-9 && *value <= axis.high() + 1e-9);
            }
        }
        let labels: Vec<String> =
            Axis::over([0.0, 1.0].into_iter(), 0.0, 5).ticks().into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    }

    #[test]
    fn data_without_range_or_without_numbers_still_have_an_axis() {
        for values in [vec![], vec![f64::NAN], vec![0.0], vec![-2.0, -2.0]] {
            let axis = Axis::over(values.into_iter(), 0.05, 5);
            assert!(axis.high() > axis.low());
            assert!(!axis.ticks().is_empty());
        }
    }
}
