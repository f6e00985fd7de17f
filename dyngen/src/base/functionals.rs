//! Rows of arms with linkages without the large numbers of their poses.
//!
//! At a pose with exact numbers the sines and rates of a linkage's bars are fractions with hundreds of
//! digits. So the columns are polynomials in what moves with such a linkage, for each coordinate that does,
//! and numbers in all else. The values of these polynomials' monomials over all poses at which loops close
//! span a space, whose basis in reduced form has small numbers, as relations between lengths have. Each of
//! its vectors is a functional; a product of functionals, one for each such coordinate, makes a row of the
//! columns.

use super::roots::{FormalRoots, Parts};
use super::tied::{LARGEST, Point, SIMPLE};
use crate::arm::{Arm, Drive};
use crate::exact::algebra::{Algebra, Inverses};
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{self, Echelon, SparseRow, Unproven};
use crate::exact::prime::{Draws, Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::lagrangian::followers::{input_angles, with_theta};
use crate::lagrangian::linkage::turns;
use std::collections::{BTreeMap, BTreeSet};

/// Poses in a row without a new functional after which there are no more.
const PATIENCE: usize = 20;

/// Products of functionals that are tried at a pose at most.
const MOST_PRODUCTS: usize = 2000;

/// A product of variables, in their order; a power has its variable several times.
pub(super) type Monomial = Vec<usize>;

/// A polynomial in what moves with linkages.
pub(super) type Polynomial<V> = BTreeMap<Monomial, V>;

/// A variable of a joint that moves with a linkage, or of the linkage on it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Variable {
    Sine,
    Cosine,
    Velocity,
    Position,
    /// Sine, cosine and rate of the rod, then of the rocker.
    Bar(usize),
}

/// Variables of one joint.
const OF_JOINT: usize = 10;

/// The number of a variable.
pub(super) fn variable(joint: usize, which: Variable) -> usize {
    let k = match which {
        Variable::Sine => 0,
        Variable::Cosine => 1,
        Variable::Velocity => 2,
        Variable::Position => 3,
        Variable::Bar(k) => 4 + k,
    };
    joint * OF_JOINT + k
}

/// Polynomials over an algebra.
pub(super) struct Formal<'a, A>(pub(super) &'a A);

impl<A: Algebra> Formal<'_, A> {
    /// A polynomial without variables.
    pub(super) fn constant(&self, value: A::Value) -> Polynomial<A::Value> {
        if self.0.is_zero(&value) { BTreeMap::new() } else { BTreeMap::from([(Vec::new(), value)]) }
    }

    /// A variable.
    pub(super) fn variable(&self, variable: usize) -> Polynomial<A::Value> {
        BTreeMap::from([(vec![variable], self.0.integer(1))])
    }

    fn add_to(&self, sum: &mut Polynomial<A::Value>, monomial: Monomial, term: &A::Value) {
        let x = sum.remove(&monomial).map_or(term.clone(), |x| self.0.add(&x, term));
        if !self.0.is_zero(&x) {
            sum.insert(monomial, x);
        }
    }
}

impl<A: Algebra> Algebra for Formal<'_, A> {
    type Value = Polynomial<A::Value>;

    fn integer(&self, value: i64) -> Self::Value {
        self.constant(self.0.integer(value))
    }
    fn is_zero(&self, a: &Self::Value) -> bool {
        a.is_empty()
    }
    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let mut sum = a.clone();
        b.iter().for_each(|(monomial, y)| self.add_to(&mut sum, monomial.clone(), y));
        sum
    }
    fn neg(&self, a: &Self::Value) -> Self::Value {
        a.iter().map(|(monomial, x)| (monomial.clone(), self.0.neg(x))).collect()
    }
    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let mut sum = BTreeMap::new();
        for (m, x) in a {
            for (n, y) in b {
                let mut monomial = [m.as_slice(), n].concat();
                monomial.sort_unstable();
                self.add_to(&mut sum, monomial, &self.0.mul(x, y));
            }
        }
        sum
    }
}

/// A functional on the monomials of what moves with a coordinate: the value of each, exact and modulo the
/// prime.
type Functional = (Vec<Constant>, Vec<Fp>);

/// What a linkage moves with.
struct Own {
    coordinate: usize,
    /// The monomials of what moves with it, in order.
    monomials: Vec<Monomial>,
    /// The first is one on constants, the others are zero on them.
    functionals: Vec<Functional>,
}

/// The terms of columns: of each coordinate the place of its monomial, and the factor.
pub(super) type Terms<V> = Vec<Vec<(Vec<usize>, V)>>;

/// The functionals of every coordinate that a linkage moves with.
pub(super) struct Functionals {
    drives: Vec<Drive>,
    of: Vec<Own>,
}

