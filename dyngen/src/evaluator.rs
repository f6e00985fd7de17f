//! The functions of an arm that is known only at run time, over blocks of samples.

use crate::base::SetKind;
use crate::dynamics::Function;
use crate::dynamics::angles::Angles;
use crate::dynamics::function::Argument;
use crate::graph::tape::{LANES, Lane, Tape};
use crate::graph::{Input, JointSum, Preparation};
use crate::model::{Error, Model};

/// Samples for an [`Evaluator`]: slices of n numbers a sample, one sample after another, and the values of
/// the parameters. What a function does not take may stay empty.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples<'a> {
    /// Joint positions, rad or m.
    pub q: &'a [f64],
    /// Joint velocities.
    pub dq: &'a [f64],
    /// Joint accelerations.
    pub ddq: &'a [f64],
    /// Reference velocities q̇ᵣ of Slotine and Li.
    pub dqr: &'a [f64],
    /// Reference accelerations q̈ᵣ.
    pub ddqr: &'a [f64],
    /// Joint torques.
    pub tau: &'a [f64],
    /// The vector that a transposed regressor is multiplied with.
    pub e: &'a [f64],
    /// A wrench on the tool's frame in base axes, six numbers a sample: force, N, above moment, N·m.
    pub f: &'a [f64],
    /// A payload on the tool's frame, ten numbers a sample: m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
    pub payload: &'a [f64],
    /// A direction in which q changes.
    pub vq: &'a [f64],
    /// A direction in which q̇ changes.
    pub vdq: &'a [f64],
    /// Parameter values, the same for all samples.
    pub parameters: &'a [f64],
}

impl<'a> Samples<'a> {
    fn of(&self, argument: Argument) -> &'a [f64] {
        match argument {
            Argument::Positions => self.q,
            Argument::Velocities => self.dq,
            Argument::Accelerations => self.ddq,
            Argument::ReferenceVelocities => self.dqr,
            Argument::ReferenceAccelerations => self.ddqr,
            Argument::Torques => self.tau,
            Argument::Errors => self.e,
            Argument::Wrench => self.f,
            Argument::Payload => self.payload,
            Argument::PositionDirection => self.vq,
            Argument::VelocityDirection => self.vdq,
            Argument::Parameters => self.parameters,
        }
    }
}

/// A function of an arm, ready to run over any number of samples.
#[derive(Clone, Debug)]
pub struct Evaluator {
    function: Function,
    shape: (usize, usize),
    dof: usize,
    parameters: usize,
    angles: Angles,
    /// The computations that depend on the parameters alone, run once for all samples.
    preparation: Tape,
    tape: Tape,
}

impl Evaluator {
    /// Builds, proves and compiles a function for a set.
    ///
    /// # Errors
    /// Those of [`Model::function`].
    pub fn new(model: &Model, function: Function, kind: SetKind) -> Result<Evaluator, Error> {
        let built = model.function(function, kind)?;
        let constants = &model.symbols().angles;
        let symbol = |index: usize, sine: bool| {
            let (s, c) = constants[index].sin_cos();
            if sine { s } else { c }
        };
        let dof = model.arm().dof();
        let mut preparation = Preparation::default();
        let built = built.without_preparation(&mut preparation);
        Ok(Evaluator {
            function,
            shape: built.shape,
            dof,
            parameters: model.set(kind)?.parameters.len(),
            angles: model.angles().clone(),
            preparation: Tape::compile(&preparation.graph(), preparation.values(), symbol),
            tape: Tape::compile(&built.graph, &built.outputs, symbol),
        })
    }

    /// Which function.
    pub fn function(&self) -> Function {
        self.function
    }

    /// Rows and columns of one result.
    pub fn shape(&self) -> (usize, usize) {
        self.shape
    }

    /// Numbers in one result, row-major.
    pub fn outputs(&self) -> usize {
        self.shape.0 * self.shape.1
    }

    /// Runs over samples that lie one after another: `q`, `dq` and `drive` hold n numbers a sample, `out`
    /// takes [`Evaluator::outputs`] numbers a sample. `drive` is q̈, or τ for forward dynamics.
    ///
    /// # Panics
    /// Those of [`Evaluator::run`].
    pub fn evaluate(&self, q: &[f64], dq: &[f64], drive: &[f64], parameters: &[f64], out: &mut [f64]) {
        self.run(&Samples { q, dq, ddq: drive, tau: drive, parameters, ..Samples::default() }, out);
    }

