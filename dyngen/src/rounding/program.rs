//! One output of a function as operations over intervals, with what each of them rounds.

use super::interval::Interval;
use super::precision::Precision;
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::exact::rational;
use crate::graph::{Input, JointSum, Node};
use crate::model::Model;

/// A number that the function is given.
pub(super) type Variable = (Argument, usize);

/// An operation on earlier results.
#[derive(Clone, Debug)]
enum Operation {
    /// A constant, exact within the errors.
    Constant(Interval, [f64; 2]),
    /// One of the variables, as it is.
    Variable(usize),
    /// Sine (`true`) or cosine of an angle.
    Turned(bool, Angle),
    /// a + b or a − b
    Add(usize, usize, bool),
    Mul(usize, usize),
    Div(usize, usize),
}

/// An angle: Σ factor·variable + offset.
#[derive(Clone, Debug)]
struct Angle {
    terms: Vec<(usize, f64)>,
    offset: f64,
    /// By how much its computed value may be off, in single and in double precision.
    errors: [f64; 2],
}

/// How far emitted code may be from the exact value, in single and in double precision.
pub(super) type Errors = [f64; 2];

/// One output as a program.
#[derive(Clone, Debug)]
pub(super) struct Program {
    operations: Vec<Operation>,
    /// What it reads.
    pub(super) variables: Vec<Variable>,
}

/// Intervals for [`Program::errors`], used again from call to call.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    values: Vec<Interval>,
    slopes: Vec<Interval>,
    errors: Vec<Errors>,
}

impl Program {
    /// That of an output; `range` are the limits of what it is given.
    pub(super) fn new(
        model: &Model,
        built: &FunctionGraph,
        output: usize,
        range: &dyn Fn(Variable) -> Option<Interval>,
    ) -> Option<Program> {
        let mut program = Program { operations: Vec::new(), variables: Vec::new() };
        let graph = &built.graph;
        let mut place = vec![0; graph.nodes().len()];
        for node in graph.needed(&built.outputs[output..=output]) {
            let at = |e: crate::graph::Expr| place[e.node()];
            let operation = match graph.nodes()[node] {
                Node::Constant(index) => {
                    let exact = graph.constant(index);
                    let errors = PRECISIONS.map(|precision| precision.of_constant(exact));
                    Operation::Constant(Interval::point(rational::to_f64(exact)), errors)
                }
                Node::Symbol(index, sine) => symbol(model, index as usize, sine),
                Node::Input(Input::Sin(sum)) => Operation::Turned(true, program.angle(model, sum, range)?),
                Node::Input(Input::Cos(sum)) => Operation::Turned(false, program.angle(model, sum, range)?),
                Node::Input(input) => Operation::Variable(program.variable(variable(input)?)),
                Node::Add(a, b) => Operation::Add(at(a), at(b), b.is_negative()),
                Node::Mul(a, b) => Operation::Mul(at(a), at(b)),
                Node::Div(a, b) => Operation::Div(at(a), at(b)),
            };
            program.operations.push(operation);
            place[node] = program.operations.len() - 1;
        }
        Some(program)
    }

    /// How many operations it is.
    pub(super) fn len(&self) -> usize {
        self.operations.len()
    }

    fn variable(&mut self, variable: Variable) -> usize {
        let found = self.variables.iter().position(|v| *v == variable);
        found.unwrap_or_else(|| {
            self.variables.push(variable);
            self.variables.len() - 1
        })
    }

    /// An angle as emitted code sums it up: term by term, then the offset.
    fn angle(
        &mut self,
        model: &Model,
        sum: JointSum,
        range: &dyn Fn(Variable) -> Option<Interval>,
    ) -> Option<Angle> {
        let angles = model.angles();
        let mut angle = Angle { terms: Vec::new(), offset: angles.offset(sum), errors: [0.0; 2] };
        let mut size = 0.0;
        for (k, (joint, negative)) in sum.joints().enumerate() {
            let of = angles.joint(joint);
            let variable = (Argument::Positions, of.coordinate);
            let q = range(variable)?.magnitude();
            let factor = of.ratio.unwrap_or(1.0);
            let term = factor.abs() * q;
            size += term;
            for (error, precision) in angle.errors.iter_mut().zip(PRECISIONS) {
                if of.ratio.is_some() {
                    let of_ratio = precision.of_double(factor, Precision::Double.half_ulp(factor.abs()));
                    *error += of_ratio * q + precision.half_ulp(GROWN * term);
                }
                if k > 0 {
                    *error += precision.half_ulp(GROWN * size);
                }
            }
            angle.terms.push((self.variable(variable), if negative { -factor } else { factor }));
        }
        if angle.offset != 0.0 {
            // A sum of a few doubles, each within a few units of its last place.
            let written = 8.0 * f64::EPSILON * (1.0 + angle.offset.abs());
            size += angle.offset.abs();
            for (error, precision) in angle.errors.iter_mut().zip(PRECISIONS) {
                *error += precision.of_double(angle.offset, written) + precision.half_ulp(GROWN * size);
            }
        }
        angle.errors = angle.errors.map(|error| GROWN * error);
        Some(angle)
    }

    /// The most by which the emitted output may be off where each variable lies in its range; infinite where a divisor
    /// may be zero or a value is too large for `f32`.
    ///
    /// With δᵢ for what operation i rounds, the output is a function of all δ, and the exact one where they are zero.
    /// By the mean value theorem the two differ by Σ ∂out/∂δᵢ·δᵢ, with the derivatives at values of which each is an
    /// exact result of its operands and a part of δᵢ: between the exact and the computed ones. `values` hold all of
    /// those, so nothing of second order is left out.
    pub(super) fn errors(&self, ranges: &[Interval], workspace: &mut Workspace) -> Errors {
        match self.values(ranges, workspace) {
            Some(()) => self.sum(workspace),
            None => [f64::INFINITY; 2],
        }
    }

