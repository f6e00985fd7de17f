//! B = LᵀDL and its inverse for every pose within the limits: B is proven positive definite there.
//!
//! Over a box of poses with centre c, K = D_c^(−½)·L_c⁻ᵀ makes B_c the identity, so K·B·Kᵀ = 1 + E with a
//! small E. Where the spectral radius of |E| is below 1, B is positive definite, and the inverse and the
//! factors of 1 + E are 1 within N = |E| + |E|² + …, entry by entry; the products with those of B_c are B⁻¹,
//! L and D of every pose of the box. Boxes are halved until the radius is small enough. It is at most the
//! largest (|E|·w)ᵢ/wᵢ for any w > 0 (Collatz); a few steps of the power method give a good w.
//!
//! Positive definite matrices of an interval by a congruence: Rump, "Verification methods" (2010), §10; Rohn,
//! "Positive definiteness and stability of interval matrices" (1994).

use super::gradient::Gradient;
use super::interval::Interval;
use super::limits::Limits;
use super::program::Emitted;
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::graph::Expr;
use crate::model::Model;

/// Ranges over all poses, row-major n × n.
#[derive(Clone, Debug)]
pub(super) struct Factors {
    pub(super) n: usize,
    /// B⁻¹
    pub(super) inverse: Vec<Interval>,
    /// L, unit lower triangular.
    pub(super) lower: Vec<Interval>,
    /// L⁻¹
    pub(super) lower_inverse: Vec<Interval>,
    /// D
    pub(super) pivots: Vec<Interval>,
    /// The largest entries of B's diagonal, where the ranges are those of [`Factors::of_energy`].
    pub(super) diagonal: Option<Vec<f64>>,
}

/// B of an arm, or its Jacobian, over boxes of poses.
pub(super) struct PosedMatrix {
    code: Emitted,
    /// Of each entry its operation and sign; `None` where it is zero.
    entries: Vec<Option<(usize, bool)>>,
    n: usize,
    /// The ranges of all variables.
    ranges: Vec<Interval>,
    /// The places of those that are positions.
    varied: Vec<usize>,
}

impl PosedMatrix {
    /// The outputs of a function's graph, as a matrix; `None` where a limit or a value is missing.
    pub(super) fn new(model: &Model, built: &FunctionGraph, limits: &Limits<'_>) -> Option<Self> {
        let n = built.joints;
        let nonzero: Vec<_> = built.outputs.iter().copied().filter(|e| *e != Expr::ZERO).collect();
        let code = Emitted::new(model, built, &nonzero)?;
        let place = |e: &Expr| {
            let found = code.nodes.iter().position(|node| *node == e.node())?;
            Some((found, e.is_negative()))
        };
        let entries = built.outputs.iter().map(place).collect();
        let ranges: Option<Vec<Interval>> = code.variables.iter().map(|v| limits.range(*v)).collect();
        let is_position = |k: &usize| code.variables[*k].0 == Argument::Positions;
        let varied = (0..code.variables.len()).filter(is_position).collect();
        Some(PosedMatrix { entries, n, ranges: ranges?, varied, code })
    }

    /// Halves boxes of poses until e is below `most` in each of them; `None` where that takes more than
    /// `boxes`.
    pub(super) fn factors(&self, most: f64, boxes: usize) -> Option<Factors> {
        let mut found = Factors::none(self.n);
        // Each with its share of all poses.
        let mut stack = vec![(self.ranges.clone(), 1.0)];
        let mut gradients = [Gradient::default(), Gradient::default()];
        let (mut count, mut proven) = (0, 0.0);
        while let Some((ranges, share)) = stack.pop() {
            count += 1;
            let hopeless = count == boxes / 10 && proven < HOPELESS;
            if count > boxes || hopeless {
                return None;
            }
            let Deviation { k, e, weights, widest } = self.deviation(&ranges, &mut gradients)?;
            if radius(&e, &weights) <= most {
                found.include(&k, &series(&e, &weights, most));
                proven += share;
                continue;
            }
            let widest = widest?;
            stack.extend(ranges[widest].halves().map(|half| {
                let mut ranges = ranges.clone();
                ranges[widest] = half;
                (ranges, 0.5 * share)
            }));
        }
        Some(found)
    }

