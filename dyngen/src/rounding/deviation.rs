//! Bounds of functions that divide by pivots of B or of Λ⁻¹: exact values and what the emitted ones are off
//! by, kept apart.
//!
//! What is known of a solve (`known.rs`) holds for exact values alone. So each operation has the range of its
//! exact value and, forwards from its operands, how far the emitted one may be off (running error analysis,
//! Higham 2002, §3.3). The derivatives by each rounding are operations like the others: at every t·δ they are
//! within the same two.

use super::energy::{SoFar, Solves};
use super::interval::Interval;
use super::known::{Known, KnownProgram};
use super::precision::PRECISIONS;
use super::program::{EXACT, Errors, Operation, Program, TINY, Workspace};

impl Program {
    /// As [`Program::errors`]; `None` where there is no bound.
    pub(super) fn errors_from_exact(
        &self,
        KnownProgram { known, solves }: &KnownProgram,
        ranges: &[Interval],
        workspace: &mut Workspace,
    ) -> Option<Errors> {
        let Workspace { values, errors, deviations } = workspace;
        values.clear();
        errors.clear();
        deviations.clear();
        let mut running: Vec<_> = solves.iter().map(Solves::start).collect();
        for (k, operation) in self.operations.iter().enumerate() {
            let (value, from_operands) = self.exact(*operation, ranges, values, deviations)?;
            let error = |value: Interval| match *operation {
                _ if self.rounds_nothing(k) => Some(EXACT),
                Operation::Constant(_, errors) => Some(errors),
                Operation::Variable(_) => Some(EXACT),
                Operation::Sine(index) => Some(self.angles[index].1.turned(true, ranges)?.1),
                Operation::Cosine(index) => Some(self.angles[index].1.turned(false, ranges)?.1),
                Operation::Mul(a, b) if self.is_power_of_two(a) || self.is_power_of_two(b) => Some(TINY),
                _ => Some(rounds(value, from_operands)),
            };
            errors.push(error(value)?);
            let mut value = value.widened(0.0);
            if let Some(norm) = &self.norms[k] {
                value = value.clamped(norm.bound(values, errors));
            }
            value = match &known[k] {
                None => value,
                Some(Known::Range(range)) => value.within_range(*range),
                Some(Known::Sum(terms)) => {
                    let most: f64 = terms.iter().map(|(factor, r)| factor * values[*r].magnitude()).sum();
                    value.clamped(most * (1.0 + 1e-12))
                }
            };
            // What is known of the exact value bounds what it rounds as well.
            errors[k] = error(value)?;
            let error = errors[k];
            let deviation = [0, 1].map(|p| no_number_is_infinite((from_operands[p] + error[p]) * GROWN));
            if value.magnitude().is_nan() {
                return None;
            }
            values.push(value);
            deviations.push(deviation);
            for (solves, running) in solves.iter().zip(&mut running).filter(|_| k < self.emitted) {
                let so_far = SoFar { operations: &self.operations, values, deviations, errors };
                (values[k], deviations[k]) = solves.take(running, so_far);
            }
            // The ranges hold for none of these states: Λ is too large at all of these poses, or no body has
            // such a payload.
            if values[k].low > values[k].high {
                return self.restricted.then_some(EXACT);
            }
            if values[k].magnitude() + deviations[k][0] >= f64::from(f32::MAX) {
                deviations[k][0] = f64::INFINITY;
            }
        }
        let mut total = [0.0; 2];
        for (slope, error) in self.slopes.iter().zip(&*errors) {
            if let Some(slope) = slope {
                for (p, total) in total.iter_mut().enumerate() {
                    *total += (values[*slope].magnitude() + deviations[*slope][p]) * error[p];
                }
            }
        }
        // Of two bounds the smaller; a sum of n terms rounds n times.
        let grown = 1.0 + self.len() as f64 * f64::EPSILON;
        let forwards = deviations[self.emitted - 1];
        Some([0, 1].map(|p| no_number_is_infinite((total[p] * grown).min(forwards[p]))))
    }

    /// The exact value, its ends rounded, and by how much the emitted operands move the result.
    fn exact(
        &self,
        operation: Operation,
        ranges: &[Interval],
        values: &[Interval],
        deviations: &[Errors],
    ) -> Option<(Interval, Errors)> {
        let size = |a: usize| values[a].magnitude();
        Some(match operation {
            Operation::Constant(value, errors) => (value.widened(errors[1]), EXACT),
            Operation::Variable(index) => (ranges[index], EXACT),
            Operation::Sine(index) => (self.angles[index].1.turned(true, ranges)?.0, EXACT),
            Operation::Cosine(index) => (self.angles[index].1.turned(false, ranges)?.0, EXACT),
            Operation::Add(a, b, negative) => {
                let moved = [0, 1].map(|p| deviations[a][p] + deviations[b][p]);
                (values[a].plus(values[b].negated(negative)), moved)
            }
            Operation::Mul(a, b) => {
                let moved = |p: usize| {
                    let (x, y) = (deviations[a][p], deviations[b][p]);
                    size(a) * y + size(b) * x + x * y
                };
                (values[a].times(values[b]), [moved(0), moved(1)])
            }
            Operation::Div(a, b) => {
                let value = values[a].times(values[b].inverse()?.widened(0.0));
                let least = values[b].low.abs().min(values[b].high.abs());
                let moved = |p: usize| {
                    let apart = least - deviations[b][p];
                    let moved = deviations[a][p] + value.magnitude() * GROWN * deviations[b][p];
                    if apart > 0.0 { moved / apart } else { f64::INFINITY }
                };
                (value, [moved(0), moved(1)])
            }
        })
    }
}

/// Nothing is known of ∞·0 either.
fn no_number_is_infinite(x: f64) -> f64 {
    if x.is_nan() { f64::INFINITY } else { x }
}

/// What an operation rounds whose operands are off.
fn rounds(value: Interval, moved: Errors) -> Errors {
    [0, 1].map(|p| PRECISIONS[p].half_ulp((value.magnitude() + moved[p]) * GROWN))
}

/// For bounds of a few roundings of doubles.
const GROWN: f64 = 1.0 + 1e-12;
