//! The functions of an arm that is known only at run time, over blocks of samples.

use crate::base::SetKind;
use crate::dynamics::Function;
use crate::dynamics::function::trig_offset;
use crate::graph::Input;
use crate::graph::tape::{LANES, Lane, Tape};
use crate::model::{Error, Model};

/// A function of an arm, ready to run over any number of samples.
#[derive(Clone, Debug)]
pub struct Evaluator {
    function: Function,
    shape: (usize, usize),
    dof: usize,
    parameters: usize,
    offsets: Vec<f64>,
    tape: Tape,
}

impl Evaluator {
    /// Builds, proves and compiles a function for a set.
    ///
    /// # Errors
    /// As [`Model::function`].
    pub fn new(model: &Model, function: Function, kind: SetKind) -> Result<Evaluator, Error> {
        let built = model.function(function, kind)?;
        let angles = &model.symbols().angles;
        let symbol = |index: usize, sine: bool| {
            let (s, c) = angles[index].sin_cos();
            if sine { s } else { c }
        };
        let dof = model.arm().dof();
        Ok(Evaluator {
            function,
            shape: built.shape,
            dof,
            parameters: model.set(kind)?.parameters.len(),
            offsets: (0..dof).map(|i| trig_offset(model.arm(), i)).collect(),
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

    /// Runs over samples that lie one after another: `q`, `dq` and `drive` hold n numbers a sample, `out` takes
    /// [`Evaluator::outputs`] numbers a sample.
    ///
    /// `drive` is q̈, or τ for forward dynamics. Slices that the function does not need may be empty, others must all
    /// hold the same number of samples.
    ///
    /// # Panics
    /// Where a slice that is needed has another length than `out` asks for.
    pub fn evaluate(&self, q: &[f64], dq: &[f64], drive: &[f64], parameters: &[f64], out: &mut [f64]) {
        let (n, width) = (self.dof, self.outputs());
        let samples = out.len() / width.max(1);
        assert_eq!(q.len(), samples * n, "q must hold {n} numbers for each sample of out");
        let needs = |needed: bool, slice: &[f64], name: &str| {
            assert!(
                !needed || slice.len() == samples * n,
                "{name} must hold {n} numbers for each sample of out"
            );
        };
        needs(self.function.takes_speeds(), dq, "dq");
        needs(self.function.takes_accelerations() || self.function.takes_torques(), drive, "ddq or tau");
        assert!(
            !self.function.takes_parameters() || parameters.len() == self.parameters,
            "{} parameters are needed, {} were given",
            self.parameters,
            parameters.len()
        );
        let mut workspace = self.tape.workspace();
        for first in (0..samples).step_by(LANES) {
            let count = LANES.min(samples - first);
            // The lanes past the end repeat the last sample, so that no arithmetic meets stale values.
            let at = |lane: usize| (first + lane.min(count - 1)) * n;
            let gather = |from: &[f64], i: usize, to: &mut Lane| {
                for (lane, x) in to.iter_mut().enumerate() {
                    *x = from[at(lane) + i];
                }
            };
            self.tape.run(
                &mut workspace,
                |input, lane| match input {
                    Input::Sin(i) => {
                        gather(q, i, lane);
                        lane.iter_mut().for_each(|x| *x = (*x + self.offsets[i]).sin());
                    }
                    Input::Cos(i) => {
                        gather(q, i, lane);
                        lane.iter_mut().for_each(|x| *x = (*x + self.offsets[i]).cos());
                    }
                    Input::Position(i) => gather(q, i, lane),
                    Input::Speed(i) => gather(dq, i, lane),
                    Input::Acceleration(i) | Input::Torque(i) => gather(drive, i, lane),
                    Input::Parameter(i) => *lane = [parameters[i]; LANES],
                },
                |index, lane, negative| {
                    for (k, value) in lane.iter().take(count).enumerate() {
                        out[(first + k) * width + index] = if negative { -value } else { *value };
                    }
                },
            );
        }
    }
}
