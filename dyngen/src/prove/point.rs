//! A random point: a pose of the arm, rates, and values of its parameters, modulo the prime.

use crate::arm::{Arm, Drive, Parameter};
use crate::base::Sets;
use crate::dynamics::function::Argument;
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::prime::{Draws, Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::graph::evaluate::sine_and_cosine;
use crate::graph::{Expr, Input, evaluate};
use crate::lagrangian::followers::{closing_angles, still_angles, with_theta};
use crate::parameters::{Combination, ParameterSet};

/// A pose, rates and parameter values.
#[derive(Clone)]
pub(crate) struct Point<'a> {
    pub(super) arm: &'a Arm,
    pub(super) symbols: &'a AngleSymbols,
    pub(super) sets: &'a Sets,
    /// How every joint moves with the coordinates.
    pub(super) drives: Vec<Motion>,
    /// Sine and cosine of each revolute joint's trigonometric input.
    angles: Vec<(Fp, Fp)>,
    /// The coordinates q, where they are taken as they are: as good as free of their sines and cosines.
    positions: Vec<Fp>,
    pub(super) velocities: Vec<Fp>,
    pub(super) accelerations: Vec<Fp>,
    pub(super) reference_velocities: Vec<Fp>,
    pub(super) reference_accelerations: Vec<Fp>,
    pub(super) errors: Vec<Fp>,
    /// A wrench on the tool's frame.
    pub(super) wrench: Vec<Fp>,
    /// A payload's ten parameters in the tool's frame.
    pub(super) payload: Vec<Fp>,
    /// Whether the arm carries it.
    pub(super) loaded: bool,
    /// A direction in which q changes.
    pub(super) position_direction: Vec<Fp>,
    /// A direction in which q̇ changes.
    pub(super) velocity_direction: Vec<Fp>,
    /// Values of the arm's kept parameters.
    values: Vec<(Parameter, Fp)>,
}

/// How a joint moves with the coordinates, modulo the prime.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    pub(super) coordinate: usize,
    pub(super) ratio: Fp,
    offset: Fp,
}

impl Motion {
    fn of(drive: &Drive) -> Motion {
        Motion { coordinate: drive.coordinate, ratio: residue(&drive.ratio), offset: residue(&drive.offset) }
    }
}

/// A number of the arm modulo the prime. One with the prime in its denominator was refused when the sets were
/// derived.
fn residue(x: &Rational) -> Fp {
    Fp::from_rational(x).unwrap_or(Fp::ZERO)
}

impl<'a> Point<'a> {
    pub(crate) fn draw(arm: &'a Arm, symbols: &'a AngleSymbols, sets: &'a Sets, draws: &mut Draws) -> Self {
        let angles = closing_angles(arm, &residue, &mut |_| draws.element().circle_point());
        let positions = (0..arm.dof()).map(|_| draws.element()).collect();
        let values = arm.kept_parameters().into_iter().map(|p| (p, draws.element())).collect();
        let mut vector = || (0..arm.dof()).map(|_| draws.element()).collect::<Vec<_>>();
        Point {
            arm,
            symbols,
            sets,
            drives: arm.drives().iter().map(Motion::of).collect(),
            angles,
            positions,
            velocities: vector(),
            accelerations: vector(),
            reference_velocities: vector(),
            reference_accelerations: vector(),
            errors: vector(),
            position_direction: vector(),
            velocity_direction: vector(),
            wrench: (0..6).map(|_| draws.element()).collect(),
            payload: (0..10).map(|_| draws.element()).collect(),
            loaded: false,
            values,
        }
    }

