//! What a solve with LᵀDL may be off, in the norm of the kinetic energy: where a forward bound grows from
//! joint to joint.
//!
//! Backward analysis (Higham, *Accuracy and Stability of Numerical Algorithms* (2002), §8.1 and §10.1). The
//! computed factors are the exact ones of B + ΔB, with ΔBᵢⱼ what the sum for an entry rounds. Let bᵢ be at
//! least (B⁻¹)ᵢᵢ, so that xᵢ² ≤ bᵢ·xᵀBx. With η = Σ √(bᵢbⱼ)·|ΔBᵢⱼ| then |xᵀΔB·x| ≤ η·xᵀBx, that is,
//! K(B + ΔB)Kᵀ = 1 + E with |Eᵢⱼ| ≤ η, and the factors of 1 + E are 1 within N = η/(1 − nη), as in
//! `factors.rs`. The solves add residuals: e of Lᵀy = r + e counts √bᵢ·eᵢ, one of L·x = z counts √dᵢ·eᵢ.
//! ρ is their sum, and R = Σ √bⱼ·|rⱼ| is at least √(xᵀBx).
//!
//! An operation is taken for one of a solve where it has that one's value at a random point of the prime
//! field, and where it keeps the equation of the solve when factors and results before it are replaced by
//! random numbers.

use super::factors::Factors;
use super::interval::Interval;
use super::precision::PRECISIONS;
use super::program::{Errors, Operation};
use crate::exact::prime::{Draws, Fp};
use rustc_hash::FxHashMap;

/// What an operation is in a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Role {
    Pivot(usize),
    /// 1/d
    OfPivot(usize),
    /// dₖ·Lₖⱼ, before it is divided.
    Scaled(usize, usize),
    Lower(usize, usize),
    /// An entry of y of a solve.
    Right(usize, usize),
    /// y·(1/d)
    Half(usize, usize),
    Solution(usize, usize),
}

/// The values of a factorisation and of its solves at a random point of the prime field.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    pub(super) n: usize,
    pub(super) b: Vec<Fp>,
    pub(super) lower: Vec<Fp>,
    pub(super) pivots: Vec<Fp>,
    /// x of each solve.
    pub(super) solutions: Vec<Vec<Fp>>,
}

/// An entry of a right-hand side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Right {
    Zero,
    /// The value of this operation.
    At(usize),
    /// No operation has its value: it is mixed with what is subtracted from it.
    Mixed,
}

/// The solves of a program.
#[derive(Clone, Debug)]
pub(super) struct Solves {
    /// By emitted operation.
    roles: Vec<Option<Role>>,
    /// By emitted operation with a role those between it and other roles, in order.
    between: Vec<Vec<usize>>,
    /// By emitted operation the solves and entries of which it is the right-hand side.
    given: Vec<Vec<(usize, usize)>>,
    /// By solve and entry.
    rights: Vec<Vec<Right>>,
    pivots: Vec<Interval>,
    /// Largest entries of B's diagonal, kg·m² or kg.
    diagonal: Vec<f64>,
    /// √bᵢ
    mobility: Vec<f64>,
}

/// Sums over the operations so far.
#[derive(Clone, Debug)]
pub(super) struct Running {
    eta: Errors,
    rho: Vec<Errors>,
    /// By solve and entry how large a right-hand side is at most.
    rights: Vec<Vec<f64>>,
}

/// Of the operations up to the present one: ranges of their exact values, how far they are off, and what they
/// round by themselves. The last one is the present operation's, forwards from its operands.
#[derive(Clone, Copy)]
pub(super) struct SoFar<'a> {
    pub(super) operations: &'a [Operation],
    pub(super) values: &'a [Interval],
    pub(super) deviations: &'a [Errors],
    pub(super) errors: &'a [Errors],
}

