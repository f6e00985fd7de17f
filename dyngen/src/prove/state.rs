//! The Lagrangian's side at a state of the arm, modulo the prime: Euler–Lagrange over jets, without any
//! recursion.

use super::point::{Motion, Point};
use crate::exact::algebra::Algebra;
use crate::exact::dual::Duals;
use crate::exact::jet::{Jet, Jets};
use crate::exact::prime::Fp;
use crate::exact::rational::Rational;
use crate::graph::differentiate::Direction;
use crate::lagrangian::elements::{ArmElements, Source};
use crate::lagrangian::twice_lagrangian;

/// A motion of the arm at a point's pose.
#[derive(Clone, Copy)]
pub(super) struct State<'p, 'a> {
    pub(super) point: &'p Point<'a>,
    pub(super) velocities: &'p [Fp],
    pub(super) accelerations: &'p [Fp],
    pub(super) gravity: bool,
}

fn half() -> Fp {
    Fp::from_integer(2).inverse().unwrap_or(Fp::ONE)
}

impl<'a> Point<'a> {
    /// A motion at this pose.
    pub(super) fn state<'p>(
        &'p self,
        velocities: &'p [Fp],
        accelerations: &'p [Fp],
        gravity: bool,
    ) -> State<'p, 'a> {
        State { point: self, velocities, accelerations, gravity }
    }
}

impl<'p, 'a> State<'p, 'a> {
    fn dof(&self) -> usize {
        self.point.dof()
    }

    /// The Lagrangian's columns as jets.
    fn lagrangian(&self) -> Vec<Jet> {
        let mut source = JetSource { state: *self };
        let elements = ArmElements::build(&Jets, self.point.arm, self.point.symbols, &mut source);
        twice_lagrangian(&Jets, &elements)
    }

    /// For each of the arm's parameters its torques.
    pub(super) fn columns(&self) -> Vec<Vec<Fp>> {
        let torques = |jet: &Jet| (0..self.dof()).map(|i| half() * jet.euler_lagrange(i)).collect();
        self.lagrangian().iter().map(torques).collect()
    }

    /// For each of the arm's parameters the Lagrangian itself.
    pub(super) fn values(&self) -> Vec<Fp> {
        self.lagrangian().iter().map(|jet| half() * jet.value()).collect()
    }

    /// The torques with the point's parameter values.
    pub(super) fn torques(&self) -> Vec<Fp> {
        self.point.weigh(&self.columns())
    }

    /// The momentum ∂L/∂q̇.
    pub(super) fn momentum(&self) -> Vec<Fp> {
        let columns: Vec<Vec<Fp>> = self
            .lagrangian()
            .iter()
            .map(|jet| (0..self.dof()).map(|i| half() * jet.by_velocity(i)).collect())
            .collect();
        self.point.weigh(&columns)
    }

    /// The derivatives of the torques in one direction.
    pub(super) fn torque_derivative(&self, direction: Direction) -> Vec<Fp> {
        let algebra = Duals(Jets);
        let mut source = DualSource { inner: JetSource { state: *self }, direction };
        let elements = ArmElements::build(&algebra, self.point.arm, self.point.symbols, &mut source);
        let columns: Vec<Vec<Fp>> = twice_lagrangian(&algebra, &elements)
            .iter()
            .map(|(_, rate)| (0..self.dof()).map(|i| half() * rate.euler_lagrange(i)).collect())
            .collect();
        self.point.weigh(&columns)
    }
}

/// The arm's quantities as jets along a motion.
struct JetSource<'p, 'a> {
    state: State<'p, 'a>,
}

impl JetSource<'_, '_> {
    fn number(&self, value: &Rational) -> Jet {
        // Numbers with the prime in a denominator were refused when the sets were derived.
        Jet::constant(Fp::from_rational(value).unwrap_or(Fp::ZERO))
    }

    /// A function of a joint's position with a value and its derivative by that position.
    fn of_position(&self, joint: usize, value: Fp, derivative: Fp) -> Jet {
        let Motion { coordinate, ratio, .. } = self.state.point.drives[joint];
        let velocity = self.state.velocities[coordinate];
        Jet::of_position(self.state.dof(), coordinate, value, ratio * derivative, velocity)
    }
}