    /// The values with what may have been rounded in them, and how much each operation rounds.
    fn values(&self, ranges: &[Interval], workspace: &mut Workspace) -> Option<()> {
        let Workspace { values, errors, .. } = workspace;
        values.clear();
        errors.clear();
        for operation in &self.operations {
            let (value, error) = match operation {
                Operation::Constant(value, errors) => (*value, *errors),
                Operation::Variable(index) => {
                    values.push(ranges[*index]);
                    errors.push([0.0; 2]);
                    continue;
                }
                Operation::Turned(sine, angle) => angle.turned(*sine, ranges),
                Operation::Add(a, b, negative) => rounded(values[*a].plus(values[*b].negated(*negative))),
                Operation::Mul(a, b) => {
                    let product = values[*a].times(values[*b]);
                    let exact = self.is_power_of_two(*a) || self.is_power_of_two(*b);
                    if exact { (product, TINY) } else { rounded(product) }
                }
                // The quotient of the ends is one multiplication from their inverse.
                Operation::Div(a, b) => rounded(values[*a].times(values[*b].inverse()?.widened(0.0))),
            };
            let value = value.widened(error[0]);
            if !(value.magnitude() < f64::from(f32::MAX)) {
                return None;
            }
            values.push(value);
            errors.push(error);
        }
        Some(())
    }

    /// Whether products with it only change exponents.
    fn is_power_of_two(&self, operation: usize) -> bool {
        matches!(&self.operations[operation], Operation::Constant(x, _) if x.low.to_bits() << 12 == 0)
    }

    /// Σ |∂out/∂δᵢ|·|δᵢ|: derivatives from the output backwards.
    fn sum(&self, workspace: &mut Workspace) -> Errors {
        let Workspace { values, slopes, errors } = workspace;
        slopes.clear();
        slopes.resize(self.operations.len(), Interval::ZERO);
        if let Some(last) = slopes.last_mut() {
            *last = Interval::point(1.0);
        }
        let mut total = [0.0; 2];
        for (k, operation) in self.operations.iter().enumerate().rev() {
            let slope = slopes[k];
            let size = slope.magnitude();
            total[0] += size * errors[k][0];
            total[1] += size * errors[k][1];
            let mut add = |to: usize, by: Interval| slopes[to] = slopes[to].plus(by).widened(0.0);
            match operation {
                Operation::Add(a, b, negative) => {
                    add(*a, slope);
                    add(*b, slope.negated(*negative));
                }
                Operation::Mul(a, b) => {
                    add(*a, slope.times(values[*b]).widened(0.0));
                    add(*b, slope.times(values[*a]).widened(0.0));
                }
                Operation::Div(a, b) => {
                    // x/y: 1/y and −x/y²
                    let inverse = values[*b].inverse().map_or(EVERYTHING, |inverse| inverse.widened(0.0));
                    let by_a = slope.times(inverse).widened(0.0);
                    add(*a, by_a);
                    add(*b, by_a.times(values[*a].times(inverse).widened(0.0)).widened(0.0).negated(true));
                }
                Operation::Constant(..) | Operation::Variable(_) | Operation::Turned(..) => {}
            }
        }
        // The sum of n terms rounds n times, each within half an epsilon.
        total
            .map(|x| if x.is_finite() { x * (1.0 + self.len() as f64 * f64::EPSILON) } else { f64::INFINITY })
    }
}

impl Angle {
    /// The range of sine or cosine, and the error of the emitted one.
    fn turned(&self, sine: bool, ranges: &[Interval]) -> (Interval, Errors) {
        let mut angle = Interval::point(self.offset);
        for (variable, factor) in &self.terms {
            angle = angle.plus(ranges[*variable].times(Interval::point(*factor)).widened(0.0)).widened(0.0);
        }
        angle = angle.widened(self.errors[0]);
        if angle.magnitude() > LARGEST_ANGLE {
            return (EVERYTHING, [f64::INFINITY; 2]);
        }
        let (s, c) = (angle.sine(), angle.cosine());
        let (value, slope) = if sine { (s, c) } else { (c, s) };
        let of = |k: usize| GROWN * (SINE_ERROR * PRECISIONS[k].unit() + self.errors[k] * slope.magnitude());
        (value, [of(0), of(1)])
    }
}

/// A value with what its operation rounds.
#[inline]
fn rounded(value: Interval) -> (Interval, Errors) {
    // The ends are rounded themselves.
    let single = Precision::Single.half_ulp(value.magnitude() * GROWN);
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
        Input::Parameter(i) => (Argument::Parameters, i),
    })
}

const PRECISIONS: [Precision; 2] = [Precision::Single, Precision::Double];

/// Of an operation: unit by unit, 2⁻⁵³/2⁻²⁴.
const DOUBLE_BY_SINGLE: f64 = Precision::Double.unit() / Precision::Single.unit();

/// The emitted sine and cosine of an angle of the format, in units of [`Precision::unit`]: shown for every `f32`, and by
/// analysis for `f64`, up to [`LARGEST_ANGLE`].
const SINE_ERROR: f64 = 1.0;

/// In rad.
const LARGEST_ANGLE: f64 = 1000.0;

/// What an operation rounds that is exact but for subnormal results.
const TINY: Errors = [f32::MIN_POSITIVE as f64 * f32::EPSILON as f64, f64::MIN_POSITIVE];

/// For bounds of a few roundings of doubles.
const GROWN: f64 = 1.0 + 1e-12;

const EVERYTHING: Interval = Interval { low: f64::NEG_INFINITY, high: f64::INFINITY };
