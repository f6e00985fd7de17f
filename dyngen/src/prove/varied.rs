//! The arm's quantities at a point whose pose is varied: derivatives of any order by infinitesimals.

use super::point::Point;
use crate::arm::Linkage;
use crate::exact::algebra::{Algebra, Roots};
use crate::exact::dual::Duals;
use crate::exact::prime::{Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::lagrangian::elements::{PlacementElements, Source};
use crate::lagrangian::linkage::{BarTurns, turns};

/// An algebra that has the prime field's elements among its own.
pub(super) trait OverPrime: Roots {
    /// An element of the field.
    fn element(&self, x: Fp) -> Self::Value;
}

impl OverPrime for PrimeField {
    fn element(&self, x: Fp) -> Fp {
        x
    }
}

impl<A: OverPrime> OverPrime for Duals<A> {
    fn element(&self, x: Fp) -> Self::Value {
        (self.0.element(x), self.0.integer(0))
    }
}

/// Two infinitesimals s and t: ((x, ∂x/∂s), (∂x/∂t, ∂²x/∂s∂t)).
pub(super) type Mixed = ((Fp, Fp), (Fp, Fp));

/// Two infinitesimals.
pub(super) const MIXED: Duals<Duals<PrimeField>> = Duals(Duals(PrimeField));

/// x + s·u + t·v
pub(super) fn mixed(x: Fp, u: Fp, v: Fp) -> Mixed {
    ((x, u), (v, Fp::ZERO))
}

/// A point whose coordinates q are varied by infinitesimals of which no product of three is other than zero.
pub(super) struct Varied<'p, 'a, A: Algebra> {
    pub(super) algebra: A,
    pub(super) point: &'p Point<'a>,
    /// The change of each coordinate's q.
    pub(super) change: Vec<A::Value>,
}

impl<'p, 'a, A: OverPrime> Varied<'p, 'a, A> {
    /// A number of the arm. One with the prime in its denominator was refused when the sets were derived.
    pub(super) fn number(&self, value: &Rational) -> A::Value {
        self.algebra.element(Fp::from_rational(value).unwrap_or(Fp::ZERO))
    }

    /// The sine or cosine of a constant angle.
    pub(super) fn symbol(&self, index: usize, sine: bool) -> A::Value {
        self.algebra.element(self.point.sets.field.modular_symbol(index, sine))
    }

    /// A frame that is fixed in another.
    pub(super) fn placement(&self, placement: &Option<crate::arm::Placement>) -> PlacementElements<A::Value> {
        let symbol = |index, sine| self.symbol(index, sine);
        let number = |x: &Rational| self.number(x);
        PlacementElements::build(&self.algebra, placement.as_ref(), self.point.symbols, number, symbol)
    }

    /// The change of a joint's position.
    fn change_of(&self, joint: usize) -> A::Value {
        let drive = &self.point.drives[joint];
        self.algebra.mul(&self.algebra.element(drive.ratio), &self.change[drive.coordinate])
    }
}

impl<A: OverPrime> Source<A::Value> for Varied<'_, '_, A> {
    /// sin(q + δ) = s·(1 − ½δ²) + c·δ and cos(q + δ) = c·(1 − ½δ²) − s·δ, exactly, because δ³ is zero.
    fn joint_trig(&mut self, joint: usize) -> (A::Value, A::Value) {
        let alg = &self.algebra;
        let (s, c) = self.point.joint_trig(joint);
        let (s, c, delta) = (alg.element(s), alg.element(c), self.change_of(joint));
        let half = alg.element(super::half());
        let even = alg.sub(&alg.integer(1), &alg.mul(&half, &alg.mul(&delta, &delta)));
        let sin = alg.add(&alg.mul(&s, &even), &alg.mul(&c, &delta));
        let cos = alg.sub(&alg.mul(&c, &even), &alg.mul(&s, &delta));
        (sin, cos)
    }
    fn position(&mut self, joint: usize) -> A::Value {
        let at = self.algebra.element(self.point.joint_position(joint));
        self.algebra.add(&at, &self.change_of(joint))
    }
    fn velocity(&mut self, _: usize) -> A::Value {
        self.algebra.integer(0)
    }
    fn a(&mut self, joint: usize) -> A::Value {
        self.number(&self.point.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> A::Value {
        self.number(&self.point.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> A::Value {
        self.number(&self.point.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> A::Value {
        let ratio = &self.point.arm.joints[joint].rotor_ratio;
        ratio.as_ref().map_or(self.algebra.integer(0), |k| self.number(k))
    }
    fn exact(&mut self, value: &Rational) -> A::Value {
        self.number(value)
    }
    fn linkage(&mut self, linkage: &Linkage) -> Option<BarTurns<A::Value>> {
        let turn = self.joint_trig(linkage.joint);
        turns(&self.algebra, linkage, &|x| self.number(x), &turn)
    }
    fn gravity(&mut self, axis: usize) -> A::Value {
        self.number(&self.point.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> A::Value {
        Varied::symbol(self, index, sine)
    }
}
