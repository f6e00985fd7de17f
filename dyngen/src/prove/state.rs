//! The Lagrangian's side at a state of the arm, modulo the prime: Euler–Lagrange over jets, without any
//! recursion.

use super::half;
use super::point::{Motion, Point};
use super::varied::{MIXED, OverPrime, Varied, mixed};
use crate::arm::Linkage;
use crate::exact::algebra::Algebra;
use crate::exact::dual::Duals;
use crate::exact::jet::{Jet, Jets};
use crate::exact::prime::{Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::graph::differentiate::Direction;
use crate::lagrangian::elements::{ArmElements, PlacementElements, Source};
use crate::lagrangian::linkage::{BarTurns, turns};
use crate::lagrangian::{self, twice_lagrangian};

/// A motion of the arm at a point's pose.
#[derive(Clone, Copy)]
pub(super) struct State<'p, 'a> {
    pub(super) point: &'p Point<'a>,
    pub(super) velocities: &'p [Fp],
    pub(super) accelerations: &'p [Fp],
    pub(super) gravity: bool,
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

    /// The Lagrangian's columns as jets: those of the arm's parameters, then, where the arm is loaded, the
    /// payload's.
    fn lagrangian<A: OverPrime + Copy>(
        &self,
        algebra: A,
        change: Vec<A::Value>,
        velocities: Vec<A::Value>,
    ) -> Vec<Jet<A::Value>> {
        let jets = Jets(algebra);
        let kinematics = Varied { algebra, point: self.point, change };
        let tool = kinematics.placement(&self.point.arm.tool);
        let accelerations = self.accelerations.iter().map(|x| algebra.element(*x)).collect();
        let mut source = JetSource { jets, kinematics, velocities, accelerations, gravity: self.gravity };
        let elements = ArmElements::build(&jets, self.point.arm, self.point.symbols, &mut source);
        let mut columns = twice_lagrangian(&jets, &elements);
        if self.point.loaded {
            let fixed = |x: &A::Value| jets.constant(x.clone());
            let tool = PlacementElements {
                origin: tool.origin.each_ref().map(fixed),
                rpy: tool.rpy.each_ref().map(|(s, c)| (fixed(s), fixed(c))),
            };
            let carrier = self.point.arm.tool_carrier();
            columns.extend(lagrangian::twice_lagrangian_of_tool(&jets, &elements, carrier, &tool));
        }
        columns
    }

    /// The Lagrangian's columns at the state itself.
    fn here(&self) -> Vec<Jet<Fp>> {
        self.lagrangian(PrimeField, vec![Fp::ZERO; self.dof()], self.velocities.to_vec())
    }

    /// For each parameter its torques.
    pub(super) fn columns(&self) -> Vec<Vec<Fp>> {
        let torque = |jet: &Jet<Fp>, i: usize| half() * Jets(PrimeField).euler_lagrange(jet, i);
        self.here().iter().map(|jet| (0..self.dof()).map(|i| torque(jet, i)).collect()).collect()
    }

    /// For each parameter the Lagrangian itself.
    pub(super) fn values(&self) -> Vec<Fp> {
        self.here().iter().map(|jet| half() * jet.value).collect()
    }

    /// The torques with the point's parameter values.
    pub(super) fn torques(&self) -> Vec<Fp> {
        self.point.weigh(&self.columns())
    }

    /// The momentum ∂L/∂q̇.
    pub(super) fn momentum(&self) -> Vec<Fp> {
        let by_velocity = |jet: &Jet<Fp>, i: usize| half() * Jets(PrimeField).by_velocity(jet, i);
        let of = |jet: &Jet<Fp>| (0..self.dof()).map(|i| by_velocity(jet, i)).collect();
        self.point.weigh(&self.here().iter().map(of).collect::<Vec<_>>())
    }

    /// The derivatives of the torques in one direction.
    pub(super) fn torque_derivative(&self, direction: Direction) -> Vec<Fp> {
        let algebra = Duals(PrimeField);
        let one = |is: bool| if is { Fp::ONE } else { Fp::ZERO };
        let change = |j: usize| (Fp::ZERO, one(direction == Direction::Position(j)));
        let velocity = |j: usize| (self.velocities[j], one(direction == Direction::Velocity(j)));
        let n = self.dof();
        let columns = self.lagrangian(algebra, (0..n).map(change).collect(), (0..n).map(velocity).collect());
        self.weighed_torques(algebra, &columns, |x| x.1)
    }

    /// The mixed second derivatives of the torques: in a direction of q and q̇ together, and in one of a
    /// single coordinate.
    pub(super) fn torque_second_derivative(&self, along: (&[Fp], &[Fp]), direction: Direction) -> Vec<Fp> {
        let one = |is: bool| if is { Fp::ONE } else { Fp::ZERO };
        let change = |j: usize| mixed(Fp::ZERO, along.0[j], one(direction == Direction::Position(j)));
        let velocity =
            |j: usize| mixed(self.velocities[j], along.1[j], one(direction == Direction::Velocity(j)));
        let n = self.dof();
        let columns = self.lagrangian(MIXED, (0..n).map(change).collect(), (0..n).map(velocity).collect());
        self.weighed_torques(MIXED, &columns, |x| x.1.1)
    }

    /// A part of the torques with the point's parameter values.
    fn weighed_torques<A: OverPrime>(
        &self,
        algebra: A,
        columns: &[Jet<A::Value>],
        part: impl Fn(A::Value) -> Fp,
    ) -> Vec<Fp> {
        let jets = Jets(algebra);
        let torque = |jet: &Jet<A::Value>, i: usize| half() * part(jets.euler_lagrange(jet, i));
        let of = |jet| (0..self.dof()).map(|i| torque(jet, i)).collect();
        self.point.weigh(&columns.iter().map(of).collect::<Vec<_>>())
    }
}

/// The arm's quantities as jets along a motion.
struct JetSource<'p, 'a, A: OverPrime> {
    jets: Jets<A>,
    kinematics: Varied<'p, 'a, A>,
    /// Velocities of the coordinates.
    velocities: Vec<A::Value>,
    accelerations: Vec<A::Value>,
    gravity: bool,
}

impl<A: OverPrime> JetSource<'_, '_, A> {
    /// A function of a joint's position with a value and its derivative by that position.
    fn of_position(&self, joint: usize, value: A::Value, derivative: A::Value) -> Jet<A::Value> {
        let Motion { coordinate, ratio, .. } = self.kinematics.point.drives[joint];
        let algebra = &self.kinematics.algebra;
        let derivative = algebra.mul(&algebra.element(ratio), &derivative);
        let place = (self.velocities.len(), coordinate);
        self.jets.of_position(place, value, derivative, &self.velocities[coordinate])
    }
}

impl<A: OverPrime + Copy> Source<Jet<A::Value>> for JetSource<'_, '_, A> {
    fn joint_trig(&mut self, joint: usize) -> (Jet<A::Value>, Jet<A::Value>) {
        let (s, c) = self.kinematics.joint_trig(joint);
        let back = self.kinematics.algebra.neg(&s);
        (self.of_position(joint, s, c.clone()), self.of_position(joint, c, back))
    }
    fn position(&mut self, joint: usize) -> Jet<A::Value> {
        let position = self.kinematics.position(joint);
        self.of_position(joint, position, self.kinematics.algebra.integer(1))
    }
    fn velocity(&mut self, joint: usize) -> Jet<A::Value> {
        let Motion { coordinate, ratio, .. } = self.kinematics.point.drives[joint];
        let place = (self.velocities.len(), coordinate);
        let velocity =
            self.jets.velocity(place, &self.velocities[coordinate], &self.accelerations[coordinate]);
        self.jets.mul(&self.jets.constant(self.kinematics.algebra.element(ratio)), &velocity)
    }
    fn a(&mut self, joint: usize) -> Jet<A::Value> {
        self.jets.constant(self.kinematics.a(joint))
    }
    fn b(&mut self, joint: usize) -> Jet<A::Value> {
        self.jets.constant(self.kinematics.b(joint))
    }
    fn d(&mut self, joint: usize) -> Jet<A::Value> {
        self.jets.constant(self.kinematics.d(joint))
    }
    fn ratio(&mut self, joint: usize) -> Jet<A::Value> {
        self.jets.constant(self.kinematics.ratio(joint))
    }
    fn exact(&mut self, value: &Rational) -> Jet<A::Value> {
        self.jets.constant(self.kinematics.exact(value))
    }
    /// A turn's derivative by the joint's position is that along an infinitesimal.
    fn linkage(&mut self, linkage: &Linkage) -> Option<BarTurns<Jet<A::Value>>> {
        let kinematics = &mut self.kinematics;
        let (s, c) = kinematics.joint_trig(linkage.joint);
        let algebra = kinematics.algebra;
        let turn = ((s.clone(), c.clone()), (c, algebra.neg(&s)));
        let number = |x: &Rational| (kinematics.number(x), algebra.integer(0));
        let turns = turns(&Duals(algebra), linkage, &number, &turn)?;
        Some(turns.map(|turn| turn.map(|(x, dx)| self.of_position(linkage.joint, x, dx))))
    }
    fn gravity(&mut self, axis: usize) -> Jet<A::Value> {
        match self.gravity {
            true => self.jets.constant(self.kinematics.gravity(axis)),
            false => self.jets.integer(0),
        }
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Jet<A::Value> {
        self.jets.constant(Source::symbol(&mut self.kinematics, index, sine))
    }
}