impl Functionals {
    /// Those of an arm whose columns have some monomials.
    ///
    /// # Errors
    /// [`Unproven`] where the prime divides a number of the arm.
    pub(super) fn new(
        arm: &Arm,
        field: &ConstantField,
        monomials: &BTreeSet<Monomial>,
        mut point: impl FnMut(usize) -> Point,
    ) -> Result<Functionals, Unproven> {
        let drives = arm.drives();
        let coordinates: BTreeSet<usize> =
            arm.linkages().map(|linkage| drives[linkage.joint].coordinate).collect();
        let mut functionals = Functionals { drives, of: Vec::new() };
        for coordinate in coordinates {
            let parts: BTreeSet<Monomial> =
                monomials.iter().map(|m| functionals.part(m, coordinate)).chain([Vec::new()]).collect();
            // Constants come first.
            let monomials: Vec<Monomial> = parts.into_iter().collect();
            let basis = basis(arm, field, &monomials, &mut point)?;
            functionals.of.push(Own { coordinate, monomials, functionals: basis });
        }
        Ok(functionals)
    }

    /// The variables of a monomial that move with a coordinate.
    fn part(&self, monomial: &Monomial, coordinate: usize) -> Monomial {
        let of = |variable: &usize| self.drives[variable / OF_JOINT].coordinate == coordinate;
        monomial.iter().copied().filter(of).collect()
    }

    /// Whether a joint moves with one of the coordinates.
    pub(super) fn has(arm: &Arm, drives: &[Drive], joint: usize) -> bool {
        let coordinate = drives[joint].coordinate;
        arm.linkages().any(|linkage| drives[linkage.joint].coordinate == coordinate)
    }

    /// Products of functionals, by their numbers: all of them, or some at random where there are too many.
    /// Half of those are the one on constants: few columns move with many linkages.
    pub(super) fn products(&self, draws: &mut Draws) -> Vec<Vec<usize>> {
        let counts: Vec<usize> = self.of.iter().map(|own| own.functionals.len()).collect();
        let all = counts.iter().try_fold(1usize, |all, count| all.checked_mul(*count));
        if let Some(all) = all.filter(|all| *all <= MOST_PRODUCTS) {
            let digits = |mut number: usize| {
                let digit = |count: &usize| {
                    let digit = number % count;
                    number /= count;
                    digit
                };
                counts.iter().map(digit).collect()
            };
            return (0..all).map(digits).collect();
        }
        let mut pick = |count: usize| (draws.element().residue() % count as u64) as usize;
        let mut some = |count: &usize| if pick(2) == 0 { 0 } else { pick(*count) };
        (0..MOST_PRODUCTS).map(|_| counts.iter().map(&mut some).collect()).collect()
    }

    /// The terms of columns by the places of their monomials. The certificate fails where one is left out.
    pub(super) fn terms<V>(&self, columns: Vec<Polynomial<V>>) -> Terms<V> {
        let places = |monomial: &Monomial| {
            let place = |own: &Own| own.monomials.binary_search(&self.part(monomial, own.coordinate)).ok();
            self.of.iter().map(place).collect::<Option<Vec<usize>>>()
        };
        let of = |column: Polynomial<V>| {
            column.into_iter().filter_map(|(monomial, x)| Some((places(&monomial)?, x))).collect()
        };
        columns.into_iter().map(of).collect()
    }

    /// The values of columns under a product of functionals, modulo the prime; less those of `rest` where it
    /// is not zero on constants.
    pub(super) fn modular(&self, product: &[usize], columns: &Terms<Fp>, rest: &Terms<Fp>) -> Vec<Fp> {
        self.row(&PrimeField, product, (columns, rest), |(_, modular)| modular)
    }

    /// As [`Self::modular`], exact.
    pub(super) fn exact(
        &self,
        field: &ConstantField,
        product: &[usize],
        columns: &Terms<Constant>,
        rest: &Terms<Constant>,
    ) -> Vec<Constant> {
        self.row(field, product, (columns, rest), |(exact, _)| exact)
    }

    fn row<A: Algebra>(
        &self,
        alg: &A,
        product: &[usize],
        (columns, rest): (&Terms<A::Value>, &Terms<A::Value>),
        kind: impl Fn(&Functional) -> &Vec<A::Value>,
    ) -> Vec<A::Value> {
        let factors: Vec<&Vec<A::Value>> =
            self.of.iter().zip(product).map(|(own, k)| kind(&own.functionals[*k])).collect();
        let value = |column: &Vec<(Vec<usize>, A::Value)>| {
            column.iter().fold(alg.integer(0), |sum, (places, x)| {
                let factors = || factors.iter().zip(places).map(|(of, place)| &of[*place]);
                if factors().any(|factor| alg.is_zero(factor)) {
                    return sum;
                }
                alg.add(&sum, &factors().fold(x.clone(), |term, factor| alg.mul(&term, factor)))
            })
        };
        let on_constants = product.iter().all(|k| *k == 0);
        let entry = |(x, rest)| match on_constants {
            true => alg.sub(&value(x), &value(rest)),
            false => value(x),
        };
        columns.iter().zip(rest).map(entry).collect()
    }
}

