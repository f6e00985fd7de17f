//! What is known of the numbers between B, or Λ⁻¹, and the results of a solve with LᵀDL: bounds for every
//! pose.
//!
//! The optimiser is free to reorder sums, so an operation is recognised by its value: at a random point of
//! the 61-bit prime field it equals that of an entry of L, of B⁻¹, … (two that differ agree there with a
//! chance below 2⁻⁵⁴, as in `prove/`). The same holds for derivatives of the result by each of the
//! operations.

use super::energy::{Exact, Solves};
use super::factors::Factors;
use super::interval::Interval;
use super::program::Operation;
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::prime::{Draws, Fp};
use crate::model::Model;
use crate::parameters::SetKind;
use crate::prove::{self, Point};
use rustc_hash::FxHashMap;
use std::rc::Rc;

/// A bound of an operation's exact value.
#[derive(Clone, Debug)]
pub(super) enum Known {
    /// The value lies in this interval.
    Range(Interval),
    /// The value's size is at most the sum of factors times the sizes of other operations.
    Sum(Vec<(f64, usize)>),
}

/// What is known of a number, by its value at the random point.
#[derive(Clone, Debug)]
enum Fact {
    Range(Interval),
    /// A sum over a right-hand side's entries.
    Sum(Rc<[Fp]>, Vec<f64>),
}

/// What is known of a program.
#[derive(Clone, Debug)]
pub(super) struct KnownProgram {
    /// By operation.
    pub(super) known: Vec<Option<Known>>,
    /// Factorisations whose ranges are those of [`Factors::of_energy`], in the order of the program.
    pub(super) solves: Vec<Solves>,
}

/// All facts about a function, with the values of its operations.
pub(super) struct Facts<'a> {
    facts: FxHashMap<u64, Fact>,
    nodes: Vec<Option<Fp>>,
    /// Factorisations with their ranges, in the order of the program.
    solves: Vec<(Exact, &'a Factors)>,
}

/// LᵀDL at the random point, and the ranges of its entries.
struct Solve<'a> {
    n: usize,
    ranges: &'a Factors,
    b: Vec<Fp>,
    lower: Vec<Fp>,
    lower_inverse: Vec<Fp>,
    inverse: Vec<Fp>,
    pivots: Vec<Fp>,
}

/// A row-major matrix at the random point, and the ranges of its entries.
struct Ranged {
    columns: usize,
    entries: Vec<(Fp, Interval)>,
}

impl Ranged {
    fn at(&self, i: usize, j: usize) -> (Fp, Interval) {
        self.entries[i * self.columns + j]
    }

    fn transposed(&self) -> Ranged {
        let rows = self.entries.len() / self.columns;
        let entries = (0..self.entries.len()).map(|k| self.at(k % rows, k / rows)).collect();
        Ranged { columns: rows, entries }
    }
}

