//! Intervals that hold every exact result: each operation is widened by more than it may have rounded.

use std::f64::consts::{FRAC_PI_2, TAU};

/// All numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    /// The least of them.
    pub(super) low: f64,
    /// The greatest.
    pub(super) high: f64,
}

impl Interval {
    /// One number.
    pub(super) const fn point(x: f64) -> Interval {
        Interval { low: x, high: x }
    }

    /// From −x to x.
    pub(super) fn within(x: f64) -> Interval {
        Interval { low: -x.abs(), high: x.abs() }
    }

    /// The largest size of a number in it.
    #[inline]
    pub(super) fn magnitude(self) -> f64 {
        let (low, high) = (self.low.abs(), self.high.abs());
        if low > high { low } else { high }
    }

    /// From the least to the greatest.
    pub(super) fn width(self) -> f64 {
        self.high - self.low
    }

    /// Halfway between the two.
    pub(super) fn middle(self) -> f64 {
        0.5 * self.low + 0.5 * self.high
    }

    /// Whether a number is in it.
    #[cfg(test)]
    pub(super) fn contains(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// The lower and the upper half.
    pub(super) fn halves(self) -> [Interval; 2] {
        let middle = self.middle();
        [Interval { high: middle, ..self }, Interval { low: middle, ..self }]
    }

    /// Everything within `by` of a number in it, widened by more than an operation that gave its ends may
    /// have rounded.
    #[inline]
    pub(super) fn widened(self, by: f64) -> Interval {
        let by = by + ROUNDED * self.magnitude() + f64::MIN_POSITIVE;
        Interval { low: self.low - by, high: self.high + by }
    }

    /// What of it is within ±`most`.
    #[inline]
    pub(super) fn clamped(self, most: f64) -> Interval {
        Interval {
            low: if self.low < -most { -most } else { self.low },
            high: if self.high > most { most } else { self.high },
        }
    }

    /// What of it is in another one that holds the number too.
    #[inline]
    pub(super) fn within_range(self, other: Interval) -> Interval {
        Interval { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    #[inline]
    pub(super) fn negated(self, negative: bool) -> Interval {
        if negative { Interval { low: -self.high, high: -self.low } } else { self }
    }

    /// a + b, its ends rounded.
    #[inline]
    pub(super) fn plus(self, b: Interval) -> Interval {
        Interval { low: self.low + b.low, high: self.high + b.high }
    }

    /// a·b, its ends rounded.
    #[inline]
    pub(super) fn times(self, b: Interval) -> Interval {
        let ends = [self.low * b.low, self.low * b.high, self.high * b.low, self.high * b.high];
        let mut product = Interval::point(ends[0]);
        for x in &ends[1..] {
            product.low = if *x < product.low { *x } else { product.low };
            product.high = if *x > product.high { *x } else { product.high };
        }
        product
    }

    /// 1/a, its ends rounded; `None` where a may be zero.
    #[inline]
    pub(super) fn inverse(self) -> Option<Interval> {
        let apart = self.low > 0.0 || self.high < 0.0;
        apart.then(|| Interval { low: 1.0 / self.high, high: 1.0 / self.low })
    }

    /// The sines of the angles in it, of up to some thousand radians.
    pub(super) fn sine(self) -> Interval {
        let ends = [self.low.sin(), self.high.sin()];
        // Whether an angle phase + 2πk is among them; one that only nearly is does no harm.
        let holds = |phase: f64| {
            let turns = |x: f64| (x - phase) / TAU;
            (turns(self.high) + SLACK).floor() >= (turns(self.low) - SLACK).ceil()
        };
        let low = if holds(-FRAC_PI_2) { -1.0 } else { ends[0].min(ends[1]) - SLACK };
        let high = if holds(FRAC_PI_2) { 1.0 } else { ends[0].max(ends[1]) + SLACK };
        Interval { low, high }
    }

    /// The cosines of the angles in it.
    pub(super) fn cosine(self) -> Interval {
        self.plus(Interval::point(FRAC_PI_2)).widened(0.0).sine()
    }
}

/// More than the relative errors of the ends and of what is added to widen them, each half an epsilon.
const ROUNDED: f64 = 2.0 * f64::EPSILON;

/// More than sines of such angles, and the whole turns in them, err by.
const SLACK: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_of_an_interval_hold_those_of_every_angle_in_it() {
        for i in -40..40 {
            for j in 0..30 {
                let [low, width] = [f64::from(i) * 0.31, f64::from(j) * 0.23];
                let angles = Interval { low, high: low + width };
                let (sines, cosines) = (angles.sine(), angles.cosine());
                let all: Vec<f64> = (0..=50).map(|k| low + width * f64::from(k) / 50.0).collect();
                for x in &all {
                    assert!((sines.low..=sines.high).contains(&x.sin()), "sin {x} {sines:?}");
                    assert!((cosines.low..=cosines.high).contains(&x.cos()), "cos {x} {cosines:?}");
                }
                // No wider than what the samples show of it.
                let most = all.iter().fold(-1.0, |most: f64, x| most.max(x.sin()));
                assert!(sines.high - most < 0.5 * (width / 50.0).powi(2) + 1e-11, "{angles:?}");
            }
        }
    }

    #[test]
    fn products_and_quotients_hold_their_exact_values() {
        let of = |low, high| Interval { low, high };
        assert_eq!(of(-2.0, 3.0).times(of(-5.0, 1.0)), of(-15.0, 10.0));
        assert_eq!(of(2.0, 4.0).inverse(), Some(of(0.25, 0.5)));
        assert_eq!(of(-2.0, 4.0).inverse(), None);
        assert_eq!(of(0.0, 4.0).inverse(), None);
        // 1/3 and 0.1² are no doubles.
        let third = Interval::point(3.0).inverse().unwrap().widened(0.0);
        assert!(third.low * 3.0 < 1.0 && third.high * 3.0 > 1.0);
        let square = Interval::point(0.1).times(Interval::point(0.1)).widened(0.0);
        assert!(square.low < 0.01 && square.high > 0.01);
    }
}