/// A basis in reduced form of what the values of monomials over all poses span.
fn basis(
    arm: &Arm,
    field: &ConstantField,
    monomials: &[Monomial],
    point: &mut impl FnMut(usize) -> Point,
) -> Result<Vec<Functional>, Unproven> {
    let residue = |x: &Rational| Fp::from_rational(x).unwrap_or(Fp::ZERO);
    let exact = |x: &Rational| field.rational(x.clone());
    let (mut echelon, mut rows): (Echelon, Vec<SparseRow>) = Default::default();
    let (mut attempt, mut last) = (0, 0);
    while attempt < SIMPLE.max(last) + PATIENCE {
        attempt += 1;
        let point = point(attempt);
        let Some(modular) = at_pose(&PrimeField, arm, &residue, monomials, &point) else { continue };
        let taken: Vec<usize> =
            modular.into_iter().filter(|(_, row)| echelon.takes(row.clone())).map(|(k, _)| k).collect();
        if taken.is_empty() {
            continue;
        }
        last = attempt;
        let parts = at_pose(field, arm, &exact, monomials, &point).ok_or(Unproven)?;
        for row in taken.iter().filter_map(|roots| parts.get(roots)) {
            let entries: Vec<(usize, &Constant)> =
                row.iter().enumerate().filter(|(_, c)| !c.is_zero()).collect();
            rows.push(field.clear_denominators(&entries));
        }
    }
    let order: Vec<usize> = (0..monomials.len()).collect();
    let found = elimination::unchecked(field, &rows, monomials.len(), &order)?;
    let functional = |position: usize| {
        let value = |coordinates: &Vec<(usize, Constant)>| {
            let own = coordinates.iter().find(|(p, _)| *p == position);
            own.map_or_else(|| field.integer(0), |(_, value)| value.clone())
        };
        let exact: Vec<Constant> = found.coordinates.iter().map(value).collect();
        let modular = exact.iter().map(|value| field.modular(value)).collect::<Option<Vec<Fp>>>();
        Ok((exact, modular.ok_or(Unproven)?))
    };
    (0..found.kept.len()).map(functional).collect()
}

/// The values of monomials at a pose, of each product of roots its factors. `None` at a dead point.
fn at_pose<A: Inverses>(
    alg: &A,
    arm: &Arm,
    number: &dyn Fn(&Rational) -> A::Value,
    monomials: &[Monomial],
    point: &Point,
) -> Option<BTreeMap<usize, Vec<A::Value>>> {
    let roots = FormalRoots::new(alg);
    let number = |x: &Rational| roots.element(number(x));
    let drives = arm.drives();
    let mut circle = point.circle.iter().map(|(s, c)| (number(s), number(c)));
    let mut next = || circle.next().unwrap_or_else(|| (roots.integer(0), roots.integer(1)));
    let angles = input_angles(&roots, arm, &number, &mut next, Some(LARGEST));
    let turn = |joint: usize| with_theta(&roots, &arm.joints[joint].theta, angles[joint].clone());
    let mut values: BTreeMap<usize, Parts<A::Value>> = BTreeMap::new();
    let wanted: BTreeSet<usize> = monomials.iter().flatten().map(|variable| variable / OF_JOINT).collect();
    for joint in wanted {
        let Drive { coordinate, ratio, offset, .. } = &drives[joint];
        let (sine, cosine) = turn(joint);
        let mut set = |which, value| values.insert(variable(joint, which), value);
        set(Variable::Sine, sine);
        set(Variable::Cosine, cosine);
        set(Variable::Velocity, number(&(ratio * &point.velocities[*coordinate])));
        set(Variable::Position, number(&(ratio * &point.positions[*coordinate] + offset)));
        for linkage in arm.linkages().filter(|linkage| linkage.joint == joint) {
            let of_bars = turns(&roots, linkage, &number, &turn(joint))?;
            for (k, bar) in of_bars.into_iter().enumerate() {
                for (i, value) in [bar.sin, bar.cos, bar.rate].into_iter().enumerate() {
                    set(Variable::Bar(3 * k + i), value);
                }
            }
        }
    }
    let of = |variable: &usize| values.get(variable).cloned().unwrap_or_default();
    let value = |monomial: &Monomial| {
        monomial.iter().fold(roots.integer(1), |product, variable| roots.mul(&product, &of(variable)))
    };
    let all: Vec<Parts<A::Value>> = monomials.iter().map(value).collect();
    let products: BTreeSet<usize> = all.iter().flat_map(|value| value.keys().copied()).collect();
    let row = |k: usize| {
        let entry = |value: &Parts<A::Value>| value.get(&k).cloned().unwrap_or_else(|| alg.integer(0));
        (k, all.iter().map(entry).collect())
    };
    Some(products.into_iter().map(row).collect())
}