    /// At least the largest entries of the diagonal; `None` where an angle is too large.
    pub(super) fn largest_diagonal(&self) -> Option<Vec<f64>> {
        (0..self.n).map(|i| self.largest(self.entries[i * self.n + i]?)).collect()
    }

    /// At least the largest sizes of all entries; `None` where an angle is too large.
    pub(super) fn largest_sizes(&self) -> Option<Vec<f64>> {
        let size = |entry: &Option<(usize, bool)>| {
            let Some((place, negative)) = *entry else { return Some(0.0) };
            Some(self.largest((place, negative))?.max(self.largest((place, !negative))?))
        };
        self.entries.iter().map(size).collect()
    }

    /// At least the largest value of an entry: poses are halved where its bound is largest.
    fn largest(&self, (place, negative): (usize, bool)) -> Option<f64> {
        let mut gradient = Gradient::default();
        let m = self.varied.len();
        // The bound over a box, and the variable that adds most to it.
        let mut bound = |ranges: &[Interval]| -> Option<(f64, Option<usize>)> {
            gradient.evaluate(&self.code, ranges, &self.varied)?;
            let slope = |which: usize| gradient.slopes[place * m + which].magnitude();
            let adds = |which: &usize| ranges[self.varied[*which]].width() * slope(*which);
            let widest = (0..m).max_by(|a, b| adds(a).total_cmp(&adds(b))).filter(|w| adds(w) > 0.0);
            let value = gradient.values[place].negated(negative).high;
            Some((value, widest.map(|which| self.varied[which])))
        };
        let mut parts = vec![(bound(&self.ranges)?, self.ranges.clone())];
        for _ in 0..HALVINGS {
            let worst = (0..parts.len()).max_by(|a, b| parts[*a].0.0.total_cmp(&parts[*b].0.0))?;
            let (_, Some(widest)) = parts[worst].0 else { break };
            let (_, ranges) = parts.swap_remove(worst);
            for half in ranges[widest].halves() {
                let mut ranges = ranges.clone();
                ranges[widest] = half;
                parts.push((bound(&ranges)?, ranges));
            }
        }
        Some(parts.iter().map(|((value, _), _)| *value).fold(f64::NEG_INFINITY, f64::max))
    }

    /// By how much the rounding of given parameters to either format moves each entry at most, row-major.
    pub(super) fn moved_by_parameters(&self) -> Option<Vec<f64>> {
        let mut gradient = Gradient::default();
        let given: Vec<usize> = (0..self.code.variables.len())
            .filter(|k| self.code.variables[*k].0 == Argument::Parameters)
            .collect();
        gradient.evaluate(&self.code, &self.ranges, &given)?;
        let entry = |entry: &Option<(usize, bool)>| {
            let Some((place, _)) = entry else { return 0.0 };
            let slopes = &gradient.slopes[place * given.len()..(place + 1) * given.len()];
            let moved = slopes.iter().zip(&given).map(|(x, k)| x.magnitude() * 0.5 * self.ranges[*k].width());
            moved.sum::<f64>() * (1.0 + 1e-12)
        };
        Some(self.entries.iter().map(entry).collect())
    }

    /// How far B is from that of the centre over a box; `None` where B of the centre is not positive.
    fn deviation(&self, ranges: &[Interval], gradients: &mut [Gradient; 2]) -> Option<Deviation> {
        let n = self.n;
        let [centre, whole] = gradients;
        let mut at = ranges.to_vec();
        for k in &self.varied {
            at[*k] = Interval::point(ranges[*k].middle());
        }
        centre.evaluate(&self.code, &at, &[])?;
        whole.evaluate(&self.code, ranges, &self.varied)?;
        let of = |values: &dyn Fn(usize) -> Interval| -> Vec<Interval> {
            let entry = |e: &Option<(usize, bool)>| match e {
                Some((place, negative)) => values(*place).negated(*negative),
                None => Interval::point(0.0),
            };
            self.entries.iter().map(entry).collect()
        };
        let b = of(&|place| centre.values[place]);
        let k = congruence(&b.iter().map(|x| x.middle()).collect::<Vec<_>>(), n)?;
        let mut e = sizes(&k, &b, n, true);
        let m = self.varied.len();
        let mut parts = Vec::with_capacity(m);
        for (which, place) in self.varied.iter().enumerate() {
            let slope = of(&|entry| whole.slopes[entry * m + which]);
            let width = 0.5 * ranges[*place].width() * (1.0 + 1e-12);
            let part: Vec<f64> = sizes(&k, &slope, n, false).iter().map(|x| x * width).collect();
            e.iter_mut().zip(&part).for_each(|(all, x)| *all += x);
            parts.push(part);
        }
        e.iter_mut().for_each(|x| *x *= 1.0 + 1e-12);
        let weights = weights(&e, n);
        let adds = |part: &[f64]| {
            let row = |(row, w): (&[f64], &f64)| w * dot(row, &weights);
            part.chunks(n).zip(&weights).map(row).sum::<f64>()
        };
        let adds: Vec<f64> = parts.iter().map(|part| adds(part)).collect();
        let widest = (0..m).max_by(|a, b| adds[*a].total_cmp(&adds[*b])).map(|which| self.varied[which]);
        e.iter().all(|x| x.is_finite()).then_some(Deviation { k, e, weights, widest })
    }
}

