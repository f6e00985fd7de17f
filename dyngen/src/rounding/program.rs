//! One output of a function as operations over intervals, with what each of them rounds and its derivatives.

use super::angle::Angle;
use super::interval::Interval;
use super::known::{Facts, KnownProgram};
use super::norms::{self, Norm};
use super::precision::{PRECISIONS, Precision};
use super::slopes;
use super::{Divisor, divisor};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::exact::rational;
use crate::graph::{Expr, Input, JointSum, Node};
use crate::model::Model;

/// A number that the function is given.
pub(super) type Variable = (Argument, usize);

/// How far emitted code may be from the exact value, in single and in double precision.
pub(super) type Errors = [f64; 2];

/// An operation on earlier results.
#[derive(Clone, Copy, Debug)]
pub(super) enum Operation {
    /// A constant, exact within the errors.
    Constant(Interval, Errors),
    /// One of the variables, as it is.
    Variable(usize),
    /// Sine of one of the angles.
    Sine(usize),
    /// Cosine of one of the angles.
    Cosine(usize),
    /// a + b or a − b
    Add(usize, usize, bool),
    /// a·b
    Mul(usize, usize),
    /// a/b
    Div(usize, usize),
}

/// What the emitted code of some outputs does, operation by operation.
#[derive(Clone, Debug)]
pub(super) struct Emitted {
    pub(super) operations: Vec<Operation>,
    /// Of each operation its node in the function's graph.
    pub(super) nodes: Vec<usize>,
    /// Whether it is a product that is formed within a sum, which rounds for both.
    pub(super) within: Vec<bool>,
    pub(super) angles: Vec<(JointSum, Angle)>,
    /// What it reads.
    pub(super) variables: Vec<Variable>,
}

impl Emitted {
    /// `None` where the function reads prepared parameters.
    pub(super) fn new(model: &Model, built: &FunctionGraph, outputs: &[Expr]) -> Option<Emitted> {
        let graph = &built.graph;
        let nodes = graph.needed(outputs);
        let contraction = built.contraction();
        let within = nodes.iter().map(|node| contraction.is_within(*node)).collect();
        let (operations, angles, variables) = (Vec::new(), Vec::new(), Vec::new());
        let mut emitted = Emitted { operations, nodes, within, angles, variables };
        let mut place = vec![0; graph.nodes().len()];
        for k in 0..emitted.nodes.len() {
            let node = emitted.nodes[k];
            place[node] = k;
            let at = |e: Expr| place[e.node()];
            let operation = match graph.nodes()[node] {
                Node::Constant(index) => {
                    let exact = graph.constant(index);
                    let errors = PRECISIONS.map(|precision| precision.of_constant(exact));
                    Operation::Constant(Interval::point(rational::to_f64(exact)), errors)
                }
                Node::Symbol(index, sine) => symbol(model, index as usize, sine),
                Node::Input(Input::Sin(sum)) => Operation::Sine(emitted.angle(model, sum)),
                Node::Input(Input::Cos(sum)) => Operation::Cosine(emitted.angle(model, sum)),
                Node::Input(input) => Operation::Variable(emitted.variable(variable(input)?)),
                Node::Add(a, b) => Operation::Add(at(a), at(b), b.is_negative()),
                Node::Mul(a, b) => Operation::Mul(at(a), at(b)),
                Node::Div(a, b) => Operation::Div(at(a), at(b)),
                // Of loops that are no parallelograms; no bounds are asked for.
                Node::Sqrt(_) => return None,
            };
            emitted.operations.push(operation);
        }
        Some(emitted)
    }

    fn variable(&mut self, variable: Variable) -> usize {
        let found = self.variables.iter().position(|v| *v == variable);
        found.unwrap_or_else(|| {
            self.variables.push(variable);
            self.variables.len() - 1
        })
    }

    fn angle(&mut self, model: &Model, sum: JointSum) -> usize {
        if let Some(found) = self.angles.iter().position(|(known, _)| *known == sum) {
            return found;
        }
        let angle = Angle::new(model.angles(), sum, |variable| self.variable(variable));
        self.angles.push((sum, angle));
        self.angles.len() - 1
    }
}

