//! First derivatives in one direction over any algebra.

use super::algebra::{Algebra, Inverses, Roots};

/// Pairs of a value and its derivative over an algebra.
#[derive(Clone, Copy, Debug, Default)]
pub struct Duals<A>(pub A);

impl<A: Algebra> Algebra for Duals<A> {
    type Value = (A::Value, A::Value);

    fn integer(&self, value: i64) -> Self::Value {
        (self.0.integer(value), self.0.integer(0))
    }
    fn is_zero(&self, a: &Self::Value) -> bool {
        self.0.is_zero(&a.0) && self.0.is_zero(&a.1)
    }
    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        (self.0.add(&a.0, &b.0), self.0.add(&a.1, &b.1))
    }
    fn neg(&self, a: &Self::Value) -> Self::Value {
        (self.0.neg(&a.0), self.0.neg(&a.1))
    }
    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let cross = self.0.add(&self.0.mul(&a.0, &b.1), &self.0.mul(&a.1, &b.0));
        (self.0.mul(&a.0, &b.0), cross)
    }
}

impl<A: Inverses> Inverses for Duals<A> {
    fn inverse(&self, (x, dx): &Self::Value) -> Option<Self::Value> {
        let inverse = self.0.inverse(x)?;
        let slope = self.0.neg(&self.0.mul(&inverse, &inverse));
        Some((inverse, self.0.mul(&slope, dx)))
    }
}

impl<A: Roots> Roots for Duals<A> {
    fn root(&self, (x, dx): &Self::Value) -> Option<Self::Value> {
        let root = self.0.root(x)?;
        let slope = self.0.inverse(&self.0.add(&root, &root))?;
        Some((root, self.0.mul(&slope, dx)))
    }
}