impl Source<Jet> for JetSource<'_, '_> {
    fn joint_trig(&mut self, joint: usize) -> (Jet, Jet) {
        let (s, c) = self.state.point.joint_trig(joint);
        (self.of_position(joint, s, c), self.of_position(joint, c, -s))
    }
    fn position(&mut self, joint: usize) -> Jet {
        self.of_position(joint, self.state.point.joint_position(joint), Fp::ONE)
    }
    fn velocity(&mut self, joint: usize) -> Jet {
        let State { velocities, accelerations, .. } = self.state;
        let Motion { coordinate, ratio, .. } = self.state.point.drives[joint];
        let velocity =
            Jet::velocity(self.state.dof(), coordinate, velocities[coordinate], accelerations[coordinate]);
        Jets.mul(&Jet::constant(ratio), &velocity)
    }
    fn a(&mut self, joint: usize) -> Jet {
        self.number(&self.state.point.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Jet {
        self.number(&self.state.point.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Jet {
        self.number(&self.state.point.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Jet {
        let ratio = self.state.point.arm.joints[joint].rotor_ratio.clone();
        ratio.map_or(Jet::constant(Fp::ZERO), |k| self.number(&k))
    }
    fn coupling(&mut self, factor: &Rational) -> Jet {
        self.number(factor)
    }
    fn gravity(&mut self, axis: usize) -> Jet {
        match self.state.gravity {
            true => self.number(&self.state.point.arm.gravity[axis]),
            false => Jet::constant(Fp::ZERO),
        }
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Jet {
        Jet::constant(self.state.point.sets.field.modular_symbol(index, sine))
    }
}

/// The same with the derivative in one direction.
struct DualSource<'p, 'a> {
    inner: JetSource<'p, 'a>,
    direction: Direction,
}

impl DualSource<'_, '_> {
    /// The derivative of a function of a joint's position with the given first two derivatives by it.
    fn derivative(&self, joint: usize, first: Fp, second: Fp) -> Jet {
        let Motion { coordinate, ratio, .. } = self.inner.state.point.drives[joint];
        let by_own = match self.direction {
            Direction::Position(j) if j == coordinate => self.inner.of_position(joint, first, second),
            // Its rate is first·q̇.
            Direction::Velocity(j) if j == coordinate => Jet::of_rate(first),
            _ => return Jets.integer(0),
        };
        Jets.mul(&Jet::constant(ratio), &by_own)
    }

    fn fixed(value: Jet) -> (Jet, Jet) {
        (value, Jets.integer(0))
    }
}

impl Source<(Jet, Jet)> for DualSource<'_, '_> {
    fn joint_trig(&mut self, joint: usize) -> ((Jet, Jet), (Jet, Jet)) {
        let (s, c) = self.inner.state.point.joint_trig(joint);
        let (sin, cos) = self.inner.joint_trig(joint);
        ((sin, self.derivative(joint, c, -s)), (cos, self.derivative(joint, -s, -c)))
    }
    fn position(&mut self, joint: usize) -> (Jet, Jet) {
        (self.inner.position(joint), self.derivative(joint, Fp::ONE, Fp::ZERO))
    }
    fn velocity(&mut self, joint: usize) -> (Jet, Jet) {
        let Motion { coordinate, ratio, .. } = self.inner.state.point.drives[joint];
        let own = self.direction == Direction::Velocity(coordinate);
        (self.inner.velocity(joint), if own { Jet::constant(ratio) } else { Jets.integer(0) })
    }
    fn a(&mut self, joint: usize) -> (Jet, Jet) {
        Self::fixed(self.inner.a(joint))
    }
    fn b(&mut self, joint: usize) -> (Jet, Jet) {
        Self::fixed(self.inner.b(joint))
    }
    fn d(&mut self, joint: usize) -> (Jet, Jet) {
        Self::fixed(self.inner.d(joint))
    }
    fn ratio(&mut self, joint: usize) -> (Jet, Jet) {
        Self::fixed(self.inner.ratio(joint))
    }
    fn coupling(&mut self, factor: &Rational) -> (Jet, Jet) {
        Self::fixed(self.inner.coupling(factor))
    }
    fn gravity(&mut self, axis: usize) -> (Jet, Jet) {
        Self::fixed(self.inner.gravity(axis))
    }
    fn symbol(&mut self, index: usize, sine: bool) -> (Jet, Jet) {
        Self::fixed(self.inner.symbol(index, sine))
    }
}
