//! Which operation of a program is which number of a solve with LᵀDL, for `energy.rs`.
//!
//! An operation is taken for one of a solve where it has that one's value at a random point of the prime
//! field, and where it keeps the equation of the solve when factors and results before it are replaced by
//! random numbers. Where numbers with the same equation are equal, as where two entries of B are, one
//! operation stands for all of them.

use super::program::Operation;
use crate::exact::prime::{Draws, Fp};
use rustc_hash::FxHashMap;

/// What an operation is in a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Role {
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

impl Role {
    /// The solve that it is of; `None` for a factor.
    pub(super) fn solve(self) -> Option<usize> {
        match self {
            Role::Right(s, _) | Role::Half(s, _) | Role::Solution(s, _) => Some(s),
            _ => None,
        }
    }
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
pub(super) enum Right {
    Zero,
    /// The value of this operation.
    At(usize),
    /// No operation has its value: it is mixed with what is subtracted from it.
    Mixed,
}

/// The roles of each emitted operation, and the right-hand sides by solve and entry; `values` are those of
/// the operations at the random point.
pub(super) fn roles(
    exact: &Exact,
    operations: &[Operation],
    values: &[Fp],
) -> (Vec<Vec<Role>>, Vec<Vec<Right>>) {
    let mut found = Recognised::new(exact, operations, values);
    found.replace(&[]);
    let rights = (0..exact.solutions.len()).map(|s| found.solve(s)).collect();
    (found.roles, rights)
}

/// What stands for a value.
struct Stand {
    /// None for a right-hand side alone.
    roles: Vec<Role>,
    /// What its operands must give; `None` for a right-hand side, however it is computed.
    side: Option<Fp>,
    number: Fp,
}

/// What stands for values, by value.
#[derive(Default)]
struct Stands(FxHashMap<u64, Vec<Stand>>);

impl Stands {
    /// Adds a number; one more role of one that is there, if value, side and number are equal up to the sign.
    fn add(&mut self, value: Fp, role: Option<Role>, side: Option<Fp>, number: Fp) {
        if value == Fp::ZERO {
            return;
        }
        for negative in [false, true] {
            let same = |stand: &&mut Stand| {
                (stand.side, stand.number) == (side.map(|x| turned(x, negative)), turned(number, negative))
            };
            let known = self.0.get_mut(&turned(value, negative).residue());
            if let Some(stand) = known.and_then(|all| all.iter_mut().find(same)) {
                stand.roles.extend(role);
                return;
            }
        }
        let stand = Stand { roles: role.into_iter().collect(), side, number };
        self.0.entry(value.residue()).or_default().push(stand);
    }

    /// What stands for a value or for minus it.
    fn of(&self, value: Fp) -> impl Iterator<Item = (&Stand, bool)> {
        [false, true].into_iter().flat_map(move |negative| {
            let all = self.0.get(&turned(value, negative).residue());
            all.into_iter().flatten().map(move |stand| (stand, negative))
        })
    }

    /// The number that stands for a value with this side already, which one operation computes.
    fn number(&self, value: Fp, side: Fp) -> Option<Fp> {
        let same = |(stand, negative): &(&Stand, bool)| stand.side == Some(turned(side, *negative));
        self.of(value).find(same).map(|(stand, negative)| turned(stand.number, negative))
    }
}

fn turned(x: Fp, negative: bool) -> Fp {
    if negative { -x } else { x }
}

/// Operations with their roles, and the random numbers that stand for those.
struct Recognised<'a> {
    exact: &'a Exact,
    operations: &'a [Operation],
    values: &'a [Fp],
    roles: Vec<Vec<Role>>,
    of_role: FxHashMap<Role, usize>,
    factors: Stands,
    /// L and D of random numbers.
    lower: Vec<Fp>,
    pivots: Vec<Fp>,
    draws: Draws,
}

impl<'a> Recognised<'a> {
    fn new(exact: &'a Exact, operations: &'a [Operation], values: &'a [Fp]) -> Self {
        let n = exact.n;
        let (roles, of_role) = (vec![Vec::new(); operations.len()], FxHashMap::default());
        let mut found = Recognised {
            exact,
            operations,
            values,
            roles,
            of_role,
            factors: Stands::default(),
            lower: vec![Fp::ZERO; n * n],
            pivots: vec![Fp::ZERO; n],
            draws: Draws::new(0x656e_6572_6779),
        };
        found.stand_for_factors();
        found
    }

    /// Numbers for L, D and what is on the way to them.
    fn stand_for_factors(&mut self) {
        let Exact { n, b, lower, pivots, .. } = self.exact;
        let n = *n;
        let mut scaled = vec![Fp::ZERO; n * n];
        for i in (0..n).rev() {
            // The last row is that of B, whose entries may be parts of others: nothing stands for them.
            let is_last = i + 1 == n;
            let d = pivots[i];
            let side = self.eliminated((i, i), &scaled);
            self.pivots[i] = if is_last { d } else { self.factor(d, Role::Pivot(i), side) };
            scaled[i * n + i] = self.pivots[i];
            let (of_d, of_pivot) = (inverse(d), inverse(self.pivots[i]));
            self.factors.add(of_d, Some(Role::OfPivot(i)), Some(of_pivot), of_pivot);
            for j in 0..i {
                let l = lower[i * n + j];
                let side = self.eliminated((i, j), &scaled);
                scaled[i * n + j] =
                    if is_last { b[i * n + j] } else { self.factor(l * d, Role::Scaled(i, j), side) };
                self.lower[i * n + j] = self.factor(l, Role::Lower(i, j), scaled[i * n + j] * of_pivot);
            }
        }
    }