impl Solves {
    /// `values` are those of the emitted operations at the random point; `None` where the ranges are not
    /// those of bodies.
    pub(super) fn new(
        exact: &Exact,
        ranges: &Factors,
        operations: &[Operation],
        values: &[Fp],
    ) -> Option<Solves> {
        let (diagonal, n) = (ranges.diagonal.clone()?, exact.n);
        let mut found = Recognised::new(exact, operations, values);
        found.replace(&[]);
        let rights: Vec<Vec<Right>> = (0..exact.solutions.len()).map(|s| found.solve(s)).collect();
        let mut given = vec![Vec::new(); operations.len()];
        for (s, i) in (0..rights.len()).flat_map(|s| (0..n).map(move |i| (s, i))) {
            if let Right::At(k) = rights[s][i] {
                given[k].push((s, i));
            }
        }
        let between = between(operations, &found.roles, |k| given[k].iter().any(|(_, i)| i + 1 == n));
        Some(Solves {
            roles: found.roles,
            between,
            given,
            rights,
            pivots: ranges.pivots.clone(),
            diagonal,
            mobility: (0..n).map(|i| ranges.inverse[i * n + i].high.sqrt()).collect(),
        })
    }

    pub(super) fn start(&self) -> Running {
        let size = |right: &Right| if *right == Right::Zero { 0.0 } else { f64::INFINITY };
        Running {
            eta: [0.0; 2],
            rho: vec![[0.0; 2]; self.rights.len()],
            rights: self.rights.iter().map(|all| all.iter().map(size).collect()).collect(),
        }
    }

    /// Takes the present operation in; returns its range and how far it is off with what is known of solves.
    pub(super) fn take(&self, running: &mut Running, so_far: SoFar<'_>) -> (Interval, Errors) {
        let k = so_far.values.len() - 1;
        let (mut value, mut deviation) = (so_far.values[k], so_far.deviations[k]);
        for (s, i) in &self.given[k] {
            running.rights[*s][*i] = value.magnitude();
        }
        if let Some(role) = self.roles[k] {
            if let Role::Right(s, i) = role
                && self.rights[s][i] == Right::Mixed
            {
                running.rights[s][i] = self.mixed(k, so_far).magnitude();
            }
            let (most, energy) = match role {
                Role::Right(s, i) => {
                    let energy = self.energy(running, s, i);
                    (self.pivots[i].high.sqrt() * energy, energy)
                }
                Role::Half(s, i) => {
                    let energy = self.energy(running, s, i);
                    (energy / self.pivots[i].low.sqrt(), energy)
                }
                Role::Solution(s, i) => {
                    let energy = self.energy(running, s, 0);
                    (self.mobility[i] * energy, energy)
                }
                _ => (f64::INFINITY, 0.0),
            };
            for p in 0..2 {
                self.add(running, role, self.local(role, k, so_far, p), p);
                deviation[p] = deviation[p].min(infinite(self.bound(running, role, energy, p)));
            }
            if most.is_finite() {
                value = value.clamped(most * GROWN);
            }
        }
        let last = self.pivots.len() - 1;
        for (s, _) in self.given[k].iter().filter(|(_, i)| *i == last) {
            // Here y is the right-hand side, and exact in what follows: its error counts as a residual.
            (0..2).for_each(|p| running.rho[*s][p] += self.mobility[last] * deviation[p]);
        }
        (value, deviation)
    }

    /// R of what the entries from `first` on give: y of an entry depends on no earlier one.
    fn energy(&self, running: &Running, s: usize, first: usize) -> f64 {
        let entries = running.rights[s].iter().zip(&self.mobility).skip(first);
        entries.map(|(size, mobility)| size * mobility).sum::<f64>() * GROWN
    }

    /// The range of an entry of a right-hand side that is mixed with what makes y of it: all of y but what
    /// has an entry of L as a factor, that is, y where every L is zero.
    fn mixed(&self, k: usize, so_far: SoFar<'_>) -> Interval {
        let between = &self.between[k];
        let mut found: Vec<Interval> = Vec::with_capacity(between.len() + 1);
        for op in between.iter().chain([&k]) {
            let of = |a: usize| match between.binary_search(&a) {
                _ if matches!(self.roles[a], Some(Role::Lower(..))) => Interval::point(0.0),
                Ok(at) => found[at],
                Err(_) => so_far.values[a],
            };
            found.push(match so_far.operations[*op] {
                Operation::Add(a, b, negative) => of(a).plus(of(b).negated(negative)).widened(0.0),
                Operation::Mul(a, b) => of(a).times(of(b)).widened(0.0),
                _ => Interval::within(f64::INFINITY),
            });
        }
        found.pop().unwrap_or(Interval::within(f64::INFINITY))
    }

