//! The largest bound over all states: the box of states is split where the bound is largest, until it is
//! small enough or the effort is spent.

use super::interval::Interval;
use super::program::{Errors, Program, Workspace};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A part of the states with its bound.
struct Part {
    errors: Errors,
    ranges: Vec<Interval>,
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        self.errors[0].total_cmp(&other.errors[0])
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

/// Bounds for every state of a box, from at most `evaluations` bounds of parts of it; `splits` says which
/// variables are worth it.
pub(super) fn bound(program: &Program, all: &[Interval], splits: &[bool], evaluations: usize) -> Errors {
    let mut workspace = Workspace::default();
    let mut of = |ranges: Vec<Interval>| Part { errors: program.errors(&ranges, &mut workspace), ranges };
    let whole = of(all.to_vec());
    let mut gains = Gains::new(&whole, splits);
    // A first guess pays where many splits follow.
    let slices = splits.iter().filter(|s| **s).count() << HALVINGS;
    let tried = if evaluations > 4 * slices { slices } else { 0 };
    if tried > 0 {
        gains.guess(&whole, &mut of);
    }
    let mut parts = BinaryHeap::from([whole]);
    for _ in 0..(evaluations - tried) / 2 {
        let Some(worst) = parts.pop() else { break };
        let Some(which) = gains.best(&worst) else {
            parts.push(worst);
            break;
        };
        let halves = worst.ranges[which].halves().map(|half| {
            let mut ranges = worst.ranges.clone();
            ranges[which] = half;
            of(ranges)
        });
        gains.learn(&worst, which, &halves);
        parts.extend(halves);
    }
    parts
        .iter()
        .fold([0.0; 2], |most: Errors, part| [most[0].max(part.errors[0]), most[1].max(part.errors[1])])
}

/// What splitting each variable has gained so far: pseudo-costs, as in branch and bound for integer programs.
struct Gains {
    /// Of halving the whole range of a variable; `None` where it is never split.
    gains: Vec<Option<f64>>,
    widths: Vec<f64>,
}

impl Gains {
    fn new(whole: &Part, splits: &[bool]) -> Gains {
        let widths: Vec<f64> = whole.ranges.iter().map(|r| r.width()).collect();
        let gain = |(split, width): (&bool, &f64)| (*split && *width > 0.0).then_some(LEAST);
        Gains { gains: splits.iter().zip(&widths).map(gain).collect(), widths }
    }

    /// From slices of the whole, each narrow in one variable.
    fn guess(&mut self, whole: &Part, of: &mut impl FnMut(Vec<Interval>) -> Part) {
        for (which, gain) in self.gains.iter_mut().enumerate() {
            let Some(gain) = gain else { continue };
            let mut slices = vec![whole.ranges[which]];
            for _ in 0..HALVINGS {
                slices = slices.iter().flat_map(|slice| slice.halves()).collect();
            }
            let errors = slices.into_iter().map(|slice| {
                let mut ranges = whole.ranges.clone();
                ranges[which] = slice;
                of(ranges).errors[0]
            });
            *gain = gained(whole.errors[0], errors.fold(0.0, f64::max)) / f64::from(HALVINGS);
        }
    }

    /// The variable whose halving promises most; where nothing is known, the widest.
    fn best(&self, part: &Part) -> Option<usize> {
        let promise = |which: usize| {
            let share = part.ranges[which].width() / self.widths[which];
            self.gains[which]
                .map(|gain| share * if part.errors[0].is_finite() { gain.max(LEAST) } else { 1.0 })
        };
        let all = (0..part.ranges.len()).filter_map(|which| Some((which, promise(which)?)));
        all.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(which, _)| which)
    }

    fn learn(&mut self, part: &Part, which: usize, halves: &[Part; 2]) {
        if !part.errors[0].is_finite() {
            return;
        }
        let share = part.ranges[which].width() / self.widths[which];
        let gain = gained(part.errors[0], halves[0].errors[0].max(halves[1].errors[0])) / share;
        if let Some(known) = &mut self.gains[which] {
            *known += LEARNING * (gain - *known);
        }
    }
}

/// By which share a bound is less than before.
fn gained(before: f64, after: f64) -> f64 {
    if before.is_finite() && before > 0.0 { 1.0 - after / before } else { 0.0 }
}

/// Of a variable's range for the first guess.
const HALVINGS: u32 = 2;

/// The share of the last split in what is known of a variable.
const LEARNING: f64 = 0.2;

/// So that no variable is given up for what its first splits showed.
const LEAST: f64 = 1e-3;