    /// Bᵢⱼ less what later rows take off it, of the numbers.
    fn eliminated(&self, (i, j): (usize, usize), scaled: &[Fp]) -> Fp {
        let n = self.exact.n;
        let term = |k: usize| self.lower[k * n + i] * scaled[k * n + j];
        (i + 1..n).fold(self.exact.b[i * n + j], |sum, k| sum - term(k))
    }

    /// A number for a factor: a random one, or that of an equal factor.
    fn factor(&mut self, value: Fp, role: Role, side: Fp) -> Fp {
        if value == Fp::ZERO {
            return Fp::ZERO;
        }
        let number = self.factors.number(value, side).unwrap_or_else(|| self.draws.element());
        self.factors.add(value, Some(role), Some(side), number);
        number
    }

    /// Evaluates all operations with the numbers in the place of those that they stand for, and gives these
    /// their roles; `more` goes behind the factors.
    fn replace(&mut self, more: &[Stands]) {
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
            let (mut number, mut own) = (by_operands, Vec::new());
            for (stand, negative) in std::iter::once(&self.factors).chain(more).flat_map(|all| all.of(value))
            {
                let holds = stand.side.is_none_or(|side| by_operands == turned(side, negative));
                let free = |role: &Role| {
                    let first = self.of_role.get(role).is_none_or(|at| *at == k);
                    first && self.may_be(k, *operation, *role)
                };
                let free: Vec<Role> = stand.roles.iter().copied().filter(free).collect();
                if holds && (stand.roles.is_empty() || !free.is_empty()) {
                    (number, own) = (turned(stand.number, negative), free);
                    break;
                }
            }
            for role in own {
                if !self.roles[k].contains(&role) {
                    self.roles[k].push(role);
                    self.of_role.insert(role, k);
                }
            }
            replaced.push(number);
        }
    }

    /// A quotient is one where it is the rounded product with a rounded reciprocal.
    fn may_be(&self, k: usize, operation: Operation, role: Role) -> bool {
        let is_reciprocal = |a: usize, i: usize| self.roles[a].contains(&Role::OfPivot(i));
        match (role, operation) {
            (Role::OfPivot(_), Operation::Div(one, _)) => self.values[one] == Fp::ONE,
            (Role::Lower(i, _) | Role::Half(_, i), Operation::Mul(a, b)) => {
                is_reciprocal(a, i) || is_reciprocal(b, i)
            }
            (Role::OfPivot(_) | Role::Lower(..) | Role::Half(..), _) => false,
            // What is given, or the same number of another role, is computed from nothing.
            _ => self.roles[k].is_empty() || self.roles[k].contains(&role),
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
        let mut stands = Stands::default();
        // What stands for y, z and x.
        let mut numbers = [vec![Fp::ZERO; n], vec![Fp::ZERO; n], vec![Fp::ZERO; n]];
        for i in (0..n).rev() {
            let term = |k: usize| self.lower[k * n + i] * numbers[0][k];
            let side = right[i] - sum(&term, i + 1..n);
            numbers[0][i] = self.number(half[i] * pivots[i], side);
            // The last one is the right-hand side, however that is computed.
            let (role, side) = ((i + 1 < n).then_some(Role::Right(s, i)), (i + 1 < n).then_some(side));
            stands.add(half[i] * pivots[i], role, side, numbers[0][i]);
        }
        for i in 0..n {
            let side = numbers[0][i] * inverse(self.pivots[i]);
            numbers[1][i] = side;
            stands.add(half[i], Some(Role::Half(s, i)), Some(side), side);
        }
        for i in 0..n {
            let term = |k: usize| self.lower[i * n + k] * numbers[2][k];
            let side = numbers[1][i] - sum(&term, 0..i);
            // Where nothing is subtracted it is z, which has its role.
            let is_half = x[i] == half[i];
            numbers[2][i] = if is_half { side } else { self.number(x[i], side) };
            if !is_half {
                stands.add(x[i], Some(Role::Solution(s, i)), Some(side), numbers[2][i]);
            }
        }
        // However they are computed.
        let mut given = Stands::default();
        for r in &right[..n - 1] {
            given.add(*r, None, None, *r);
        }
        self.replace(&[stands, given]);
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
        let known = self.factors.of(value).map(|(stand, negative)| turned(stand.number, negative));
        match known.into_iter().find(|number| *number == side) {
            Some(number) => number,
            // What is given.
            None if value == side => value,
            None => self.draws.element(),
        }
    }
}

fn inverse(x: Fp) -> Fp {
    x.inverse().unwrap_or(Fp::ZERO)
}
