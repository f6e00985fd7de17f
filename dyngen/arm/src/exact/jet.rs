//! Values with the derivatives that the Euler–Lagrange equations need.
//!
//! For L(q, q̇) the torque is τᵢ = d/dt ∂L/∂q̇ᵢ − ∂L/∂qᵢ. A jet carries L, dL/dt along the motion, ∂L/∂q̇ᵢ
//! with its time derivative, and ∂L/∂qᵢ, so one evaluation of L over jets gives every torque exactly.

use super::algebra::Algebra;

/// A value with its derivatives at one state of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Jet<V> {
    /// The value.
    pub value: V,
    rate: V,
    /// ∂/∂q̇ᵢ, its time derivative, and ∂/∂qᵢ for each joint; empty where all are zero.
    joints: Vec<[V; 3]>,
}

/// Jets over an algebra, as an [`Algebra`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Jets<A>(pub A);

impl<A: Algebra> Jets<A> {
    /// A constant.
    pub fn constant(&self, value: A::Value) -> Jet<A::Value> {
        Jet { value, rate: self.0.integer(0), joints: Vec::new() }
    }

    /// A function of qᵢ with the given value and derivative, where q̇ᵢ = `dq`.
    pub fn of_position(
        &self,
        (dof, joint): (usize, usize),
        value: A::Value,
        derivative: A::Value,
        dq: &A::Value,
    ) -> Jet<A::Value> {
        let rate = self.0.mul(&derivative, dq);
        let mut joints = vec![self.none(); dof];
        joints[joint][2] = derivative;
        Jet { value, rate, joints }
    }

    /// The joint velocity q̇ᵢ itself, where q̈ᵢ = `ddq`.
    pub fn velocity(&self, (dof, joint): (usize, usize), dq: &A::Value, ddq: &A::Value) -> Jet<A::Value> {
        let mut joints = vec![self.none(); dof];
        joints[joint][0] = self.0.integer(1);
        Jet { value: dq.clone(), rate: ddq.clone(), joints }
    }

    /// ∂f/∂q̇ᵢ
    pub fn by_velocity(&self, f: &Jet<A::Value>, joint: usize) -> A::Value {
        f.joints.get(joint).map_or(self.0.integer(0), |j| j[0].clone())
    }

    /// d/dt ∂f/∂q̇ᵢ − ∂f/∂qᵢ
    pub fn euler_lagrange(&self, f: &Jet<A::Value>, joint: usize) -> A::Value {
        f.joints.get(joint).map_or(self.0.integer(0), |j| self.0.sub(&j[1], &j[2]))
    }

    fn none(&self) -> [A::Value; 3] {
        std::array::from_fn(|_| self.0.integer(0))
    }
}

impl<A: Algebra> Algebra for Jets<A> {
    type Value = Jet<A::Value>;

    fn integer(&self, value: i64) -> Self::Value {
        self.constant(self.0.integer(value))
    }

    fn is_zero(&self, a: &Self::Value) -> bool {
        a.joints.is_empty() && self.0.is_zero(&a.value) && self.0.is_zero(&a.rate)
    }

    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let joints = match (a.joints.is_empty(), b.joints.is_empty()) {
            (true, _) => b.joints.clone(),
            (_, true) => a.joints.clone(),
            _ => (a.joints.iter().zip(&b.joints))
                .map(|(x, y)| std::array::from_fn(|k| self.0.add(&x[k], &y[k])))
                .collect(),
        };
        Jet { value: self.0.add(&a.value, &b.value), rate: self.0.add(&a.rate, &b.rate), joints }
    }

    fn neg(&self, a: &Self::Value) -> Self::Value {
        let joints = a.joints.iter().map(|j| j.each_ref().map(|x| self.0.neg(x))).collect();
        Jet { value: self.0.neg(&a.value), rate: self.0.neg(&a.rate), joints }
    }

    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        let alg = &self.0;
        let none = self.none();
        // f·y + g·x: the derivative of a product.
        let product = |(f, y): (&A::Value, &A::Value), (g, x): (&A::Value, &A::Value)| {
            alg.add(&alg.mul(f, y), &alg.mul(g, x))
        };
        let joints = (0..a.joints.len().max(b.joints.len()))
            .map(|i| {
                let (x, y) = (a.joints.get(i).unwrap_or(&none), b.joints.get(i).unwrap_or(&none));
                let by_velocity = product((&a.value, &y[0]), (&b.value, &x[0]));
                let changes = product((&a.rate, &y[0]), (&b.rate, &x[0]));
                let rate = alg.add(&changes, &product((&a.value, &y[1]), (&b.value, &x[1])));
                [by_velocity, rate, product((&a.value, &y[2]), (&b.value, &x[2]))]
            })
            .collect();
        let rate = product((&a.rate, &b.value), (&a.value, &b.rate));
        Jet { value: alg.mul(&a.value, &b.value), rate, joints }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::prime::{Fp, PrimeField};

    #[test]
    fn a_pendulum_obeys_its_equation() {
        // L = ½ q̇² + 7 c(q): τ = q̈ + 7 s(q), with 2L = q̇² + 14 c.
        let jets = Jets(PrimeField);
        let (s, c) = Fp::from_integer(5).circle_point();
        let (dq, ddq) = (Fp::from_integer(3), Fp::from_integer(-11));
        let cos = jets.of_position((1, 0), c, -s, &dq);
        let velocity = jets.velocity((1, 0), &dq, &ddq);
        let twice = jets.add(&jets.mul(&velocity, &velocity), &jets.mul(&jets.integer(14), &cos));
        assert_eq!(jets.euler_lagrange(&twice, 0), Fp::from_integer(2) * ddq + Fp::from_integer(14) * s);
    }
}
