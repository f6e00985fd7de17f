//! An angle as emitted code sums it up, and its sine and cosine.

use super::interval::Interval;
use super::precision::{PRECISIONS, Precision};
use super::program::{Errors, Variable};
use crate::dynamics::angles::Angles;
use crate::dynamics::function::Argument;
use crate::graph::JointSum;

/// Σ ratio·variable + offset.
#[derive(Clone, Debug)]
pub(super) struct Angle {
    terms: Vec<Term>,
    offset: f64,
    /// How far the emitted offset is from the exact one.
    of_offset: Errors,
}

/// One joint's part.
#[derive(Clone, Debug)]
struct Term {
    variable: usize,
    /// 1 or −1 where there is no ratio to multiply with.
    factor: f64,
    /// How far the emitted ratio is from the exact one, where there is one.
    of_ratio: Option<Errors>,
}

impl Angle {
    pub(super) fn new(angles: &Angles, sum: JointSum, mut place: impl FnMut(Variable) -> usize) -> Angle {
        let term = |(joint, negative): (usize, bool)| {
            let of = angles.joint(joint);
            let factor = of.ratio.unwrap_or(1.0);
            let error = |p: Precision| p.of_double(factor, Precision::Double.half_ulp(factor.abs()));
            Term {
                variable: place((Argument::Positions, of.coordinate)),
                factor: if negative { -factor } else { factor },
                of_ratio: of.ratio.map(|_| PRECISIONS.map(error)),
            }
        };
        let terms = sum.joints().map(term).collect();
        let offset = angles.offset(sum);
        // A sum of a few doubles, each within a few units of its last place.
        let written = 8.0 * f64::EPSILON * (1.0 + offset.abs());
        let of_offset = PRECISIONS.map(|p| if offset == 0.0 { 0.0 } else { p.of_double(offset, written) });
        Angle { terms, offset, of_offset }
    }

    /// Each variable with its factor.
    pub(super) fn factors(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.terms.iter().map(|term| (term.variable, term.factor))
    }

    /// The range of its sine or cosine, and the error of the emitted one; `None` beyond [`LARGEST`].
    pub(super) fn turned(&self, sine: bool, ranges: &[Interval]) -> Option<(Interval, Errors)> {
        let mut angle = Interval::point(0.0);
        let mut errors = [0.0; 2];
        for (k, term) in self.terms.iter().enumerate() {
            let q = ranges[term.variable];
            let part = q.times(Interval::point(term.factor)).widened(0.0);
            angle = angle.plus(part).widened(0.0);
            if let Some(of_ratio) = term.of_ratio {
                errors = sum(errors, of_ratio.map(|error| error * q.magnitude()));
                errors = sum(errors, rounded(part, errors));
            }
            // Nothing is added to the first.
            if k > 0 {
                errors = sum(errors, rounded(angle, errors));
            }
        }
        if self.offset != 0.0 {
            angle = angle.plus(Interval::point(self.offset)).widened(0.0);
            errors = sum(errors, self.of_offset);
            errors = sum(errors, rounded(angle, errors));
        }
        let errors = errors.map(|error| GROWN * error);
        angle = angle.widened(errors[0]);
        // Not so where it is no number, too.
        if angle.magnitude() > LARGEST || angle.magnitude().is_nan() {
            return None;
        }
        let (s, c) = (angle.sine(), angle.cosine());
        let (value, slope) = if sine { (s, c) } else { (c, s) };
        let of = |k: usize| GROWN * (SINE_ERROR * PRECISIONS[k].unit() + errors[k] * slope.magnitude());
        Some((value, [of(0), of(1)]))
    }
}

fn sum(a: Errors, b: Errors) -> Errors {
    [a[0] + b[0], a[1] + b[1]]
}

/// What the last operation of an angle rounds, whose operands are off by `errors`.
fn rounded(value: Interval, errors: Errors) -> Errors {
    let of = |k: usize| PRECISIONS[k].half_ulp(GROWN * (value.magnitude() + errors[k]));
    [of(0), of(1)]
}

/// The emitted sine and cosine of an angle of the format, in units of [`Precision::unit`], up to [`LARGEST`].
///
/// `f32`: 0.85 of every number (a test of `dyngen/verify/src/text/accuracy.rs`). `f64`, by hand for |r| ≤
/// π/4 after the reduction, which is exact to 1e-30: of the sine 0.5 for the last sum, 0.13 for product and
/// sum of the correction, 0.11 for r², 0.07 for the polynomial, 0.04 for its approximation (2⁻⁵⁸, fdlibm)
/// and the tail; of the cosine 0.5, 0.22 for r², 0.06 for the correction and 0.07 for approximation and
/// tail, as 1 − r²/2 is compensated.
const SINE_ERROR: f64 = 1.0;

/// In rad.
const LARGEST: f64 = 1000.0;

/// For bounds of a few roundings of doubles.
const GROWN: f64 = 1.0 + 1e-12;