    /// What an operation with a role is off if factors and results of its solve are taken as they were
    /// computed; and what its operands are off.
    fn local(&self, role: Role, k: usize, so_far: SoFar<'_>, p: usize) -> [f64; 2] {
        let between = &self.between[k];
        let mut found: Vec<f64> = Vec::with_capacity(between.len());
        for (at, op) in between.iter().enumerate() {
            let own = |a, with| self.own(role, (a, with), (&between[..at], &found), so_far.deviations, p);
            found.push(self.moved(*op, so_far, own, p));
        }
        let own = |a, with| self.own(role, (a, with), (between, &found), so_far.deviations, p);
        let operands = match so_far.operations[k] {
            Operation::Mul(a, b) => own(a, Some(b)) + own(b, Some(a)),
            Operation::Div(_, b) => own(b, None),
            _ => 0.0,
        };
        [self.moved(k, so_far, own, p), operands]
    }

    /// How far an operand of `role` is off beyond what is taken as it was computed; `with` is the other
    /// factor where it is one of a product.
    fn own(
        &self,
        role: Role,
        (a, with): (usize, Option<usize>),
        (between, found): (&[usize], &[f64]),
        all: &[Errors],
        p: usize,
    ) -> f64 {
        let solve = match role {
            Role::Right(s, i) if self.rights[s][i] == Right::At(a) => return all[a][p],
            Role::Right(s, _) | Role::Half(s, _) | Role::Solution(s, _) => Some(s),
            _ => None,
        };
        // The last entry of y may be a part of other entries of a right-hand side: there it is not times L.
        let is_y = |s: usize| self.given[a].iter().any(|(t, i)| *t == s && i + 1 == self.pivots.len());
        let by_factor = with.and_then(|b| self.roles[b]);
        let times_factor = matches!(by_factor, Some(Role::Lower(..) | Role::OfPivot(_)));
        let is_exact = match self.roles[a] {
            Some(Role::Pivot(_) | Role::OfPivot(_) | Role::Scaled(..) | Role::Lower(..)) => true,
            Some(Role::Right(t, _) | Role::Half(t, _) | Role::Solution(t, _)) if solve == Some(t) => true,
            _ => times_factor && solve.is_some_and(is_y),
        };
        match between.binary_search(&a) {
            _ if is_exact => 0.0,
            Ok(at) => found[at],
            Err(_) => all[a][p],
        }
    }

    /// What an operation is off where its operands are off by `own`.
    fn moved(&self, k: usize, so_far: SoFar<'_>, own: impl Fn(usize, Option<usize>) -> f64, p: usize) -> f64 {
        let SoFar { operations, values, deviations, errors } = so_far;
        let size = |a: usize| values[a].magnitude() + deviations[a][p];
        let moved = match operations[k] {
            Operation::Add(a, b, _) => own(a, None) + own(b, None),
            Operation::Mul(a, b) => {
                let (x, y) = (own(a, Some(b)), own(b, Some(a)));
                size(a) * y + size(b) * x + x * y
            }
            Operation::Div(a, b) => {
                let least = values[b].low.abs().min(values[b].high.abs()) - deviations[b][p];
                let off = own(b, None);
                let apart = least - off;
                let moved = own(a, None) + (size(a) / least) * off;
                if least > 0.0 && apart > 0.0 { moved / apart } else { f64::INFINITY }
            }
            _ => 0.0,
        };
        infinite((moved + errors[k][p]) * GROWN)
    }

    /// What an operation adds to η or ρ.
    fn add(&self, running: &mut Running, role: Role, [local, operands]: Errors, p: usize) {
        let b = &self.mobility;
        match role {
            Role::Pivot(i) => running.eta[p] += b[i] * b[i] * (local + self.quotients(i, i, p)),
            Role::Scaled(k, j) => {
                running.eta[p] += 2.0 * b[k] * b[j] * (local + self.quotients(k, j, p));
            }
            Role::Lower(k, j) => {
                running.eta[p] += 2.0 * b[k] * b[j] * (operands + divided(p) * self.scaled(k, j));
            }
            Role::OfPivot(i) => running.eta[p] += b[i] * b[i] * operands,
            Role::Right(s, i) => running.rho[s][p] += b[i] * local,
            Role::Solution(s, i) => running.rho[s][p] += self.pivots[i].high.sqrt() * local,
            // What y is off that has no role.
            Role::Half(s, i) => running.rho[s][p] += b[i] * operands,
        }
    }