    /// The values of this point at the pose where every coordinate's input angle is zero, or another one
    /// where loops do not close there.
    pub(crate) fn at_zero(&self) -> Point<'a> {
        Point {
            angles: still_angles(self.arm, &residue),
            positions: vec![Fp::ZERO; self.positions.len()],
            ..self.clone()
        }
    }

    /// The point with the payload that a function takes.
    pub(crate) fn seen_by(&self, function: Function) -> Point<'a> {
        Point { loaded: function.takes(Argument::Payload), ..self.clone() }
    }

    /// This point with the payload on the tool's frame.
    pub(super) fn with_payload(&self) -> Point<'a> {
        Point { loaded: true, ..self.clone() }
    }

    /// Sets the parameters' values so that a set's sums have given values: each on its carriers.
    pub(crate) fn carry(&mut self, set: &ParameterSet, values: &[Rational]) {
        self.values.iter_mut().for_each(|(_, value)| *value = Fp::ZERO);
        for (parameter, sum) in set.parameters.iter().zip(values) {
            let sum = residue(sum);
            for (carrier, factor) in &parameter.carriers {
                let factor = self.sets.field.modular(factor).unwrap_or(Fp::ZERO);
                for (_, value) in self.values.iter_mut().filter(|(p, _)| p == carrier) {
                    *value = *value + factor * sum;
                }
            }
        }
    }

    pub(crate) fn dof(&self) -> usize {
        self.arm.dof()
    }

    /// Sine and cosine of q + theta.
    pub(super) fn joint_trig(&self, joint: usize) -> (Fp, Fp) {
        with_theta(&PrimeField, &self.arm.joints[joint].theta, self.angles[joint])
    }

    /// q of a prismatic joint.
    pub(crate) fn joint_position(&self, joint: usize) -> Fp {
        let drive = &self.drives[joint];
        drive.ratio * self.positions[drive.coordinate] + drive.offset
    }

    /// The sum of the parameters' columns with their values.
    pub(super) fn weigh(&self, columns: &[Vec<Fp>]) -> Vec<Fp> {
        let mut sum = vec![Fp::ZERO; columns.first().map_or(0, Vec::len)];
        for (parameter, value) in &self.values {
            for (total, entry) in sum.iter_mut().zip(&columns[parameter.index()]) {
                *total = *total + *value * *entry;
            }
        }
        // The payload's columns come last, where the arm carries it.
        let payload = columns.iter().skip(self.arm.all_parameters().len());
        for (value, column) in self.payload.iter().zip(payload) {
            for (total, entry) in sum.iter_mut().zip(column) {
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

    /// The values of a function's argument.
    pub(crate) fn argument(&self, set: &ParameterSet, argument: Argument) -> Vec<Fp> {
        match argument {
            Argument::Positions => self.positions.clone(),
            Argument::Velocities => self.velocities.clone(),
            Argument::Accelerations => self.accelerations.clone(),
            Argument::ReferenceVelocities => self.reference_velocities.clone(),
            Argument::ReferenceAccelerations => self.reference_accelerations.clone(),
            Argument::Errors => self.errors.clone(),
            Argument::Wrench => self.wrench.clone(),
            Argument::Payload => self.payload.clone(),
            Argument::PositionDirection => self.position_direction.clone(),
            Argument::VelocityDirection => self.velocity_direction.clone(),
            // Forward dynamics gets the torques of the point's motion and must give its accelerations back.
            Argument::Torques => self.state(&self.velocities, &self.accelerations, true).torques(),
            Argument::Parameters => set.parameters.iter().map(|p| self.sum(&p.terms)).collect(),
        }
    }

    /// The function's graph at this point, with the set's sums of the parameter values.
    pub(super) fn evaluate(&self, set: &ParameterSet, function: &FunctionGraph) -> Option<Vec<Fp>> {
        let nodes = self.nodes(set, function)?;
        let of = |e: &Expr| nodes[e.node()].map(|x| if e.is_negative() { -x } else { x });
        function.outputs.iter().map(of).collect()
    }

    /// As [`Self::evaluate`], the values of all nodes of the graph that the function needs.
    pub(crate) fn nodes(&self, set: &ParameterSet, function: &FunctionGraph) -> Option<Vec<Option<Fp>>> {
        let sums = self.argument(set, Argument::Parameters);
        let torques = match function.function.takes(Argument::Torques) {
            true => self.seen_by(function.function).argument(set, Argument::Torques),
            false => Vec::new(),
        };
        let input = |input: Input| match input {
            Input::Sin(sum) => sine_and_cosine(sum, &|i| self.angles[i]).0,
            Input::Cos(sum) => sine_and_cosine(sum, &|i| self.angles[i]).1,
            Input::Position(i) => self.positions[i],
            Input::Velocity(i) => self.velocities[i],
            Input::Acceleration(i) => self.accelerations[i],
            Input::ReferenceVelocity(i) => self.reference_velocities[i],
            Input::ReferenceAcceleration(i) => self.reference_accelerations[i],
            Input::Error(i) => self.errors[i],
            Input::Wrench(i) => self.wrench[i],
            Input::Payload(i) => self.payload[i],
            Input::PositionDirection(i) => self.position_direction[i],
            Input::VelocityDirection(i) => self.velocity_direction[i],
            Input::Torque(i) => torques[i],
            Input::Parameter(i) => sums[i],
            // Proven is the function with its preparation; a value of its own has none here.
            Input::Prepared(_) => Fp::ZERO,
        };
        let symbol = |index, sine| self.sets.field.modular_symbol(index, sine);
        evaluate::nodes(&function.graph, &function.outputs, input, symbol)
    }

    fn sum(&self, terms: &Combination) -> Fp {
        terms.iter().fold(Fp::ZERO, |sum, (parameter, factor)| {
            let value = self.values.iter().find(|(p, _)| p == parameter).map_or(Fp::ZERO, |(_, v)| *v);
            sum + self.sets.field.modular(factor).unwrap_or(Fp::ZERO) * value
        })
    }
}
