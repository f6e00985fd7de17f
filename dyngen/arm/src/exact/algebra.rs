//! The operations that a formula needs, so that each formula is written once for every kind of number.
//!
//! The Lagrangian is one function; run over polynomials it gives the exact coefficients, run over jets modulo
//! a prime it gives the equations of motion at a point.

/// Commutative ring operations; the implementor holds whatever context its values need.
pub trait Algebra {
    /// An element.
    type Value: Clone;
    /// A small integer.
    fn integer(&self, value: i64) -> Self::Value;
    /// Whether the element is known to be zero, so that a product with it need not be formed.
    fn is_zero(&self, a: &Self::Value) -> bool;
    /// a + b
    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value;
    /// -a
    fn neg(&self, a: &Self::Value) -> Self::Value;
    /// a·b
    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value;
    /// a - b
    fn sub(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        self.add(a, &self.neg(b))
    }
    /// u·v of two vectors
    fn dot(&self, u: &[Self::Value; 3], v: &[Self::Value; 3]) -> Self::Value {
        let mut sum = self.integer(0);
        for (a, b) in u.iter().zip(v) {
            if !self.is_zero(a) && !self.is_zero(b) {
                sum = self.add(&sum, &self.mul(a, b));
            }
        }
        sum
    }
    /// u×v
    fn cross(&self, u: &[Self::Value; 3], v: &[Self::Value; 3]) -> [Self::Value; 3] {
        let minor = |i: usize, j: usize| self.sub(&self.mul(&u[i], &v[j]), &self.mul(&u[j], &v[i]));
        [minor(1, 2), minor(2, 0), minor(0, 1)]
    }
}

/// An algebra with inverses.
pub trait Inverses: Algebra {
    /// 1/a; `None` where there is none.
    fn inverse(&self, a: &Self::Value) -> Option<Self::Value>;
}

/// An algebra with square roots.
pub trait Roots: Inverses {
    /// A square root of a, always the same one of the two; `None` where there is none.
    fn root(&self, a: &Self::Value) -> Option<Self::Value>;
}