    /// How far an operation is off by what η and ρ are so far; `energy` is R of its solve.
    fn bound(&self, running: &Running, role: Role, energy: f64, p: usize) -> f64 {
        let n = self.pivots.len() as f64;
        let eta = running.eta[p] * GROWN;
        if n * eta >= MOST {
            return f64::INFINITY;
        }
        let near = eta / (1.0 - n * eta);
        // Each quotient of a solve rounds too.
        let rho = |s: usize| running.rho[s][p] * GROWN + n * divided(p) * energy;
        match role {
            Role::Pivot(i) => near * self.pivots[i].high,
            Role::OfPivot(i) => (near / (1.0 - near) + divided(p)) / self.pivots[i].low,
            Role::Lower(k, j) => near * (n * self.diagonal[j] / self.pivots[k].low).sqrt(),
            Role::Scaled(k, j) => {
                ((1.0 + near) * (1.0 + near * n.sqrt()) - 1.0 + 2.0 * divided(p)) * self.scaled(k, j)
            }
            Role::Right(s, i) => self.pivots[i].high.sqrt() * (n * near * (energy + rho(s)) + rho(s)),
            Role::Half(s, i) => {
                let quotients = (2.0 * near + divided(p)) * (1.0 + n * near) * (energy + rho(s));
                (n * near * (energy + rho(s)) + rho(s) + quotients) / self.pivots[i].low.sqrt()
            }
            Role::Solution(s, i) => self.mobility[i] * (eta * energy + rho(s)) * (1.0 + eta) / (1.0 - eta),
        }
    }

    /// What the sum for an entry of B misses since each dₖ·Lₖⱼ in it is not quite the one that was divided:
    /// Σₖ |Lₖᵢ·dₖ·Lₖⱼ| ≤ √(Bᵢᵢ·Bⱼⱼ).
    fn quotients(&self, i: usize, j: usize, p: usize) -> f64 {
        divided(p) * (self.diagonal[i] * self.diagonal[j]).sqrt()
    }

    /// The largest dₖ·Lₖⱼ.
    fn scaled(&self, k: usize, j: usize) -> f64 {
        (self.diagonal[j] * self.pivots[k].high).sqrt()
    }
}

/// By operation with a role those between it and other roles, in order: what reads a role, or `is_y`, and has
/// none.
fn between(
    operations: &[Operation],
    roles: &[Option<Role>],
    is_y: impl Fn(usize) -> bool,
) -> Vec<Vec<usize>> {
    let operands = |k: usize| match operations[k] {
        Operation::Add(a, b, _) | Operation::Mul(a, b) | Operation::Div(a, b) => vec![a, b],
        _ => Vec::new(),
    };
    let mut is_between = vec![false; operations.len()];
    for k in 0..operations.len() {
        let reads = |a: &usize| roles[*a].is_some() || is_y(*a) || is_between[*a];
        is_between[k] = roles[k].is_none() && operands(k).iter().any(reads);
    }
    let of = |k: usize| {
        let (mut found, mut open) = (Vec::new(), operands(k));
        while let Some(a) = open.pop() {
            if is_between[a] && !found.contains(&a) {
                found.push(a);
                open.extend(operands(a));
            }
        }
        found.sort_unstable();
        found
    };
    (0..operations.len()).map(|k| if roles[k].is_some() { of(k) } else { Vec::new() }).collect()
}

/// More than a product with a rounded reciprocal is off, as a share of itself.
fn divided(p: usize) -> f64 {
    3.0 * PRECISIONS[p].half_ulp(1.0)
}

/// n·η for which N is a bound worth having.
const MOST: f64 = 0.5;
/// For bounds of some roundings of doubles.
const GROWN: f64 = 1.0 + 1e-9;

/// Nothing is known of ∞·0.
fn infinite(x: f64) -> f64 {
    if x.is_nan() { f64::INFINITY } else { x }
}

/// What stands for a value.
struct Stand {
    /// `None` for a right-hand side alone.
    role: Option<Role>,
    /// What its operands must give; `None` for a right-hand side, however it is computed.
    side: Option<Fp>,
    number: Fp,
}