/// B of a box as that of its centre.
struct Deviation {
    /// K, upper triangular.
    k: Vec<f64>,
    /// At most |E|.
    e: Vec<f64>,
    /// Positive weights w for which |E|·w is small.
    weights: Vec<f64>,
    /// The variable that adds most to E; none where B is the same at every pose.
    widest: Option<usize>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Nearly the eigenvector of the largest eigenvalue of a symmetric matrix whose entries are not negative.
fn weights(e: &[f64], n: usize) -> Vec<f64> {
    let mut weights = vec![1.0; n];
    for _ in 0..STEPS {
        let next: Vec<f64> = e.chunks(n).map(|row| dot(row, &weights)).collect();
        let most = next.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        // Half of the last one, so that no weight is zero and two that alternate settle.
        weights.iter_mut().zip(&next).for_each(|(w, x)| *w = 0.5 * (*w + x / most));
    }
    weights
}

/// Of the power method.
const STEPS: usize = 8;

/// At least the spectral radius of a matrix whose entries are not negative.
fn radius(e: &[f64], weights: &[f64]) -> f64 {
    let row = |(row, w): (&[f64], &f64)| dot(row, weights) / w * (1.0 + 1e-12);
    e.chunks(weights.len()).zip(weights).map(row).fold(0.0, f64::max)
}

/// N = |E| + |E|² + … for a symmetric |E| with |E|·w ≤ `most`·w.
fn series(e: &[f64], weights: &[f64], most: f64) -> Vec<f64> {
    let n = weights.len();
    let mut sum = e.to_vec();
    let mut power = e.to_vec();
    for _ in 0..TERMS {
        let entry = |at: usize| (0..n).map(|c| power[at / n * n + c] * e[c * n + at % n]).sum();
        power = (0..n * n).map(entry).collect();
        sum.iter_mut().zip(&power).for_each(|(all, x)| *all += x);
    }
    // |E|ᵐ·w ≤ mostᵐ·w bounds each entry of what is left out, and its mirror.
    let rest = most.powi(TERMS + 2) / (1.0 - most);
    let entry = |at: usize| {
        let (a, b) = (weights[at / n], weights[at % n]);
        (sum[at] + rest * a.min(b) / a.max(b)) * (1.0 + 1e-12)
    };
    (0..n * n).map(entry).collect()
}

/// Of the series that are summed up in addition to the first.
const TERMS: i32 = 6;

/// K with K·B·Kᵀ = 1 but for what is rounded, upper triangular.
fn congruence(b: &[f64], n: usize) -> Option<Vec<f64>> {
    let (mut lower, mut scaled, mut pivots) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n]);
    for i in (0..n).rev() {
        let eliminated = |j: usize, lower: &[f64], scaled: &[f64]| -> f64 {
            b[i * n + j] - (i + 1..n).map(|k| lower[k * n + i] * scaled[k * n + j]).sum::<f64>()
        };
        pivots[i] = eliminated(i, &lower, &scaled);
        if pivots[i].is_nan() || pivots[i] <= 0.0 {
            return None;
        }
        lower[i * n + i] = 1.0;
        for j in 0..i {
            scaled[i * n + j] = eliminated(j, &lower, &scaled);
            lower[i * n + j] = scaled[i * n + j] / pivots[i];
        }
    }
    // K = D^(−½)·L⁻ᵀ: row i of it is column i of L⁻¹ over √d.
    let mut k = vec![0.0; n * n];
    for i in 0..n {
        k[i * n + i] = 1.0;
        for row in i + 1..n {
            k[i * n + row] = -(i..row).map(|c| lower[row * n + c] * k[i * n + c]).sum::<f64>();
        }
        let root = pivots[i].sqrt();
        k[i * n..(i + 1) * n].iter_mut().for_each(|x| *x /= root);
    }
    Some(k)
}

