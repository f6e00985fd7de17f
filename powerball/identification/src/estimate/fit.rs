//! The fit of rows in memory, with the columns of further terms.

use super::design::{Design, Folds, Gram, runs};
use super::solve::{NormalEquations, Solver, dot};
use super::variable_projection;
use super::variable_projection::{
    FRICTION, Layout, Scatter, SeparableRows, Start, Trials, variable_projection,
};
use faer::Mat;
use powerball_logs::parallel;
use powerball_logs::regression::{Column, Data, RigidArm, Signals};
use std::sync::Arc;

/// A column that was added to the base model.
#[derive(Clone, Debug)]
pub struct Term {
    /// The term's values.
    pub column: Column,
    /// Whether its coefficient must not be negative.
    pub non_negative: bool,
}

/// A fitted model on the rows it was fitted to.
#[derive(Debug)]
pub struct Fit {
    /// γ2, γ4 by joint, s/rad.
    pub shapes: Vec<[f64; 2]>,
    /// All coefficients in the order of [`Design`]; those of tangents are 0.
    pub theta: Vec<f64>,
    /// 1/(σ²·inflation) by joint, 0 for a joint without rows.
    pub weights: Vec<f64>,
    /// Residual rms by joint, N·m.
    pub sigma: Vec<f64>,
    /// How many times the variance of slow means exceeds that of independent samples, by joint, at least 1.
    pub inflation: Vec<f64>,
    /// The velocity that each joint exceeds in 5 % of the samples, rad/s.
    pub top_velocity: Vec<f64>,
    /// Residual by joint.
    pub residual: Signals,
    /// The columns at these shapes.
    pub design: Design,
    /// Cross products of the columns.
    pub gram: Gram,
    /// The columns whose coefficients are free, tangents among them: what a screen must treat as refitted.
    pub free: Vec<bool>,
}

impl Fit {
    /// γ1 … γ5 of a joint.
    #[must_use]
    pub fn friction(&self, joint: usize) -> [f64; 5] {
        self.design.layout.gamma(&self.theta, joint, self.shapes[joint])
    }

    /// The minimal set's values; where joints were fitted apart, the first joint's.
    #[must_use]
    pub fn inertial(&self) -> &[f64] {
        &self.theta[..self.design.set]
    }

    /// Torque of the rigid arm along a motion, n a sample, N·m.
    #[must_use]
    pub fn rigid_torque(&self, body: &RigidArm, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
        let set = self.design.set;
        let by_set = |theta: &[f64]| body.torque(q, v, a, &theta[..body.names().len()]);
        if self.design.inertial == set {
            return by_set(self.inertial());
        }
        let mut torque = vec![0.0; q.len()];
        let n = self.design.dof();
        for (j, own) in self.theta[..self.design.inertial].chunks_exact(set).enumerate() {
            for (to, from) in torque.iter_mut().zip(by_set(own)).skip(j).step_by(n) {
                *to = from;
            }
        }
        torque
    }

    /// Coefficient of a term's column.
    #[must_use]
    pub fn coefficient(&self, term: usize) -> f64 {
        self.theta[self.design.extra(term)]
    }

    /// The normal equations of all rows, with what is known beforehand of an arm (see [`Gram::fitted`]).
    #[must_use]
    pub fn normal_equations(&self) -> NormalEquations {
        self.gram.normal_equations(&self.weights)
    }

    /// Them factored over the free columns.
    #[must_use]
    pub fn solver(&self) -> Solver {
        self.normal_equations().solver(|c| self.free[c])
    }

    /// The prediction of this model on other data with the same kind of columns.
    #[must_use]
    pub fn residual_on(&self, data: &Data<'_>, extra: &[Column]) -> Signals {
        let friction = friction_columns(data, &self.shapes);
        let design = Design::new(data, &friction, extra);
        residuals(data, &design, &self.theta)
    }
}

/// A base model that is known, seen as a fit of some data: its parameters and γ1 … γ5 by joint as
/// coefficients, and nothing free.
#[must_use]
pub fn known(data: &Data<'_>, inertial: &[f64], gammas: &[[f64; 5]]) -> Fit {
    let shapes: Vec<[f64; 2]> = gammas.iter().map(|[_, g2, _, g4, _]| [*g2, *g4]).collect();
    let design = Design::new(data, &friction_columns(data, &shapes), &[]);
    let gram = Gram::new(data, &design, &Folds::new(data));
    let mut theta = vec![0.0; design.size];
    theta.iter_mut().zip(inertial).for_each(|(to, value)| *to = *value);
    for (j, [g1, _, g3, _, g5]) in gammas.iter().enumerate() {
        for (k, level) in [g1, g3, g5].into_iter().enumerate() {
            theta[design.friction(j, k)] = *level;
        }
    }
    let residual = residuals(data, &design, &theta);
    Fit {
        shapes,
        weights: vec![1.0; data.dof()],
        sigma: residual.rms(),
        inflation: vec![1.0; data.dof()],
        top_velocity: (0..data.dof()).map(|j| data.top_velocity(j)).collect(),
        residual,
        free: vec![false; design.size],
        theta,
        design,
        gram,
    }
}

