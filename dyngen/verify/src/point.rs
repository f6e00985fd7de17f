//! A random point of the prime field: a pose of the arm, rates, and values of its parameters.

use crate::angles::Circle;
use crate::dual::Dual;
use crate::lagrangian::{Chain, FIRST, SECOND};
use crate::linkage::{self, close};
use dyngen_arm::arm::Arm;
use dyngen_arm::exact::prime::{Draws, Fp};
use dyngen_arm::exact::symbols::AngleSymbols;
use dyngen_arm::function::{Argument, Function};

/// A pose, rates and parameter values.
#[derive(Clone)]
pub(crate) struct Point<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) circle: Circle,
    /// The element that stands for pi: as good as free of all others.
    pub(crate) pi: Fp,
    /// The coordinates as numbers, as good as free of their sines and cosines.
    pub(crate) q: Vec<Fp>,
    /// The vectors that functions take; those for each joint, a wrench, a payload.
    vectors: Vec<(Argument, Vec<Fp>)>,
    /// Values of all parameters, eleven a body; zero where they are declared so.
    pub(crate) values: Vec<Fp>,
}

impl<'a> Point<'a> {
    /// A random one; `constants` are the constant angles of the arm with all its frames.
    pub(crate) fn draw(arm: &'a Arm, constants: &AngleSymbols, draws: &mut Draws) -> Point<'a> {
        let circle = closing(arm, |_| Circle::draw(arm, constants, draws));
        let pi = draws.element();
        let n = arm.dof();
        let q = (0..n).map(|_| draws.element()).collect();
        let taken = [
            Argument::Velocities,
            Argument::Accelerations,
            Argument::ReferenceVelocities,
            Argument::ReferenceAccelerations,
            Argument::Errors,
            Argument::Wrench,
            Argument::Payload,
            Argument::PositionDirection,
            Argument::VelocityDirection,
        ];
        let vectors =
            taken.map(|a| (a, (0..a.length(n, 0)).map(|_| draws.element()).collect::<Vec<_>>())).into();
        let mut value = |p| if arm.keeps(p) { draws.element() } else { Fp::ZERO };
        let values = arm.all_parameters().into_iter().map(&mut value).collect();
        Point { arm, circle, pi, q, vectors, values }
    }

    /// This point where every coordinate with its theta is zero, or where all have another angle if loops do
    /// not close there.
    pub(crate) fn at_zero(&self) -> Point<'a> {
        Point {
            circle: closing(self.arm, |k| self.circle.at(k)),
            q: vec![Fp::ZERO; self.q.len()],
            ..self.clone()
        }
    }

    /// The numbers of which the arm's loops have roots.
    pub(crate) fn squares(&self) -> Vec<Fp> {
        linkage::at(self.arm, &self.circle).flatten().map(|[_, square]| square.at(0)).collect()
    }

    pub(crate) fn dof(&self) -> usize {
        self.q.len()
    }

    /// A vector that was drawn.
    pub(crate) fn vector(&self, argument: Argument) -> &[Fp] {
        self.vectors.iter().find(|(a, _)| *a == argument).map_or(&[], |(_, vector)| vector)
    }

    /// The values of an argument of a function; parameters are `sums` of those of the arm.
    pub(crate) fn argument(&self, function: Function, argument: Argument, sums: &[Vec<Fp>]) -> Vec<Fp> {
        match argument {
            Argument::Positions => self.q.clone(),
            Argument::Parameters => sums.iter().map(|sum| dot(sum, &self.values)).collect(),
            // Forward dynamics gets the torques of the point's motion and must give its accelerations back.
            Argument::Torques => self.torques(function.takes(Argument::Payload)),
            drawn => self.vector(drawn).to_vec(),
        }
    }

    /// The arm where each coordinate changes by some infinitesimals.
    pub(crate) fn chain(&self, change: Vec<Dual>) -> Chain<'_> {
        Chain { arm: self.arm, circle: &self.circle, q: &self.q, change }
    }
}

/// Points that are tried until one is found at which all loops close.
const TRIES: i64 = 1 << 12;

/// The first of some circles at which all loops of an arm close.
fn closing(arm: &Arm, mut circle: impl FnMut(i64) -> Circle) -> Circle {
    let mut found = circle(0);
    for k in 1..TRIES {
        if close(arm, &found) {
            break;
        }
        found = circle(k);
    }
    found
}

/// A motion: the coordinates along a first and a second direction, with the accelerations of both together.
pub(crate) fn motion(first: &[Fp], second: &[Fp], accelerations: &[Fp]) -> Vec<Dual> {
    let along = |i: usize| {
        let sum = &Dual::along(FIRST, first[i]) + &Dual::along(SECOND, second[i]);
        &sum + &Dual::along(FIRST | SECOND, accelerations[i])
    };
    (0..first.len()).map(along).collect()
}

pub(crate) fn dot(a: &[Fp], b: &[Fp]) -> Fp {
    a.iter().zip(b).fold(Fp::ZERO, |sum, (x, y)| sum + *x * *y)
}