/// Operations with their roles, and the random numbers that stand for those.
struct Recognised<'a> {
    exact: &'a Exact,
    operations: &'a [Operation],
    values: &'a [Fp],
    roles: Vec<Option<Role>>,
    of_role: FxHashMap<Role, usize>,
    /// By value.
    factors: FxHashMap<u64, Stand>,
    /// L and D of random numbers.
    lower: Vec<Fp>,
    pivots: Vec<Fp>,
    draws: Draws,
}

impl<'a> Recognised<'a> {
    fn new(exact: &'a Exact, operations: &'a [Operation], values: &'a [Fp]) -> Self {
        let mut draws = Draws::new(0x656e_6572_6779);
        let n = exact.n;
        let number = |l: &Fp| if *l == Fp::ZERO { Fp::ZERO } else { draws.element() };
        let lower: Vec<Fp> = exact.lower.iter().map(number).collect();
        let mut pivots: Vec<Fp> = (0..n).map(|_| draws.element()).collect();
        let mut factors = FxHashMap::default();
        let inverse = |x: Fp| x.inverse().unwrap_or(Fp::ZERO);
        let mut scaled: Vec<Fp> = (0..n * n).map(|_| draws.element()).collect();
        // The last row is that of B, whose entries may be parts of others: nothing stands for them.
        let last = n - 1;
        pivots[last] = exact.pivots[last];
        (0..last).for_each(|j| scaled[last * n + j] = exact.b[last * n + j]);
        for i in (0..n).rev() {
            scaled[i * n + i] = pivots[i];
            let eliminated = |j: usize| {
                let term = |k: usize| lower[k * n + i] * scaled[k * n + j];
                (i + 1..n).fold(exact.b[i * n + j], |sum, k| sum - term(k))
            };
            let (d, of_pivot) = (exact.pivots[i], inverse(pivots[i]));
            if i < last {
                stand(&mut factors, d, Some(Role::Pivot(i)), Some(eliminated(i)), pivots[i]);
            }
            stand(&mut factors, inverse(d), Some(Role::OfPivot(i)), Some(of_pivot), of_pivot);
            for j in 0..i {
                let (l, s) = (exact.lower[i * n + j], scaled[i * n + j]);
                if i < last {
                    stand(&mut factors, l * d, Some(Role::Scaled(i, j)), Some(eliminated(j)), s);
                }
                stand(&mut factors, l, Some(Role::Lower(i, j)), Some(s * of_pivot), lower[i * n + j]);
            }
        }
        let (roles, of_role) = (vec![None; operations.len()], FxHashMap::default());
        Recognised { exact, operations, values, roles, of_role, factors, lower, pivots, draws }
    }

    /// Evaluates all operations with the numbers in the place of those that they stand for, and gives these
    /// their roles; `more` goes behind the factors.
    fn replace(&mut self, more: &[FxHashMap<u64, Stand>]) {
        let mut replaced: Vec<Fp> = Vec::with_capacity(self.values.len());
        for (k, operation) in self.operations.iter().enumerate() {
            let value = self.values[k];
            let by_operands = match *operation {
                Operation::Add(a, b, true) => replaced[a] - replaced[b],
                Operation::Add(a, b, false) => replaced[a] + replaced[b],
                Operation::Mul(a, b) => replaced[a] * replaced[b],
                Operation::Div(a, b) => replaced[b].inverse().map_or(value, |x| replaced[a] * x),
                _ => value,
            };
            let mut maps = std::iter::once(&self.factors).chain(more);
            let found = maps.find_map(|map| {
                let plus = map.get(&value.residue()).map(|stand| (stand, false));
                plus.or_else(|| Some((map.get(&(-value).residue())?, true)))
            });
            let turned = |x: Fp, negative: bool| if negative { -x } else { x };
            let (mut number, mut own) = (by_operands, None);
            if let Some((stand, negative)) = found {
                let holds = stand.side.is_none_or(|side| by_operands == turned(side, negative));
                let free = |role: Role| {
                    let first = self.of_role.get(&role).is_none_or(|at| *at == k);
                    first && self.may_be(k, *operation, role)
                };
                if holds && stand.role.is_none_or(free) {
                    (number, own) = (turned(stand.number, negative), stand.role);
                }
            }
            if let Some(role) = own
                && self.roles[k].is_none()
            {
                self.roles[k] = Some(role);
                self.of_role.insert(role, k);
            }
            replaced.push(number);
        }
    }

