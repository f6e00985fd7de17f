//! Values of several outputs over a box with their derivatives by the positions: forwards, one interval for
//! each.

use super::interval::Interval;
use super::program::{Emitted, Operation};

/// Intervals of all operations, and of their derivatives by each of some variables.
#[derive(Clone, Debug, Default)]
pub(super) struct Gradient {
    pub(super) values: Vec<Interval>,
    /// As many for each operation as there are variables.
    pub(super) slopes: Vec<Interval>,
}

const ZERO: Interval = Interval::point(0.0);

impl Gradient {
    /// For operations without a division; `None` where an angle is too large. `varied` are places in the
    /// variables.
    pub(super) fn evaluate(&mut self, code: &Emitted, ranges: &[Interval], varied: &[usize]) -> Option<()> {
        let m = varied.len();
        self.values.clear();
        self.slopes.clear();
        self.slopes.resize(code.operations.len() * m, ZERO);
        for (k, operation) in code.operations.iter().enumerate() {
            let (before, slopes) = self.slopes.split_at_mut(k * m);
            let slopes = &mut slopes[..m];
            let of = |a: usize| &before[a * m..(a + 1) * m];
            let values = &self.values;
            let value = match *operation {
                Operation::Constant(value, errors) => value.widened(errors[1]),
                Operation::Variable(index) => {
                    for (slope, which) in slopes.iter_mut().zip(varied) {
                        *slope = if *which == index { Interval::point(1.0) } else { ZERO };
                    }
                    ranges[index]
                }
                Operation::Sine(index) | Operation::Cosine(index) => {
                    let sine = matches!(operation, Operation::Sine(_));
                    let angle = &code.angles[index].1;
                    let (value, _) = angle.turned(sine, ranges)?;
                    let across = angle.turned(!sine, ranges)?.0.negated(!sine);
                    for (variable, factor) in angle.factors() {
                        if let Some(at) = varied.iter().position(|v| *v == variable) {
                            let part = across.times(Interval::point(factor)).widened(0.0);
                            slopes[at] = slopes[at].plus(part).widened(0.0);
                        }
                    }
                    value
                }
                Operation::Add(a, b, negative) => {
                    for ((slope, x), y) in slopes.iter_mut().zip(of(a)).zip(of(b)) {
                        *slope = sum(*x, y.negated(negative));
                    }
                    values[a].plus(values[b].negated(negative)).widened(0.0)
                }
                Operation::Mul(a, b) => {
                    let (u, v) = (values[a], values[b]);
                    for ((slope, x), y) in slopes.iter_mut().zip(of(a)).zip(of(b)) {
                        *slope = sum(product(*x, v), product(*y, u));
                    }
                    u.times(v).widened(0.0)
                }
                Operation::Div(..) => return None,
            };
            self.values.push(value);
        }
        Some(())
    }
}

/// Most derivatives are zero.
#[inline]
fn is_zero(x: Interval) -> bool {
    x.low == 0.0 && x.high == 0.0
}

#[inline]
fn product(slope: Interval, by: Interval) -> Interval {
    if is_zero(slope) { ZERO } else { slope.times(by).widened(0.0) }
}

#[inline]
fn sum(a: Interval, b: Interval) -> Interval {
    match (is_zero(a), is_zero(b)) {
        (_, true) => a,
        (true, _) => b,
        _ => a.plus(b).widened(0.0),
    }
}