/// At most the sizes of the entries of K·A·Kᵀ, or of K·A·Kᵀ − 1, for all symmetric A of intervals.
fn sizes(k: &[f64], a: &[Interval], n: usize, less_one: bool) -> Vec<f64> {
    let middle: Vec<f64> = a.iter().map(|x| x.middle()).collect();
    // What the products round is 2(n + 1) halves of an epsilon of the products of sizes.
    let rounds = 4.0 * n as f64 * f64::EPSILON;
    let radius: Vec<f64> = (a.iter().zip(&middle))
        .map(|(x, m)| 0.5 * x.width() * (1.0 + 1e-12) + rounds * m.abs() + f64::MIN_POSITIVE)
        .collect();
    let absolute: Vec<f64> = k.iter().map(|x| x.abs()).collect();
    let (exact, wide) = (congruent(k, &middle, n), congruent(&absolute, &radius, n));
    (0..n * n)
        .map(|at| {
            let one = if less_one && at / n == at % n { 1.0 } else { 0.0 };
            (exact[at] - one).abs() + wide[at] * (1.0 + 1e-12)
        })
        .collect()
}

/// K·A·Kᵀ for an upper triangular K and a symmetric A.
fn congruent(k: &[f64], a: &[f64], n: usize) -> Vec<f64> {
    let mut half = vec![0.0; n * n];
    for i in 0..n {
        for c in i..n {
            let factor = k[i * n + c];
            for j in 0..n {
                half[i * n + j] += factor * a[c * n + j];
            }
        }
    }
    let mut result = vec![0.0; n * n];
    for i in 0..n {
        for j in i..n {
            let sum: f64 = (j..n).map(|c| half[i * n + c] * k[j * n + c]).sum();
            result[i * n + j] = sum;
            result[j * n + i] = sum;
        }
    }
    result
}

impl Factors {
    fn none(n: usize) -> Factors {
        let nothing = Interval { low: f64::INFINITY, high: f64::NEG_INFINITY };
        let matrix = || vec![nothing; n * n];
        let (inverse, lower, lower_inverse) = (matrix(), matrix(), matrix());
        Factors { n, inverse, lower, lower_inverse, pivots: vec![nothing; n], diagonal: None }
    }

    /// The ranges that follow from pivots of at least `least`, from bᵢ = `mobility` ≥ (B⁻¹)ᵢᵢ and from `most`
    /// ≥ Bᵢᵢ; `None` where one of these is not positive and finite.
    ///
    /// By the inequality of Cauchy and Schwarz |(B⁻¹)ᵢⱼ|² ≤ bᵢbⱼ and |Lₖⱼ|² ≤ Bⱼⱼ/dₖ. Column k of L⁻¹ is how
    /// joints without torque move if joint k does with 1: twice the energy is dₖ, so |L⁻¹ⱼₖ|² ≤ bⱼdₖ.
    pub(super) fn of_energy(least: &[f64], mobility: &[f64], most: &[f64]) -> Option<Factors> {
        let is_size = |x: &f64| x.is_finite() && *x > 0.0;
        if ![least, mobility, most].iter().all(|all| all.iter().all(is_size)) {
            return None;
        }
        let n = most.len();
        let root = |x: f64| Interval::within(x.sqrt() * ROUNDED);
        let mut found = Factors {
            pivots: (0..n).map(|i| Interval { low: least[i] / ROUNDED, high: most[i] * ROUNDED }).collect(),
            diagonal: Some(most.iter().map(|x| x * ROUNDED).collect()),
            ..Factors::none(n)
        };
        for i in 0..n {
            for j in 0..n {
                let at = i * n + j;
                let zero_above = |x: f64| root(if j < i { x } else { 0.0 });
                found.inverse[at] = root(mobility[i] * mobility[j]);
                found.lower[at] = zero_above(most[j] / least[i]);
                found.lower_inverse[at] = zero_above(mobility[i] * most[j]);
            }
            let at = i * n + i;
            found.inverse[at].low = 1.0 / (most[i] * ROUNDED);
            (found.lower[at], found.lower_inverse[at]) = (Interval::point(1.0), Interval::point(1.0));
        }
        Some(found)
    }

