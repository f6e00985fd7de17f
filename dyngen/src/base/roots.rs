//! An algebra with formal square roots of some of its elements.
//!
//! A function of a pose at which loops close is a sum of others with, or without, a factor √S for each loop.
//! No S is a square as a function of the pose (loops with two pairs of equal bars are read as parallelograms
//! or refused), so such a sum is zero only where each part of it is. Values of each part at poses with exact
//! numbers therefore span what values of the function itself span at poses where all roots are numbers, which
//! are rare.

use crate::exact::algebra::{Algebra, Inverses, Roots};
use std::cell::RefCell;
use std::collections::BTreeMap;

/// Elements of an algebra and formal roots: of each product of roots, whose bits say which, its factor.
pub(super) type Parts<V> = BTreeMap<usize, V>;

/// The algebra.
#[derive(Debug)]
pub(super) struct FormalRoots<'a, A: Algebra> {
    algebra: &'a A,
    /// What the roots are taken of.
    squares: RefCell<Vec<A::Value>>,
}

impl<'a, A: Algebra> FormalRoots<'a, A> {
    /// No root is taken yet.
    pub(super) fn new(algebra: &'a A) -> Self {
        FormalRoots { algebra, squares: RefCell::new(Vec::new()) }
    }

    /// An element without roots.
    pub(super) fn element(&self, value: A::Value) -> Parts<A::Value> {
        if self.algebra.is_zero(&value) { BTreeMap::new() } else { BTreeMap::from([(0, value)]) }
    }

    /// The product of the squares of some roots.
    fn square(&self, roots: usize) -> A::Value {
        let squares = self.squares.borrow();
        let taken = squares.iter().enumerate().filter(|(k, _)| roots >> k & 1 == 1);
        taken.fold(self.algebra.integer(1), |product, (_, x)| self.algebra.mul(&product, x))
    }
}

impl<A: Algebra> Algebra for FormalRoots<'_, A> {
    type Value = Parts<A::Value>;

    fn integer(&self, value: i64) -> Self::Value {
        self.element(self.algebra.integer(value))
    }
    fn is_zero(&self, a: &Self::Value) -> bool {
        a.is_empty()
    }
    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let mut sum = a.clone();
        for (roots, y) in b {
            let x = sum.remove(roots).map_or(y.clone(), |x| self.algebra.add(&x, y));
            if !self.algebra.is_zero(&x) {
                sum.insert(*roots, x);
            }
        }
        sum
    }
    fn neg(&self, a: &Self::Value) -> Self::Value {
        a.iter().map(|(roots, x)| (*roots, self.algebra.neg(x))).collect()
    }
    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let mut sum = BTreeMap::new();
        for (m, x) in a {
            for (n, y) in b {
                let mut product = self.algebra.mul(x, y);
                if m & n != 0 {
                    product = self.algebra.mul(&product, &self.square(m & n));
                }
                if !self.algebra.is_zero(&product) {
                    sum = self.add(&sum, &BTreeMap::from([(m ^ n, product)]));
                }
            }
        }
        sum
    }
}

/// Of elements with one part alone.
impl<A: Inverses> Inverses for FormalRoots<'_, A> {
    fn inverse(&self, a: &Self::Value) -> Option<Self::Value> {
        let (roots, x) = a.first_key_value().filter(|_| a.len() == 1)?;
        let square = self.algebra.mul(x, &self.square(*roots));
        Some(BTreeMap::from([(*roots, self.algebra.inverse(&square)?)]))
    }
}

/// Each root that is taken is a new one; of elements without roots alone.
impl<A: Inverses> Roots for FormalRoots<'_, A> {
    fn root(&self, a: &Self::Value) -> Option<Self::Value> {
        let square = a.get(&0).filter(|_| a.len() == 1)?;
        let mut squares = self.squares.borrow_mut();
        squares.push(square.clone());
        Some(BTreeMap::from([(1 << (squares.len() - 1), self.algebra.integer(1))]))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::exact::prime::{Fp, PrimeField};

    #[test]
    fn roots_times_themselves_are_their_squares() {
        let alg = FormalRoots::new(&PrimeField);
        let number = |x: i64| alg.integer(x);
        let [r, s] = [3, 5].map(|x| alg.root(&number(x)).unwrap());
        assert_eq!(alg.mul(&r, &r), number(3));
        let both = alg.mul(&alg.add(&r, &number(2)), &alg.add(&s, &number(7)));
        let parts: Vec<(usize, Fp)> = both.into_iter().collect();
        assert_eq!(parts, [(0, 14), (1, 7), (2, 2), (3, 1)].map(|(k, x)| (k, Fp::from_integer(x))));
        let of = alg.mul(&alg.mul(&r, &s), &number(4));
        assert_eq!(alg.mul(&of, &alg.inverse(&of).unwrap()), number(1));
        assert!(alg.sub(&r, &r).is_empty() && alg.inverse(&alg.add(&r, &number(1))).is_none());
    }
}