/// One output as a program: the emitted operations, then those of the output's derivatives by what each of
/// them rounds.
#[derive(Clone, Debug)]
pub(super) struct Program {
    /// The emitted operations stand first; the rest is computed here alone and rounds nothing.
    pub(super) operations: Vec<Operation>,
    pub(super) emitted: usize,
    /// Those that round nothing, because the sum that they are in does: emitted products.
    within: Vec<bool>,
    /// Of each emitted operation the derivative of the output by it.
    pub(super) slopes: Vec<Option<usize>>,
    /// Better bounds for some operations.
    pub(super) norms: Vec<Option<Norm>>,
    /// What is known of some where B is divided by.
    known: Option<KnownProgram>,
    /// Whether what is known holds for some states within the limits alone.
    pub(super) restricted: bool,
    pub(super) angles: Vec<(JointSum, Angle)>,
    /// What it reads.
    pub(super) variables: Vec<Variable>,
}

/// Intervals for [`Program::errors`], used again from call to call.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    pub(super) values: Vec<Interval>,
    pub(super) errors: Vec<Errors>,
    /// How far the emitted value is from the exact one.
    pub(super) deviations: Vec<Errors>,
}

impl Program {
    /// That of an output; `None` where the function reads prepared parameters.
    pub(super) fn new(
        model: &Model,
        built: &FunctionGraph,
        output: usize,
        facts: Option<&Facts<'_>>,
    ) -> Option<Program> {
        let Emitted { mut operations, nodes, within, angles, variables } =
            Emitted::new(model, built, &built.outputs[output..=output])?;
        let emitted = operations.len();
        let slopes = slopes::append(&mut operations);
        let norms = norms::of(&operations);
        let known = match facts {
            Some(facts) => Some(facts.of(&operations, &nodes)?),
            None => None,
        };
        let restricted = divisor(built.function).is_some_and(Divisor::is_restricted);
        Some(Program { operations, emitted, within, slopes, norms, known, restricted, angles, variables })
    }

    /// How many operations it is.
    pub(super) fn len(&self) -> usize {
        self.operations.len()
    }

    /// The most by which the emitted output may be off where each variable lies in its range; infinite where
    /// a divisor may be zero or a value is too large for `f32`.
    ///
    /// With δᵢ for what operation i rounds, the output is a function of all δ, and the exact one where they
    /// are zero. By the mean value theorem the two differ by Σ ∂out/∂δᵢ·δᵢ, with the derivatives at some t·δ,
    /// 0 ≤ t ≤ 1. The intervals hold the values of all operations for all such t, so nothing of second order
    /// is left out.
    pub(super) fn errors(&self, ranges: &[Interval], workspace: &mut Workspace) -> Errors {
        if let Some(known) = &self.known {
            return self.errors_from_exact(known, ranges, workspace).unwrap_or([f64::INFINITY; 2]);
        }
        if self.evaluate(ranges, workspace).is_none() {
            return [f64::INFINITY; 2];
        }
        let mut total = [0.0; 2];
        for (slope, error) in self.slopes.iter().zip(&workspace.errors) {
            if let Some(slope) = slope {
                let size = workspace.values[*slope].magnitude();
                total[0] += size * error[0];
                total[1] += size * error[1];
            }
        }
        // A sum of n terms rounds n times, each within half an epsilon.
        total.map(|x| x * (1.0 + self.len() as f64 * f64::EPSILON))
    }

