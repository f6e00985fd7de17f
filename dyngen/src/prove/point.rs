//! A random point: a pose of the arm, rates, and values of its parameters, modulo the prime.

use crate::arm::{Arm, JointKind, Parameter};
use crate::base::Sets;
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::exact::prime::{Draws, Fp};
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::graph::evaluate::sine_and_cosine;
use crate::graph::{Input, evaluate};
use crate::parameters::{Combination, ParameterSet};

/// A pose, rates and parameter values.
pub(super) struct Point<'a> {
    pub(super) arm: &'a Arm,
    pub(super) symbols: &'a AngleSymbols,
    pub(super) sets: &'a Sets,
    /// For a revolute joint sine and cosine of its trigonometric input, for a prismatic one q twice.
    pub(super) positions: Vec<(Fp, Fp)>,
    pub(super) velocities: Vec<Fp>,
    pub(super) accelerations: Vec<Fp>,
    pub(super) reference_velocities: Vec<Fp>,
    pub(super) reference_accelerations: Vec<Fp>,
    pub(super) errors: Vec<Fp>,
    /// Values of the arm's kept parameters.
    values: Vec<(Parameter, Fp)>,
}

impl<'a> Point<'a> {
    pub(super) fn draw(arm: &'a Arm, symbols: &'a AngleSymbols, sets: &'a Sets, draws: &mut Draws) -> Self {
        let positions = arm
            .joints
            .iter()
            .map(|joint| match joint.kind {
                JointKind::Revolute => draws.element().circle_point(),
                JointKind::Prismatic => {
                    let q = draws.element();
                    (q, q)
                }
            })
            .collect();
        let values = arm.kept_parameters().into_iter().map(|p| (p, draws.element())).collect();
        let mut vector = || (0..arm.dof()).map(|_| draws.element()).collect::<Vec<_>>();
        Point {
            arm,
            symbols,
            sets,
            positions,
            velocities: vector(),
            accelerations: vector(),
            reference_velocities: vector(),
            reference_accelerations: vector(),
            errors: vector(),
            values,
        }
    }

    /// The same values at the pose where every input angle is zero.
    pub(super) fn at_zero(&self) -> Point<'a> {
        let zero = |joint: &crate::arm::Joint| match joint.kind {
            JointKind::Revolute => (Fp::ZERO, Fp::ONE),
            JointKind::Prismatic => (Fp::ZERO, Fp::ZERO),
        };
        Point {
            positions: self.arm.joints.iter().map(zero).collect(),
            velocities: self.velocities.clone(),
            accelerations: self.accelerations.clone(),
            reference_velocities: self.reference_velocities.clone(),
            reference_accelerations: self.reference_accelerations.clone(),
            errors: self.errors.clone(),
            values: self.values.clone(),
            ..*self
        }
    }

    /// Sets the parameters' values so that a set's sums have given values: each on its carriers.
    pub(super) fn carry(&mut self, set: &ParameterSet, values: &[Rational]) {
        self.values.iter_mut().for_each(|(_, value)| *value = Fp::ZERO);
        for (parameter, sum) in set.parameters.iter().zip(values) {
            let sum = Fp::from_rational(sum).unwrap_or(Fp::ZERO);
            for (carrier, factor) in &parameter.carriers {
                let factor = self.sets.field.modular(factor).unwrap_or(Fp::ZERO);
                for (_, value) in self.values.iter_mut().filter(|(p, _)| p == carrier) {
                    *value = *value + factor * sum;
                }
            }
        }
    }

    pub(super) fn dof(&self) -> usize {
        self.arm.dof()
    }

    /// Sine and cosine of q + theta: by the addition theorem where theta is a multiple of pi/2; the input
    /// holds any other theta.
    pub(super) fn joint_trig(&self, joint: usize) -> (Fp, Fp) {
        let (sin, cos) = self.positions[joint];
        let (st, ct) = match self.arm.joints[joint].theta.quarter_turns() {
            None => (Fp::ZERO, Fp::ONE),
            Some(turns) => {
                let cycle = [0, 1, 0, -1].map(Fp::from_integer);
                (cycle[usize::from(turns % 4)], cycle[usize::from((turns + 1) % 4)])
            }
        };
        (sin * ct + cos * st, cos * ct - sin * st)
    }

    /// The sum of the parameters' columns with their values.
    pub(super) fn weigh(&self, columns: &[Vec<Fp>]) -> Vec<Fp> {
        let mut sum = vec![Fp::ZERO; columns.first().map_or(0, Vec::len)];
        for (parameter, value) in &self.values {
            for (total, entry) in sum.iter_mut().zip(&columns[parameter.index()]) {
                *total = *total + *value * *entry;
            }
        }
        sum
    }

    /// The columns of a set are those of its carriers; row-major.
    pub(super) fn of_set(&self, set: &ParameterSet, columns: &[Vec<Fp>]) -> Vec<Fp> {
        let rows = columns.first().map_or(0, Vec::len);
        let p = set.parameters.len();
        let mut matrix = vec![Fp::ZERO; rows * p];
        for (c, parameter) in set.parameters.iter().enumerate() {
            for (carrier, factor) in &parameter.carriers {
                let factor = self.sets.field.modular(factor).unwrap_or(Fp::ZERO);
                for i in 0..rows {
                    matrix[i * p + c] = matrix[i * p + c] + factor * columns[carrier.index()][i];
                }
            }
        }
        matrix
    }

    /// The function's graph at this point, with the set's sums of the parameter values.
    pub(super) fn evaluate(&self, set: &ParameterSet, function: &FunctionGraph) -> Option<Vec<Fp>> {
        let sums: Vec<Fp> = set.parameters.iter().map(|p| self.sum(&p.terms)).collect();
        // Forward dynamics gets the torques of the point's motion and must give its accelerations back.
        let torques = match function.function.takes(Argument::Torques) {
            true => self.state(&self.velocities, &self.accelerations, true).torques(),
            false => Vec::new(),
        };
        let input = |input: Input| match input {
            Input::Sin(sum) => sine_and_cosine(sum, &|i| self.positions[i]).0,
            Input::Cos(sum) => sine_and_cosine(sum, &|i| self.positions[i]).1,
            Input::Position(i) => self.positions[i].0,
            Input::Velocity(i) => self.velocities[i],
            Input::Acceleration(i) => self.accelerations[i],
            Input::ReferenceVelocity(i) => self.reference_velocities[i],
            Input::ReferenceAcceleration(i) => self.reference_accelerations[i],
            Input::Error(i) => self.errors[i],
            Input::Torque(i) => torques[i],
            Input::Parameter(i) => sums[i],
            // Proven is the function with its preparation; a value of its own has none here.
            Input::Prepared(_) => Fp::ZERO,
        };
        let symbol = |index, sine| self.sets.field.modular_symbol(index, sine);
        evaluate::evaluate(&function.graph, &function.outputs, input, symbol)
    }

    fn sum(&self, terms: &Combination) -> Fp {
        terms.iter().fold(Fp::ZERO, |sum, (parameter, factor)| {
            let value = self.values.iter().find(|(p, _)| p == parameter).map_or(Fp::ZERO, |(_, v)| *v);
            sum + self.sets.field.modular(factor).unwrap_or(Fp::ZERO) * value
        })
    }
}