impl<'a> Facts<'a> {
    /// Facts from the ranges for B, and from those for Λ⁻¹ where the function divides by its pivots too.
    /// `None` where the point is none of the function's, which chance excludes.
    pub(super) fn new(
        model: &Model,
        built: &FunctionGraph,
        ranges: &'a Factors,
        task: Option<&'a Factors>,
    ) -> Option<Facts<'a>> {
        let set = model.set(SetKind::Minimal).ok()?;
        let mut draws = Draws::new(0x0073_6f6c_7665);
        let point = Point::draw(model.arm(), model.symbols(), model.sets(), &mut draws);
        let point = point.seen_by(built.function);
        let expected = |function| prove::expected(&point, set, function);
        let solve = Solve::new(expected(Function::MassMatrix), ranges)?;
        let n = solve.n;
        let mut facts =
            Facts { facts: FxHashMap::default(), nodes: point.nodes(set, built)?, solves: Vec::new() };
        facts.of_factors(&solve);
        facts.of_eliminated(&solve);
        let solutions = match built.function {
            Function::MassMatrixInverse => columns(&solve.inverse, n),
            Function::ForwardDynamics | Function::ForwardDynamicsWithPayload => {
                vec![expected(Function::ForwardDynamics)]
            }
            Function::AccelerationByPosition | Function::AccelerationByVelocity => {
                let derivatives = columns(&expected(built.function), n);
                std::iter::once(expected(Function::ForwardDynamics)).chain(derivatives).collect()
            }
            _ => expected(Function::Jacobian).chunks(n).map(|row| product(&solve.inverse, row)).collect(),
        };
        if built.function == Function::MassMatrixInverse {
            facts.of_products(&solve.inverse(), &solve.inverse());
        } else {
            solutions.iter().for_each(|x| facts.of_solution(&solve, x));
        }
        facts.solves.push((solve.exact(solutions), ranges));
        if let Some(ranges) = task {
            let task = Solve::new(expected(Function::TaskInertiaInverse), ranges)?;
            facts.of_task(&solve, &task, expected(Function::ConsistentInverse));
            facts.solves.push((task.exact(columns(&task.inverse, task.n)), ranges));
        }
        Some(facts)
    }

    fn add(&mut self, value: Fp, fact: Fact) {
        if value != Fp::ZERO {
            self.facts.entry(value.residue()).or_insert(fact);
        }
    }

    fn range(&mut self, value: Fp, range: Interval) {
        self.add(value, Fact::Range(range));
    }

    /// Entries of L, D, their inverses and B⁻¹.
    fn of_factors(&mut self, solve: &Solve<'_>) {
        let Solve { n, ranges, .. } = solve;
        for i in 0..*n {
            let d = ranges.pivots[i];
            let inverse = d.inverse().unwrap_or(Interval::within(f64::INFINITY)).widened(0.0);
            let of_pivot = solve.pivots[i].inverse().unwrap_or(Fp::ZERO);
            self.range(solve.pivots[i], d);
            self.range(of_pivot, inverse);
            for j in 0..*n {
                let at = i * n + j;
                self.range(solve.inverse[at], ranges.inverse[at]);
                if j < i {
                    let (l, of) = (ranges.lower[at], ranges.lower_inverse[at]);
                    self.range(solve.lower[at], l);
                    self.range(solve.lower[at] * solve.pivots[i], l.times(d).widened(0.0));
                    self.range(solve.lower_inverse[at], of);
                    let of_pivot = solve.pivots[j].inverse().unwrap_or(Fp::ZERO);
                    let inverse = ranges.pivots[j].inverse().unwrap_or(Interval::within(f64::INFINITY));
                    self.range(solve.lower_inverse[at] * of_pivot, of.times(inverse).widened(0.0));
                }
            }
        }
    }

    /// Entries of B, and what is subtracted from them and left of them on the way to L and D, where B's
    /// diagonal has a bound: what is left is positive definite, and each Lₖᵢ·dₖ·Lₖⱼ is an entry of a positive
    /// semidefinite matrix, both at most B.
    fn of_eliminated(&mut self, solve: &Solve<'_>) {
        let (n, ranges) = (solve.n, solve.ranges);
        let Some(diagonal) = &ranges.diagonal else { return };
        for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            let range = Interval::within((diagonal[i] * diagonal[j]).sqrt() * ROUNDED);
            let mut left = solve.b[i * n + j];
            self.range(left, range);
            for k in (i + 1..n).rev() {
                let product = solve.lower[k * n + i] * solve.pivots[k] * solve.lower[k * n + j];
                left = left - product;
                self.range(product, range);
                self.range(left, range);
            }
        }
    }

    /// Products of two matrices with what is between them replaced by an entry of a symmetric matrix and its
    /// mirror: derivatives of an inverse X by what is left of its matrix are −X·∂S·X.
    fn of_products(&mut self, left: &Ranged, right: &Ranged) {
        let inner = left.columns;
        for (o, c) in (0..left.entries.len() / inner).flat_map(|o| (0..right.columns).map(move |c| (o, c))) {
            for (a, b) in (0..inner).flat_map(|a| (0..=a).map(move |b| (a, b))) {
                let of = |a: usize, b: usize| {
                    let ((x, of_x), (y, of_y)) = (left.at(o, a), right.at(b, c));
                    (x * y, of_x.times(of_y).widened(0.0))
                };
                let ((first, of_first), (second, of_second)) = (of(a, b), of(b, a));
                match a == b {
                    true => self.range(first, of_first),
                    false => self.range(first + second, of_first.plus(of_second).widened(0.0)),
                }
            }
        }
    }

    /// Factors of Λ⁻¹, entries of Λ and of J̄, and their derivatives by what is left of Λ⁻¹ and of B. As
    /// J̄ᵀBJ̄ = Λ, |J̄ᵢⱼ|² ≤ (B⁻¹)ᵢᵢ·Λⱼⱼ.
    fn of_task(&mut self, mass: &Solve<'_>, task: &Solve<'_>, consistent: Vec<Fp>) {
        self.of_factors(task);
        self.of_eliminated(task);
        let (of_mass, of_task) = (mass.ranges.mobility(), task.ranges.mobility());
        let most = |k: usize| (of_mass[k / task.n] * of_task[k % task.n]).sqrt() * ROUNDED;
        let entries = consistent.into_iter().enumerate().map(|(k, x)| (x, Interval::within(most(k))));
        let consistent = Ranged { columns: task.n, entries: entries.collect() };
        consistent.entries.iter().for_each(|(x, range)| self.range(*x, *range));
        self.of_products(&task.inverse(), &task.inverse());
        self.of_products(&consistent, &task.inverse());
        self.of_products(&consistent.transposed(), &consistent);
    }

    /// What is computed on the way from r = B·x to x, and the derivatives of x by what is left of B.
    fn of_solution(&mut self, solve: &Solve<'_>, x: &[Fp]) {
        let (n, ranges) = (solve.n, solve.ranges);
        let right: Rc<[Fp]> = product(&solve.b, x).into();
        let size = |o: usize, j: usize| ranges.inverse[o * n + j].magnitude();
        let of = |i: usize, factor: f64| -> Vec<f64> {
            let entry = |j: usize| if j < i { 0.0 } else { ranges.lower_inverse[j * n + i].magnitude() };
            (0..n).map(|j| entry(j) * factor * ROUNDED).collect()
        };
        for i in 0..n {
            self.add(x[i], Fact::Sum(right.clone(), (0..n).map(|j| size(i, j)).collect()));
            let z = (0..=i).fold(Fp::ZERO, |sum, j| sum + solve.lower[i * n + j] * x[j]);
            self.add(z, Fact::Sum(right.clone(), of(i, 1.0 / ranges.pivots[i].low)));
            self.add(solve.pivots[i] * z, Fact::Sum(right.clone(), of(i, 1.0)));
        }
        for o in 0..n {
            for (a, b) in (0..n).flat_map(|a| (0..=a).map(move |b| (a, b))) {
                let first = solve.inverse[o * n + a] * x[b];
                let second = if a == b { Fp::ZERO } else { solve.inverse[o * n + b] * x[a] };
                let twice = if a == b { 0.0 } else { 1.0 };
                let factor = |j: usize| (size(o, a) * size(b, j) + twice * size(o, b) * size(a, j)) * ROUNDED;
                self.add(first + second, Fact::Sum(right.clone(), (0..n).map(factor).collect()));
            }
        }
    }

    /// For each operation what is known of it; `nodes` are those of the emitted ones, which stand first.
    pub(super) fn of(&self, operations: &[Operation], nodes: &[usize]) -> Option<KnownProgram> {
        let mut values: Vec<Fp> = Vec::with_capacity(operations.len());
        for (k, operation) in operations.iter().enumerate() {
            values.push(match (nodes.get(k), operation) {
                (Some(node), _) => self.nodes[*node]?,
                (_, Operation::Add(a, b, true)) => values[*a] - values[*b],
                (_, Operation::Add(a, b, false)) => values[*a] + values[*b],
                (_, Operation::Mul(a, b)) => values[*a] * values[*b],
                (_, Operation::Div(a, b)) => values[*a] * values[*b].inverse()?,
                // Derivatives add no other constant.
                _ => Fp::ONE,
            });
        }
        let mut places: FxHashMap<u64, usize> = FxHashMap::default();
        for (k, value) in values.iter().enumerate() {
            places.entry(value.residue()).or_insert(k);
            places.entry((-*value).residue()).or_insert(k);
        }
        let known = |(k, value): (usize, &Fp)| {
            let turned = |fact: Option<&Fact>, negative: bool| match fact? {
                Fact::Range(range) => Some(Known::Range(range.negated(negative))),
                Fact::Sum(right, factors) => {
                    let terms = right.iter().zip(factors).filter(|(r, _)| **r != Fp::ZERO);
                    let place = |r: &Fp| places.get(&r.residue()).copied().filter(|place| *place < k);
                    let terms: Option<Vec<_>> = terms.map(|(r, factor)| Some((*factor, place(r)?))).collect();
                    terms.map(Known::Sum)
                }
            };
            turned(self.facts.get(&value.residue()), false)
                .or_else(|| turned(self.facts.get(&(-*value).residue()), true))
        };
        let emitted = nodes.len();
        let of = |(exact, ranges): &(Exact, &Factors)| {
            Solves::new(exact, ranges, &operations[..emitted], &values[..emitted])
        };
        let solves = self.solves.iter().filter_map(of).collect();
        Some(KnownProgram { known: values.iter().enumerate().map(known).collect(), solves })
    }
}