    /// The values of all operations with what may have been rounded in them, and how much each emitted one
    /// rounds.
    fn evaluate(&self, ranges: &[Interval], workspace: &mut Workspace) -> Option<()> {
        let Workspace { values, errors, .. } = workspace;
        values.clear();
        errors.clear();
        for (k, operation) in self.operations.iter().enumerate() {
            let of = |index: usize| values[index];
            let (value, mut error) = match *operation {
                Operation::Constant(value, errors) => (value, errors),
                Operation::Variable(index) => (ranges[index], EXACT),
                Operation::Sine(index) => self.angles[index].1.turned(true, ranges)?,
                Operation::Cosine(index) => self.angles[index].1.turned(false, ranges)?,
                Operation::Add(a, b, negative) => rounded(of(a).plus(of(b).negated(negative))),
                Operation::Mul(a, b) => {
                    let product = of(a).times(of(b));
                    let exact = self.is_power_of_two(a) || self.is_power_of_two(b);
                    if exact { (product, TINY) } else { rounded(product) }
                }
                Operation::Div(a, b) => rounded(of(a).times(of(b).inverse()?.widened(0.0))),
            };
            if self.rounds_nothing(k) {
                error = EXACT;
            }
            let mut value = value.widened(error[0]);
            errors.push(error);
            if let Some(norm) = &self.norms[k] {
                value = value.clamped(norm.bound(values, errors));
            }
            // Not so where it is no number, too.
            if value.magnitude() >= f64::from(f32::MAX) || value.magnitude().is_nan() {
                return None;
            }
            values.push(value);
        }
        Some(())
    }

    /// Whether an operation is computed here alone, or within a sum.
    pub(super) fn rounds_nothing(&self, operation: usize) -> bool {
        self.within.get(operation).is_none_or(|within| *within)
    }

    /// Whether products with it only change exponents.
    pub(super) fn is_power_of_two(&self, operation: usize) -> bool {
        matches!(&self.operations[operation], Operation::Constant(x, _) if x.low.to_bits() << 12 == 0)
    }
}

/// A value with what its operation rounds.
#[inline]
fn rounded(value: Interval) -> (Interval, Errors) {
    // The ends are rounded themselves.
    let single = Precision::Single.half_ulp(value.magnitude() * (1.0 + 4.0 * f64::EPSILON));
    (value, [single, single * DOUBLE_BY_SINGLE])
}

/// Sine or cosine of an angle of the arm.
fn symbol(model: &Model, index: usize, sine: bool) -> Operation {
    let angle = &model.symbols().angles[index];
    let (s, c) = angle.sin_cos();
    let value = if sine { s } else { c };
    // The angle is a double, and so is its sine.
    let error = f64::EPSILON * (2.0 + 2.0 * angle.radians().abs());
    Operation::Constant(Interval::point(value), PRECISIONS.map(|p| p.of_double(value, error)))
}

/// An input other than a sine or a cosine; parameters are not prepared here.
pub(super) fn variable(input: Input) -> Option<Variable> {
    Some(match input {
        Input::Sin(_) | Input::Cos(_) | Input::Prepared(_) => return None,
        Input::Position(i) => (Argument::Positions, i),
        Input::Velocity(i) => (Argument::Velocities, i),
        Input::Acceleration(i) => (Argument::Accelerations, i),
        Input::Torque(i) => (Argument::Torques, i),
        Input::ReferenceVelocity(i) => (Argument::ReferenceVelocities, i),
        Input::ReferenceAcceleration(i) => (Argument::ReferenceAccelerations, i),
        Input::Error(i) => (Argument::Errors, i),
        Input::Wrench(i) => (Argument::Wrench, i),
        Input::Payload(i) => (Argument::Payload, i),
        Input::PositionDirection(i) => (Argument::PositionDirection, i),
        Input::VelocityDirection(i) => (Argument::VelocityDirection, i),
        Input::Parameter(i) => (Argument::Parameters, i),
    })
}

/// Of an operation: unit by unit, 2⁻⁵³/2⁻²⁴.
const DOUBLE_BY_SINGLE: f64 = Precision::Double.unit() / Precision::Single.unit();

/// Of what rounds nothing.
pub(super) const EXACT: Errors = [0.0; 2];

/// What an operation rounds that is exact but for subnormal results.
pub(super) const TINY: Errors = [f32::MIN_POSITIVE as f64 * f32::EPSILON as f64, f64::MIN_POSITIVE];