/// Fits the base model with the given terms; `start` saves the search for shapes and weights.
#[must_use]
pub fn fit(data: &Data<'_>, folds: &Folds, terms: &[Term], start: Option<&Fit>) -> Fit {
    let rows = InMemory { data, folds, extra: terms.iter().map(|t| t.column.clone()).collect() };
    let layout = rows.layout();
    let non_negative: Vec<usize> =
        (0..terms.len()).filter(|t| terms[*t].non_negative).map(|t| layout.extra(t)).collect();
    let start = start.map(|fit| Start { shapes: &fit.shapes, weights: &fit.weights });
    let done = variable_projection(&rows, &non_negative, start);
    let (design, gram) = done.at;
    Fit {
        residual: residuals(data, &design, &done.theta),
        shapes: done.shapes,
        theta: done.theta,
        weights: done.weights,
        sigma: done.scatter.sigma,
        inflation: done.scatter.inflation,
        top_velocity: (0..data.dof()).map(|j| data.top_velocity(j)).collect(),
        design,
        gram,
        free: done.free,
    }
}

/// Rows of prepared logs with further columns.
struct InMemory<'a> {
    data: &'a Data<'a>,
    folds: &'a Folds,
    extra: Vec<Column>,
}

impl SeparableRows for InMemory<'_> {
    type At = (Design, Gram);

    fn layout(&self) -> Layout {
        Layout::of(self.data, self.extra.len())
    }

    fn moves(&self, joint: usize) -> bool {
        !self.data.joints[joint].is_empty()
    }

    fn range(&self, joint: usize) -> (f64, f64) {
        variable_projection::range(self.data.top_velocity(joint))
    }

    fn power(&self, joint: usize) -> f64 {
        let torque = &self.data.joints[joint].torque;
        torque.iter().map(|y| y * y).sum::<f64>() / torque.len().max(1) as f64
    }

    fn at(&self, shapes: &[[f64; 2]]) -> (Design, Gram) {
        let design = Design::new(self.data, &friction_columns(self.data, shapes), &self.extra);
        let gram = Gram::new(self.data, &design, self.folds);
        (design, gram)
    }

    fn products(&self, (_, gram): &(Design, Gram), weights: &[f64]) -> NormalEquations {
        gram.normal_equations(weights)
    }

    fn trials(&self, (design, _): &(Design, Gram), joint: usize, steep: &[f64]) -> Trials {
        let rows_of = &self.data.joints[joint];
        let trial: Vec<Vec<f64>> = parallel::map(steep, |g| {
            rows_of.column(&self.data.recordings, |_, r| r.velocity(joint).map(|v| (g * v).tanh()).collect())
        });
        let columns: Vec<&[f64]> = trial.iter().map(Vec::as_slice).collect();
        let grid = steep.len();
        let mut trials = Trials {
            cross: Mat::zeros(design.size, grid),
            square: Mat::zeros(grid, grid),
            score: vec![0.0; grid],
        };
        for (_, rows) in runs(self.data, self.folds, joint) {
            for (c, values) in design.cross(joint, &rows, &columns) {
                for (k, value) in values.iter().enumerate() {
                    trials.cross[(c, k)] += value;
                }
            }
            let here = |a: &[f64], b: &[f64]| dot(&a[rows.clone()], &b[rows.clone()]);
            for a in 0..grid {
                for b in 0..=a {
                    trials.square[(a, b)] += here(&trial[a], &trial[b]);
                }
                trials.score[a] += here(&trial[a], &rows_of.torque);
            }
        }
        trials
    }

    fn scatter(&self, (design, _): &(Design, Gram), theta: &[f64]) -> Scatter {
        let residual = residuals(self.data, design, theta);
        Scatter {
            sigma: residual.rms(),
            inflation: residual
                .iter()
                .enumerate()
                .map(|(j, r)| variance_inflation(self.data, j, r, MEAN_OVER))
                .collect(),
        }
    }
}

/// The friction columns of all joints for given shapes.
#[must_use]
pub fn friction_columns(data: &Data<'_>, shapes: &[[f64; 2]]) -> Vec<[Arc<Vec<f64>>; FRICTION]> {
    let joints: Vec<usize> = (0..shapes.len()).collect();
    parallel::map(&joints, |&j| variable_projection::columns(data, j, shapes[j]))
}

fn residuals(data: &Data<'_>, design: &Design, theta: &[f64]) -> Signals {
    let joints: Vec<usize> = (0..data.dof()).collect();
    Signals(parallel::map(&joints, |&j| {
        data.joints[j].torque.iter().zip(design.predict(j, theta)).map(|(y, p)| y - p).collect()
    }))
}

/// Seconds over which means are taken for [`variance_inflation`].
pub const MEAN_OVER: f64 = 1.0;

/// How much more the residual's means over some seconds vary than those of independent samples would.
///
/// Coloured residuals carry less information than their number of samples; this is the ratio.
pub fn variance_inflation(data: &Data<'_>, joint: usize, residual: &[f64], seconds: f64) -> f64 {
    let per_second = data.rate() / data.joints[joint].band.decimation as f64;
    let length = ((seconds * per_second).round() as usize).max(1);
    let (mut sum, mut count, mut square) = (0.0, 0usize, 0.0);
    for rows in &data.joints[joint].rows {
        for chunk in residual[rows.clone()].chunks_exact(length) {
            let total: f64 = chunk.iter().sum();
            sum += total * total / length as f64;
            square += chunk.iter().map(|v| v * v).sum::<f64>() / length as f64;
            count += 1;
        }
    }
    if count < 5 || square == 0.0 { 1.0 } else { (sum / square).max(1.0) }
}
