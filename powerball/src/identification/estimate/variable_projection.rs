//! A fit by variable projection: linear parameters by weighted least squares, friction steepnesses by
//! Gauss–Newton.
//!
//! It asks of its rows only their cross products at given steepnesses, so rows in memory and reduced logs are
//! fitted alike.

use super::friction_shape;
use super::rows::{Layout, Rows, Scatter};
use super::solve::{Solver, bounded};
use faer::Mat;

/// What a fit starts from where a similar one has been made.
pub(super) struct Start<'a> {
    pub shapes: &'a [[f64; 2]],
    pub weights: &'a [f64],
}

/// A fit of any rows.
pub(super) struct Projected<A> {
    pub shapes: Vec<[f64; 2]>,
    pub theta: Vec<f64>,
    pub weights: Vec<f64>,
    pub scatter: Scatter,
    pub at: A,
    /// The columns whose coefficients are free, tangents among them.
    pub free: Vec<bool>,
}

/// Rounds of new weights and shapes.
const WEIGHT_ROUNDS: usize = 3;
/// Gauss–Newton steps on the shapes in a round.
const SHAPE_STEPS: usize = 6;
/// A round that lowers the error by less than this share has arrived.
const SETTLED: f64 = 1e-5;

/// Fits rows; the coefficients of `non_negative` columns and of friction's levels stay at or above zero.
pub(super) fn variable_projection<R: Rows>(
    rows: &R,
    non_negative: &[usize],
    start: Option<Start<'_>>,
) -> Projected<R::At> {
    let layout = rows.layout();
    let n = layout.dof;
    let mut bounds = layout.levels();
    bounds.extend_from_slice(non_negative);
    let mut shapes = match &start {
        Some(start) => start.shapes.to_vec(),
        None => (0..n).map(|j| friction_shape::first(rows.range(j))).collect(),
    };
    let mut weights = match &start {
        Some(start) => start.weights.to_vec(),
        // Before anything is fitted a joint's own torque is its scale.
        None => (0..n).map(|j| if rows.power(j) > 0.0 { 1.0 / rows.power(j) } else { 0.0 }).collect(),
    };
    let mut state = State::new(rows, &bounds, &shapes, &weights);
    // A start is near already.
    let rounds = if start.is_some() { 1 } else { WEIGHT_ROUNDS };
    for round in 0..rounds {
        if start.is_none() {
            for j in (0..n).filter(|j| rows.moves(*j)) {
                let mut trial = shapes.clone();
                let present = (round > 0).then_some(shapes[j]);
                trial[j] = friction_shape::search(rows, &state.at, &weights, j, present);
                let next = State::new(rows, &bounds, &trial, &weights);
                if next.error < state.error {
                    (state, shapes) = (next, trial);
                }
            }
        }
        state = descend(state, rows, &bounds, &mut shapes, &weights);
        weights = new_weights(rows, &rows.scatter(&state.at, &state.theta));
        state.solve(rows, &bounds, &weights);
    }
    let scatter = rows.scatter(&state.at, &state.theta);
    weights = new_weights(rows, &scatter);
    state.solve(rows, &bounds, &weights);
    let free = state.free(layout);
    Projected { shapes, theta: state.theta, weights, scatter, at: state.at, free }
}

/// A model at given shapes.
struct State<A> {
    at: A,
    theta: Vec<f64>,
    solver: Solver,
    error: f64,
}

impl<A> State<A> {
    fn new<R: Rows<At = A>>(rows: &R, bounds: &[usize], shapes: &[[f64; 2]], weights: &[f64]) -> State<A> {
        let at = rows.at(shapes);
        let solver = Solver::new(&Mat::zeros(0, 0), |_| false);
        let mut state = State { at, theta: Vec::new(), solver, error: f64::INFINITY };
        state.solve(rows, bounds, weights);
        state
    }

    fn solve<R: Rows<At = A>>(&mut self, rows: &R, bounds: &[usize], weights: &[f64]) {
        let (gram, right, square) = rows.products(&self.at, weights);
        let layout = rows.layout();
        let (theta, solver) = bounded(&gram, &right, |c| !layout.is_tangent(c), bounds);
        let explained: f64 = theta.iter().zip(&right).map(|(x, r)| x * r).sum::<f64>();
        let quadratic: f64 = (0..theta.len())
            .map(|i| theta[i] * (0..theta.len()).map(|k| gram[(k, i)] * theta[k]).sum::<f64>())
            .sum();
        self.error = square - 2.0 * explained + quadratic;
        (self.theta, self.solver) = (theta, solver);
    }

    /// Free columns, with the tangents of levels that are not zero.
    fn free(&self, layout: Layout) -> Vec<bool> {
        let mut free = vec![false; layout.size()];
        for k in self.solver.kept() {
            free[*k] = true;
        }
        for j in 0..layout.dof {
            for k in 0..2 {
                free[layout.friction(j, 3 + k)] = self.theta[layout.friction(j, k)] > 0.0;
            }
        }
        free
    }
}

/// Gauss–Newton on ln γ2, ln γ4 of all joints with every linear parameter projected out, steps halved until
/// they help.
fn descend<R: Rows>(
    mut state: State<R::At>,
    rows: &R,
    bounds: &[usize],
    shapes: &mut Vec<[f64; 2]>,
    weights: &[f64],
) -> State<R::At> {
    let layout = rows.layout();
    for _ in 0..SHAPE_STEPS {
        let free = state.free(layout);
        let (gram, right, _) = rows.products(&state.at, weights);
        let theta = Solver::new(&gram, |c| free[c]).solve(&right);
        let mut moved = false;
        let mut scale = 1.0;
        for _ in 0..4 {
            let mut trial = shapes.clone();
            for (j, shape) in trial.iter_mut().enumerate() {
                let (low, high) = rows.range(j);
                for k in 0..2 {
                    let level = state.theta[layout.friction(j, k)];
                    if level > 0.0 {
                        // The tangent's coefficient is the level times the change of ln γ.
                        let step = theta[layout.friction(j, 3 + k)] / level;
                        shape[k] *= (scale * step.clamp(-0.7, 0.7)).exp();
                        shape[k] = shape[k].clamp(low, high);
                    }
                }
            }
            let next = State::new(rows, bounds, &trial, weights);
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

/// 1/(σ²·inflation) by joint, 0 for a joint without rows.
fn new_weights<R: Rows>(rows: &R, scatter: &Scatter) -> Vec<f64> {
    let top = scatter.sigma.iter().fold(0.0f64, |m, s| m.max(*s));
    (0..scatter.sigma.len())
        .map(|j| {
            // A residual of exactly zero (a dead sensor) must not outweigh everything.
            let s = scatter.sigma[j].max(1e-9 * top);
            if !rows.moves(j) || s == 0.0 { 0.0 } else { 1.0 / (s * s * scatter.inflation[j]) }
        })
        .collect()
}
