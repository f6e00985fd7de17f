//! The whole fit: linear parameters by weighted least squares, friction shapes by variable projection.

use super::design::{Design, FRICTION, Gram};
use super::folds::Folds;
use super::friction_shape;
use super::solve::{Solver, bounded};
use crate::parallel;
use crate::regression::{Column, Data};

/// A column that was added to the base model.
#[derive(Clone, Debug)]
pub struct Term {
    /// Its values.
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
    /// The speed that each joint exceeds in 5 % of the samples, rad/s.
    pub top_speed: Vec<f64>,
    /// Residual by joint.
    pub residual: Vec<Vec<f64>>,
    /// The columns at these shapes.
    pub design: Design,
    /// Their cross products.
    pub gram: Gram,
    /// The columns whose coefficients are free, tangents among them: what a screen must treat as refitted.
    pub free: Vec<bool>,
}

impl Fit {
    /// γ1 … γ5 of a joint.
    #[must_use]
    pub fn friction(&self, joint: usize) -> [f64; 5] {
        let level = |k| self.theta[self.design.friction(joint, k)];
        let [g2, g4] = self.shapes[joint];
        [level(0), g2, level(1), g4, level(2)]
    }

    /// The minimal set's values.
    #[must_use]
    pub fn inertial(&self) -> &[f64] {
        &self.theta[..self.design.inertial]
    }

    /// Coefficient of a term's column.
    #[must_use]
    pub fn coefficient(&self, term: usize) -> f64 {
        self.theta[self.design.extra(term)]
    }

    /// The prediction of this model on other data with the same kind of columns.
    #[must_use]
    pub fn residual_on(&self, data: &Data<'_>, extra: &[Column]) -> Vec<Vec<f64>> {
        let friction = friction_columns(data, &self.shapes);
        let design = Design::new(data, &friction, extra);
        residuals(data, &design, &self.theta)
    }
}

/// Rounds of new weights and shapes.
const WEIGHT_ROUNDS: usize = 3;
/// Gauss–Newton steps on the shapes in a round.
const SHAPE_STEPS: usize = 6;
/// A round that lowers the error by less than this share has arrived.
const SETTLED: f64 = 1e-5;

/// Fits the base model with the given terms; `start` saves the search for shapes and weights.
#[must_use]
pub fn fit(data: &Data<'_>, folds: &Folds, terms: &[Term], start: Option<&Fit>) -> Fit {
    let n = data.dof();
    let extra: Vec<Column> = terms.iter().map(|t| t.column.clone()).collect();
    let mut shapes = match start {
        Some(fit) => fit.shapes.clone(),
        None => (0..n)
            .map(|j| {
                let (low, high) = friction_shape::range(data, j);
                [high / 5.0, low * 4.0]
            })
            .collect(),
    };
    let mut weights = start.map_or_else(|| initial_weights(data), |fit| fit.weights.clone());
    let mut state = State::new(data, folds, &extra, terms, shapes.clone(), &weights);
    // A start is near already.
    let rounds = if start.is_some() { 1 } else { WEIGHT_ROUNDS };
    for round in 0..rounds {
        if start.is_none() && round < 2 {
            for j in (0..n).filter(|j| !data.joints[*j].is_empty()) {
                let (gram, right, _) = state.gram.sum(&weights, |_| true);
                let found = friction_shape::search(data, &state.design, &gram, &right, j, weights[j], folds);
                let mut trial = shapes.clone();
                trial[j] = found;
                let next = State::new(data, folds, &extra, terms, trial.clone(), &weights);
                if next.error < state.error {
                    (state, shapes) = (next, trial);
                }
            }
        }
        state = descend(state, data, folds, &extra, terms, &mut shapes, &weights);
        weights = new_weights(data, &residuals(data, &state.design, &state.theta)).0;
        state.solve(&weights, terms);
    }
    let residual = residuals(data, &state.design, &state.theta);
    let (weights, sigma, inflation) = new_weights(data, &residual);
    state.solve(&weights, terms);
    let residual = residuals(data, &state.design, &state.theta);
    let free = state.free(n);
    Fit {
        shapes,
        theta: state.theta,
        weights,
        sigma,
        inflation,
        top_speed: (0..n).map(|j| data.top_speed(j)).collect(),
        residual,
        design: state.design,
        gram: state.gram,
        free,
    }
}

/// A model at given shapes.
struct State {
    design: Design,
    gram: Gram,
    theta: Vec<f64>,
    solver: Solver,
    error: f64,
}

impl State {
    fn new(
        data: &Data<'_>,
        folds: &Folds,
        extra: &[Column],
        terms: &[Term],
        shapes: Vec<[f64; 2]>,
        weights: &[f64],
    ) -> State {
        let design = Design::new(data, &friction_columns(data, &shapes), extra);
        let gram = Gram::new(data, &design, folds);
        let solver = Solver::new(&faer::Mat::zeros(0, 0), |_| false);
        let mut state = State { design, gram, theta: Vec::new(), solver, error: f64::INFINITY };
        state.solve(weights, terms);
        state
    }