    /// Runs over samples that lie one after another; `out` takes [`Evaluator::outputs`] numbers a sample.
    ///
    /// # Panics
    /// If a slice that the function takes has another length than `out` needs.
    pub fn run(&self, samples: &Samples<'_>, out: &mut [f64]) {
        let (n, width) = (self.dof, self.outputs());
        let count = out.len() / width.max(1);
        for argument in self.function.arguments() {
            let (given, expected) = match argument {
                Argument::Parameters => (samples.parameters.len(), self.parameters),
                other => (samples.of(*other).len(), count * other.length(n, self.parameters)),
            };
            assert_eq!(given, expected, "{}: {expected} numbers are needed", argument.name());
        }
        let prepared = self.prepared(samples.parameters);
        let mut workspace = self.tape.workspace();
        for first in (0..count).step_by(LANES) {
            let filled = LANES.min(count - first);
            // The lanes past the end repeat the last sample, so that no arithmetic meets stale values.
            let at = |lane: usize| first + lane.min(filled - 1);
            let gather = |argument: Argument, i: usize, to: &mut Lane| {
                let (from, length) = (samples.of(argument), argument.length(n, self.parameters));
                for (lane, x) in to.iter_mut().enumerate() {
                    *x = from[at(lane) * length + i];
                }
            };
            // An angle's sine and cosine are requested one after the other.
            let mut last: Option<(JointSum, [Lane; 2])> = None;
            let mut sin_cos = |sum: JointSum| {
                let known = last.filter(|(of, _)| *of == sum);
                let (_, both) = *last.insert(known.unwrap_or_else(|| {
                    let mut both = [[0.0; LANES]; 2];
                    for lane in 0..LANES {
                        let angle = self.angles.value(sum, |i| samples.q[at(lane) * n + i]);
                        (both[0][lane], both[1][lane]) = angle.sin_cos();
                    }
                    (sum, both)
                }));
                both
            };
            self.tape.run(
                &mut workspace,
                |input, lane| match input {
                    Input::Sin(sum) => *lane = sin_cos(sum)[0],
                    Input::Cos(sum) => *lane = sin_cos(sum)[1],
                    Input::Position(i) => gather(Argument::Positions, i, lane),
                    Input::Velocity(i) => gather(Argument::Velocities, i, lane),
                    Input::Acceleration(i) => gather(Argument::Accelerations, i, lane),
                    Input::ReferenceVelocity(i) => gather(Argument::ReferenceVelocities, i, lane),
                    Input::ReferenceAcceleration(i) => gather(Argument::ReferenceAccelerations, i, lane),
                    Input::Torque(i) => gather(Argument::Torques, i, lane),
                    Input::Error(i) => gather(Argument::Errors, i, lane),
                    Input::Wrench(i) => gather(Argument::Wrench, i, lane),
                    Input::Payload(i) => gather(Argument::Payload, i, lane),
                    Input::PositionDirection(i) => gather(Argument::PositionDirection, i, lane),
                    Input::VelocityDirection(i) => gather(Argument::VelocityDirection, i, lane),
                    Input::Parameter(i) => *lane = [samples.parameters[i]; LANES],
                    Input::Prepared(i) => *lane = [prepared[i]; LANES],
                },
                |index, lane, negative| {
                    for (k, value) in lane.iter().take(filled).enumerate() {
                        out[(first + k) * width + index] = if negative { -value } else { *value };
                    }
                },
            );
        }
    }

    /// The values of the function that depend on the parameters alone.
    fn prepared(&self, parameters: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.preparation.outputs()];
        let input = |input: Input, lane: &mut Lane| {
            if let Input::Parameter(i) = input {
                *lane = [parameters[i]; LANES];
            }
        };
        let output = |index: usize, lane: &Lane, negative: bool| {
            values[index] = if negative { -lane[0] } else { lane[0] };
        };
        self.preparation.run(&mut self.preparation.workspace(), input, output);
        values
    }
}