    /// A quotient is one where it is the rounded product with a rounded reciprocal.
    fn may_be(&self, k: usize, operation: Operation, role: Role) -> bool {
        let of = |a: usize| self.roles[a];
        match (role, operation) {
            (Role::OfPivot(_), Operation::Div(one, _)) => self.values[one] == Fp::ONE,
            (Role::Lower(i, _) | Role::Half(_, i), Operation::Mul(a, b)) => {
                of(a) == Some(Role::OfPivot(i)) || of(b) == Some(Role::OfPivot(i))
            }
            (Role::OfPivot(_) | Role::Lower(..) | Role::Half(..), _) => false,
            // What is given, or the same number of another role, is computed from nothing.
            _ => self.roles[k].is_none_or(|known| known == role),
        }
    }

    /// Gives the operations of a solve their roles; returns the right-hand side.
    fn solve(&mut self, s: usize) -> Vec<Right> {
        let Exact { n, b, lower, pivots, solutions } = self.exact;
        let n = *n;
        let x = &solutions[s];
        let sum = |of: &dyn Fn(usize) -> Fp, range: std::ops::Range<usize>| {
            range.fold(Fp::ZERO, |sum, j| sum + of(j))
        };
        let right: Vec<Fp> = (0..n).map(|i| sum(&|j| b[i * n + j] * x[j], 0..n)).collect();
        let half: Vec<Fp> = (0..n).map(|i| sum(&|j| lower[i * n + j] * x[j], 0..i + 1)).collect();
        let mut map = FxHashMap::default();
        // What stands for y, z and x.
        let mut numbers = [vec![Fp::ZERO; n], vec![Fp::ZERO; n], vec![Fp::ZERO; n]];
        for i in (0..n).rev() {
            let term = |k: usize| self.lower[k * n + i] * numbers[0][k];
            let side = right[i] - sum(&term, i + 1..n);
            numbers[0][i] = self.number(half[i] * pivots[i], side);
            // The last one is the right-hand side, however that is computed.
            let (role, side) = ((i + 1 < n).then_some(Role::Right(s, i)), (i + 1 < n).then_some(side));
            stand(&mut map, half[i] * pivots[i], role, side, numbers[0][i]);
        }
        for i in 0..n {
            let side = numbers[0][i] * self.pivots[i].inverse().unwrap_or(Fp::ZERO);
            numbers[1][i] = side;
            stand(&mut map, half[i], Some(Role::Half(s, i)), Some(side), side);
        }
        for i in 0..n {
            let term = |k: usize| self.lower[i * n + k] * numbers[2][k];
            let side = numbers[1][i] - sum(&term, 0..i);
            numbers[2][i] = if x[i] == half[i] { side } else { self.number(x[i], side) };
            stand(&mut map, x[i], Some(Role::Solution(s, i)), Some(side), numbers[2][i]);
        }
        // However they are computed.
        let mut given = FxHashMap::default();
        for r in &right[..n - 1] {
            stand(&mut given, *r, None, None, *r);
        }
        self.replace(&[map, given]);
        let place = |r: &Fp| match self.values.iter().position(|v| *v == *r || -*v == *r) {
            _ if *r == Fp::ZERO => Right::Zero,
            Some(k) => Right::At(k),
            None => Right::Mixed,
        };
        right.iter().map(place).collect()
    }

    /// What stands for a result: the number of a factor of the same value, or a random one.
    fn number(&mut self, value: Fp, side: Fp) -> Fp {
        if value == Fp::ZERO {
            return Fp::ZERO;
        }
        let of = |v: Fp| self.factors.get(&v.residue()).map(|stand| stand.number);
        let known = of(value).or_else(|| of(-value).map(|x| -x));
        match known {
            Some(number) if number == side => number,
            // What is given.
            _ if value == side => value,
            _ => self.draws.element(),
        }
    }
}