    fn solve(&mut self, weights: &[f64], terms: &[Term]) {
        let (gram, right, square) = self.gram.sum(weights, |_| true);
        let mut non_negative: Vec<usize> = (0..self.design.dof())
            .flat_map(|j| [0, 1, 2].map(|k| (j, k)))
            .map(|(j, k)| self.design.friction(j, k))
            .collect();
        non_negative
            .extend((0..terms.len()).filter(|t| terms[*t].non_negative).map(|t| self.design.extra(t)));
        let wanted = |c: usize| !is_tangent(&self.design, c);
        let (theta, solver) = bounded(&gram, &right, wanted, &non_negative);
        let explained: f64 = theta.iter().zip(&right).map(|(x, r)| x * r).sum::<f64>();
        let quadratic: f64 = (0..theta.len())
            .map(|i| theta[i] * (0..theta.len()).map(|k| gram[(k, i)] * theta[k]).sum::<f64>())
            .sum();
        self.error = square - 2.0 * explained + quadratic;
        (self.theta, self.solver) = (theta, solver);
    }

    /// Free columns, with the tangents of levels that are not zero.
    fn free(&self, n: usize) -> Vec<bool> {
        let mut free = vec![false; self.design.size];
        for k in self.solver.kept() {
            free[*k] = true;
        }
        for j in 0..n {
            for k in 0..2 {
                free[self.design.friction(j, 3 + k)] = self.theta[self.design.friction(j, k)] > 0.0;
            }
        }
        free
    }
}

fn is_tangent(design: &Design, column: usize) -> bool {
    column.checked_sub(design.inertial).is_some_and(|f| f < FRICTION * design.dof() && f % FRICTION >= 3)
}

/// The friction columns of all joints for given shapes.
#[must_use]
pub fn friction_columns(data: &Data<'_>, shapes: &[[f64; 2]]) -> Vec<[Vec<f64>; FRICTION]> {
    let joints: Vec<usize> = (0..shapes.len()).collect();
    parallel::map(&joints, |&j| friction_shape::columns(data, j, shapes[j]))
}

/// Gauss–Newton on ln γ2, ln γ4 of all joints with every linear parameter projected out, steps halved until they help.
fn descend(
    mut state: State,
    data: &Data<'_>,
    folds: &Folds,
    extra: &[Column],
    terms: &[Term],
    shapes: &mut Vec<[f64; 2]>,
    weights: &[f64],
) -> State {
    let n = data.dof();
    for _ in 0..SHAPE_STEPS {
        let free = state.free(n);
        let (gram, right, _) = state.gram.sum(weights, |_| true);
        let theta = Solver::new(&gram, |c| free[c]).solve(&right);
        let mut moved = false;
        let mut scale = 1.0;
        for _ in 0..4 {
            let mut trial = shapes.clone();
            for (j, shape) in trial.iter_mut().enumerate() {
                let (low, high) = friction_shape::range(data, j);
                for k in 0..2 {
                    let level = state.theta[state.design.friction(j, k)];
                    if level > 0.0 {
                        // The tangent's coefficient is the level times the change of ln γ.
                        let step = theta[state.design.friction(j, 3 + k)] / level;
                        shape[k] *= (scale * step.clamp(-0.7, 0.7)).exp();
                        shape[k] = shape[k].clamp(low * 0.2, high * 2.0);
                    }
                }
            }
            let next = State::new(data, folds, extra, terms, trial.clone(), weights);
            if next.error < state.error {
                moved = state.error - next.error > SETTLED * state.error;
                (state, *shapes) = (next, trial);
                break;
            }
            scale *= 0.4;
        }
        if !moved {
            break;
        }
    }
    state
}

fn residuals(data: &Data<'_>, design: &Design, theta: &[f64]) -> Vec<Vec<f64>> {
    let joints: Vec<usize> = (0..data.dof()).collect();
    parallel::map(&joints, |&j| {
        data.joints[j].torque.iter().zip(design.predict(j, theta)).map(|(y, p)| y - p).collect()
    })
}

/// Before anything is fitted a joint's own torque is its scale.
fn initial_weights(data: &Data<'_>) -> Vec<f64> {
    data.joints
        .iter()
        .map(|joint| {
            let square = joint.torque.iter().map(|y| y * y).sum::<f64>();
            if square > 0.0 { joint.len() as f64 / square } else { 0.0 }
        })
        .collect()
}

fn new_weights(data: &Data<'_>, residual: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let sigma: Vec<f64> = residual
        .iter()
        .map(|r| (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt())
        .collect();
    let inflation: Vec<f64> =
        residual.iter().enumerate().map(|(j, r)| variance_inflation(data, j, r)).collect();
    let top = sigma.iter().fold(0.0f64, |m, s| m.max(*s));
    let weights = (0..sigma.len())
        .map(|j| {
            // A residual of exactly zero (a dead sensor) must not outweigh everything.
            let s = sigma[j].max(1e-9 * top);
            if data.joints[j].is_empty() || s == 0.0 { 0.0 } else { 1.0 / (s * s * inflation[j]) }
        })
        .collect();
    (weights, sigma, inflation)
}

/// Seconds over which means are taken for [`variance_inflation`].
const MEAN_OVER: f64 = 1.0;

/// How much more the residual's means over 1 s vary than those of independent samples would.
///
/// Coloured residuals tell less than their number of samples; this is by how much.
fn variance_inflation(data: &Data<'_>, joint: usize, residual: &[f64]) -> f64 {
    let per_second = data.rate() / data.band.decimation as f64;
    let length = ((MEAN_OVER * per_second).round() as usize).max(1);
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
