//! Numbers of two doubles: twice the digits (Dekker 1971), for what is exact compared with a double.

use crate::exact::rational::{self, Rational, to_f64};
use crate::graph::evaluate::Field;

/// The sum of two doubles, the second below half a unit in the first's last place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Twice(f64, f64);

impl From<f64> for Twice {
    fn from(x: f64) -> Self {
        Twice(x, 0.0)
    }
}

/// a + b and what it rounds (Knuth).
fn sum(a: f64, b: f64) -> Twice {
    let s = a + b;
    let t = s - a;
    Twice(s, (a - (s - t)) + (b - t))
}

/// a·b and what it rounds.
fn product(a: f64, b: f64) -> Twice {
    let p = a * b;
    Twice(p, a.mul_add(b, -p))
}

impl Twice {
    pub(super) fn high(self) -> f64 {
        self.0 + self.1
    }

    fn scaled(self, by: f64) -> Twice {
        self.mul(Twice::from(by))
    }

    /// Of an angle of some turns.
    pub(super) fn sin_cos(self) -> (Twice, Twice) {
        let half_pi = Twice(std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17);
        let turns = (self.0 / half_pi.0).round();
        let r = self.add(half_pi.scaled(-turns));
        let square = r.mul(r);
        let series = |first: Twice, mut k: f64| {
            let (mut term, mut sum) = (first, Twice::from(0.0));
            while term.0.abs() > 1e-40 {
                sum = sum.add(term);
                term = term.mul(square).div(Twice::from(-k * (k + 1.0))).unwrap();
                k += 2.0;
            }
            sum
        };
        let (s, c) = (series(r, 2.0), series(Twice::from(1.0), 1.0));
        match turns.rem_euclid(4.0) as u8 {
            0 => (s, c),
            1 => (c, s.neg()),
            2 => (s.neg(), c.neg()),
            _ => (c.neg(), s),
        }
    }
}

impl Field for Twice {
    fn add(self, other: Self) -> Self {
        let (high, low) = (sum(self.0, other.0), sum(self.1, other.1));
        let first = sum(high.0, high.1 + low.0);
        sum(first.0, first.1 + low.1)
    }
    fn neg(self) -> Self {
        Twice(-self.0, -self.1)
    }
    fn mul(self, other: Self) -> Self {
        let p = product(self.0, other.0);
        sum(p.0, p.1 + (self.0 * other.1 + self.1 * other.0))
    }
    fn div(self, other: Self) -> Option<Self> {
        let first = Twice::from(self.0 / other.0);
        let rest = self.add(other.mul(first).neg());
        Some(first.add(Twice::from(rest.0 / other.0)))
    }
    fn sqrt(self) -> Option<Self> {
        let first = Twice::from(self.0.sqrt());
        let rest = self.add(first.mul(first).neg());
        Some(first.add(Twice::from(rest.0 / (2.0 * first.0))))
    }
    fn constant(value: &Rational) -> Option<Self> {
        let high = to_f64(value);
        Some(Twice(high, to_f64(&(value - rational::from_f64(high)?))))
    }
}

#[test]
fn they_have_thirty_digits() {
    let third = Twice::from(1.0).div(Twice::from(3.0)).unwrap();
    assert!(third.scaled(3.0).add(Twice::from(-1.0)).high().abs() < 1e-31);
    let (s, c) = Twice::from(5.7).sin_cos();
    let one = s.mul(s).add(c.mul(c));
    assert!(one.add(Twice::from(-1.0)).high().abs() < 1e-30);
    // sin 1 = 0.841470984807896506652502321630298999…
    let sine = Twice::from(1.0).sin_cos().0;
    assert!(sine.add(Twice::from(-0.8414709848078965)).high() - 6.652_502_321_630_299e-18 < 1e-32);
}