    /// At least the entries of the diagonal of B⁻¹.
    pub(super) fn mobility(&self) -> Vec<f64> {
        (0..self.n).map(|i| self.inverse[i * self.n + i].high).collect()
    }

    /// Widens the ranges by those of a box of poses with the factors of 1 + E within `off` of 1.
    fn include(&mut self, k: &[f64], off: &[f64]) {
        let n = self.n;
        let point = Interval::point;
        // √d and its inverse, and L⁻¹ of the centre: exactly those that K is made of.
        let of_root: Vec<Interval> = (0..n).map(|i| point(k[i * n + i])).collect();
        let root: Vec<Interval> = of_root.iter().map(|x| x.inverse().unwrap_or(*x).widened(0.0)).collect();
        let mut inverse = vec![point(0.0); n * n];
        for i in 0..n {
            for j in 0..i {
                inverse[i * n + j] = times(point(k[j * n + i]), root[j]);
            }
            inverse[i * n + i] = point(1.0);
        }
        let lower = inverted(&inverse, n);
        for i in 0..n {
            let one = Interval::within(off[i * n + i]).plus(point(1.0)).widened(0.0);
            hull(&mut self.pivots[i], times(times(root[i], root[i]), one));
            for j in 0..n {
                hull(&mut self.inverse[i * n + j], inverse_entry(k, off, n, (i, j)));
            }
            for j in 0..=i {
                // L = D_c^(−½)·M·D_c^(½)·L_c, and its inverse the other way round, with M within `off` of 1.
                let (mut l, mut of) = (lower[i * n + j], inverse[i * n + j]);
                for c in j..i {
                    let factor = times(times(of_root[i], root[c]), Interval::within(off[i * n + c]));
                    l = l.plus(times(factor, lower[c * n + j])).widened(0.0);
                    let r = c + 1;
                    let factor = times(times(of_root[r], root[j]), Interval::within(off[r * n + j]));
                    of = of.plus(times(inverse[i * n + r], factor)).widened(0.0);
                }
                hull(&mut self.lower[i * n + j], l);
                hull(&mut self.lower_inverse[i * n + j], of);
            }
        }
    }
}

/// An entry of B⁻¹ = Kᵀ·(1 + E)⁻¹·K.
fn inverse_entry(k: &[f64], off: &[f64], n: usize, (i, j): (usize, usize)) -> Interval {
    let mut sum = Interval::point(0.0);
    for a in 0..=i {
        for b in 0..=j {
            let one = Interval::point(if a == b { 1.0 } else { 0.0 });
            let middle = one.plus(Interval::within(off[a * n + b])).widened(0.0);
            let product = times(times(Interval::point(k[a * n + i]), Interval::point(k[b * n + j])), middle);
            sum = sum.plus(product).widened(0.0);
        }
    }
    sum
}

/// The inverse of a unit lower triangular matrix.
fn inverted(lower: &[Interval], n: usize) -> Vec<Interval> {
    let mut inverse = vec![Interval::point(0.0); n * n];
    for j in 0..n {
        inverse[j * n + j] = Interval::point(1.0);
        for i in j + 1..n {
            let add =
                |sum: Interval, c: usize| sum.plus(times(lower[i * n + c], inverse[c * n + j])).widened(0.0);
            inverse[i * n + j] = (j..i).fold(Interval::point(0.0), add).negated(true);
        }
    }
    inverse
}

fn times(a: Interval, b: Interval) -> Interval {
    a.times(b).widened(0.0)
}

/// Halvings of the poses for the largest value of an entry.
const HALVINGS: usize = 400;

/// More than what these sums and products of doubles round.
pub(super) const ROUNDED: f64 = 1.0 + 1e-9;

/// The share of the poses that the tenth part of the boxes must prove.
const HOPELESS: f64 = 0.01;

fn hull(all: &mut Interval, more: Interval) {
    all.low = all.low.min(more.low);
    all.high = all.high.max(more.high);
}