fn stand(map: &mut FxHashMap<u64, Stand>, value: Fp, role: Option<Role>, side: Option<Fp>, number: Fp) {
    if value != Fp::ZERO {
        map.entry(value.residue()).or_insert(Stand { role, side, number });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt, SeedableRng};

    /// B = LᵀDL, from the last row on.
    fn factors(b: &Matrix3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        let (mut lower, mut pivots, mut rest) = (Matrix3::identity(), Vector3::zeros(), *b);
        for i in (0..3).rev() {
            pivots[i] = rest[(i, i)];
            let row = rest.row(i) / pivots[i];
            (0..i).for_each(|j| lower[(i, j)] = row[j]);
            rest -= row.transpose() * row * pivots[i];
        }
        (lower, pivots)
    }

    /// Factors and solutions of perturbed matrices are within the bounds, and come near them.
    #[test]
    fn perturbed_solves_are_within_their_bounds() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(5);
        let mut nearest = [0.0f64; 6];
        for _ in 0..20_000 {
            let mut uniform = || rng.random_range(-1.0..1.0f64);
            let root = Matrix3::from_fn(|i, j| if i == j { 1.5 + uniform() } else { uniform() });
            // As of an arm: later joints carry less.
            let scale = Matrix3::from_diagonal(&Vector3::new(1.0, 0.2, 0.02));
            let b = scale * root * root.transpose() * scale;
            let inverse = b.try_inverse().unwrap();
            let mobility: Vec<f64> = (0..3).map(|i| inverse[(i, i)].sqrt()).collect();
            let (lower, pivots) = factors(&b);
            let mut eta = 0.0;
            let mut moved = b;
            for i in 0..3 {
                for j in 0..=i {
                    let delta = 1e-3 * uniform() / (mobility[i] * mobility[j]);
                    moved[(i, j)] += delta;
                    moved[(j, i)] = moved[(i, j)];
                    eta += if i == j { 1.0 } else { 2.0 } * mobility[i] * mobility[j] * delta.abs();
                }
            }
            let right = Vector3::from_fn(|i, _| uniform() / mobility[i]);
            let (before, after) = [1e-3 * uniform(), 1e-3 * uniform()].into();
            let residual = Vector3::new(0.0, before / mobility[1], 0.0);
            let (lower_moved, pivots_moved) = factors(&moved);
            let late = Vector3::new(0.0, 0.0, after / pivots_moved[2].sqrt());
            let energy: f64 = (0..3).map(|i| mobility[i] * right[i].abs()).sum();
            let rho = mobility[1] * residual[1].abs() + pivots_moved[2].sqrt() * late[2].abs();
            let solves = Solves {
                roles: Vec::new(),
                between: Vec::new(),
                given: Vec::new(),
                rights: vec![Vec::new()],
                pivots: pivots.iter().map(|d| Interval::point(*d)).collect(),
                diagonal: (0..3).map(|i| b[(i, i)]).collect(),
                mobility,
            };
            let running = Running { eta: [eta; 2], rho: vec![[rho; 2]], ..solves.start() };
            let y = |lower: &Matrix3<f64>, r: Vector3<f64>| lower.transpose().try_inverse().unwrap() * r;
            let (y_0, y_1) = (y(&lower, right), y(&lower_moved, right + residual));
            let (z_0, z_1) = (y_0.component_div(&pivots), y_1.component_div(&pivots_moved));
            let x_1 = lower_moved.try_inverse().unwrap() * (z_1 + late);
            let x_0 = inverse * right;
            let mut check = |which: usize, role: Role, error: f64| {
                let bound = solves.bound(&running, role, energy, 1);
                assert!(error.abs() <= bound, "{role:?}: {error:e} of {bound:e}");
                nearest[which] = nearest[which].max(error.abs() / bound);
            };
            for i in 0..3 {
                check(0, Role::Pivot(i), pivots_moved[i] - pivots[i]);
                check(1, Role::OfPivot(i), 1.0 / pivots_moved[i] - 1.0 / pivots[i]);
                for j in 0..i {
                    check(2, Role::Lower(i, j), lower_moved[(i, j)] - lower[(i, j)]);
                }
                check(3, Role::Right(0, i), y_1[i] - y_0[i]);
                check(4, Role::Half(0, i), z_1[i] - z_0[i]);
                check(5, Role::Solution(0, i), x_1[i] - x_0[i]);
            }
        }
        assert!(nearest.iter().all(|x| *x > 0.1), "{nearest:?}");
    }
}