impl<'a> Solve<'a> {
    fn new(b: Vec<Fp>, ranges: &'a Factors) -> Option<Self> {
        let n = ranges.n;
        let (mut lower, mut scaled, mut pivots) =
            (vec![Fp::ZERO; n * n], vec![Fp::ZERO; n * n], vec![Fp::ZERO; n]);
        for i in (0..n).rev() {
            let eliminated = |j: usize, lower: &[Fp], scaled: &[Fp]| {
                (i + 1..n).fold(b[i * n + j], |sum, k| sum - lower[k * n + i] * scaled[k * n + j])
            };
            pivots[i] = eliminated(i, &lower, &scaled);
            let of_pivot = pivots[i].inverse()?;
            lower[i * n + i] = Fp::ONE;
            for j in 0..i {
                scaled[i * n + j] = eliminated(j, &lower, &scaled);
                lower[i * n + j] = scaled[i * n + j] * of_pivot;
            }
        }
        let mut lower_inverse = vec![Fp::ZERO; n * n];
        for j in 0..n {
            lower_inverse[j * n + j] = Fp::ONE;
            for i in j + 1..n {
                let sum = (j..i).fold(Fp::ZERO, |sum, c| sum + lower[i * n + c] * lower_inverse[c * n + j]);
                lower_inverse[i * n + j] = -sum;
            }
        }
        let mut inverse = vec![Fp::ZERO; n * n];
        for k in 0..n {
            let of_pivot = pivots[k].inverse()?;
            for at in 0..n * n {
                let product = lower_inverse[at / n * n + k] * lower_inverse[at % n * n + k];
                inverse[at] = inverse[at] + product * of_pivot;
            }
        }
        Some(Solve { n, ranges, b, lower, lower_inverse, inverse, pivots })
    }

    fn exact(&self, solutions: Vec<Vec<Fp>>) -> Exact {
        let (b, lower, pivots) = (self.b.clone(), self.lower.clone(), self.pivots.clone());
        Exact { n: self.n, b, lower, pivots, solutions }
    }

    fn inverse(&self) -> Ranged {
        let entries = self.inverse.iter().copied().zip(self.ranges.inverse.iter().copied()).collect();
        Ranged { columns: self.n, entries }
    }
}

fn columns(matrix: &[Fp], n: usize) -> Vec<Vec<Fp>> {
    (0..n).map(|c| matrix.iter().skip(c).step_by(n).copied().collect()).collect()
}

/// A·x of a square matrix.
fn product(matrix: &[Fp], x: &[Fp]) -> Vec<Fp> {
    let dot = |row: &[Fp]| row.iter().zip(x).fold(Fp::ZERO, |sum, (a, b)| sum + *a * *b);
    matrix.chunks(x.len()).map(dot).collect()
}

/// More than what a few products and sums of positive doubles round.
const ROUNDED: f64 = 1.0 + 1e-12;
