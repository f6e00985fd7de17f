//! A number of one fit against the same number of another one.

use crate::identification::estimate::distribution::{f_tail, t_critical};

/// A difference with its variance.
#[derive(Clone, Copy)]
pub(super) struct Difference {
    pub value: f64,
    pub variance: f64,
    pub freedom: f64,
}

impl Difference {
    /// Of two independent values, each with its variance and degrees of freedom (Welch and Satterthwaite).
    pub(super) fn of(a: (f64, f64, f64), b: (f64, f64, f64)) -> Difference {
        let variance = a.1 + b.1;
        let doubt = a.1 * a.1 / a.2 + b.1 * b.1 / b.2;
        let freedom = if doubt > 0.0 { variance * variance / doubt } else { a.2.min(b.2) };
        Difference { value: b.0 - a.0, variance, freedom }
    }

    /// How often equal arms would differ so.
    pub(super) fn p_value(self) -> f64 {
        if self.variance > 0.0 {
            f_tail(self.value * self.value / self.variance, 1.0, self.freedom)
        } else {
            1.0
        }
    }

    /// Half the width of an interval that misses the truth with probability `p`.
    fn half(self, p: f64) -> f64 {
        t_critical(p, self.freedom) * self.variance.sqrt()
    }

    pub(super) fn interval(self, p: f64) -> [f64; 2] {
        [self.value - self.half(p), self.value + self.half(p)]
    }
}
