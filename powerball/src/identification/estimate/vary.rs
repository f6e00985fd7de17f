//! A fit by variable projection: linear parameters by weighted least squares, friction steepnesses by
//! Gauss–Newton.
//!
//! It asks of its rows only their cross products at given steepnesses, so rows in memory and reduced logs are
//! fitted alike.

use super::friction_shape::{self, Trials};
use super::normal_equations::Products;
use super::solve::{Solver, bounded};
use crate::logs::regression::Data;
use faer::Mat;

/// Friction columns of a joint: two saturating levels, the viscous one, and the two tangents of the shapes.
pub(super) const FRICTION: usize = 5;

/// Where a coefficient stands: the minimal set, five friction columns a joint, further columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Inertial columns.
    pub inertial: usize,
    /// Joints.
    pub dof: usize,
    /// Further columns.
    pub extra: usize,
}

impl Layout {
    /// That of some data's rows.
    #[must_use]
    pub fn of(data: &Data<'_>, extra: usize) -> Layout {
        let (dof, set) = (data.dof(), data.inertial_columns());
        Layout { inertial: if data.joints_apart { dof * set } else { set }, dof, extra }
    }

    /// Columns in all.
    #[must_use]
    pub fn size(&self) -> usize {
        self.inertial + FRICTION * self.dof + self.extra
    }

    /// Index of a joint's friction column: the levels γ1, γ3, the viscous γ5, the tangents of γ2, γ4.
    #[must_use]
    pub fn friction(&self, joint: usize, which: usize) -> usize {
        self.inertial + FRICTION * joint + which
    }

    /// Index of a further column.
    #[must_use]
    pub fn extra(&self, which: usize) -> usize {
        self.inertial + FRICTION * self.dof + which
    }

    /// Whether a column is a tangent of a shape, whose coefficient is no parameter.
    #[must_use]
    pub fn is_tangent(&self, column: usize) -> bool {
        column.checked_sub(self.inertial).is_some_and(|f| f < FRICTION * self.dof && f % FRICTION >= 3)
    }

    /// γ1 … γ5 of a joint from all coefficients and its steepnesses.
    #[must_use]
    pub fn gamma(&self, theta: &[f64], joint: usize, shape: [f64; 2]) -> [f64; 5] {
        let level = |k| theta[self.friction(joint, k)];
        [level(0), shape[0], level(1), shape[1], level(2)]
    }

    /// The columns whose coefficients must not be negative: friction's, so that it dissipates.
    pub(super) fn levels(&self) -> Vec<usize> {
        (0..self.dof).flat_map(|j| [0, 1, 2].map(|k| self.friction(j, k))).collect()
    }
}

/// How a model misses its rows, by joint.
#[derive(Clone, Debug, Default)]
pub(super) struct Scatter {
    /// rms of the residual, N·m.
    pub sigma: Vec<f64>,
    /// How many times the variance of slow means exceeds that of independent samples, at least 1.
    pub inflation: Vec<f64>,
}

/// Rows of a regression whose friction steepnesses are free.
pub(super) trait Rows: Sync {
    /// The columns at given steepnesses.
    type At;
    /// Their order.
    fn layout(&self) -> Layout;
    /// Whether a joint has rows.
    fn moves(&self, joint: usize) -> bool;
    /// The steepnesses that a joint may take, s/rad.
    fn range(&self, joint: usize) -> (f64, f64);
    /// Mean square of a joint's torque.
    fn power(&self, joint: usize) -> f64;
    /// The columns at γ2, γ4 of each joint.
    fn at(&self, shapes: &[[f64; 2]]) -> Self::At;
    /// Their cross products, summed over joints.
    fn products(&self, at: &Self::At, weights: &[f64]) -> Products;
    /// Cross products of one joint's columns tanh(γ·q̇) for some γ with all others, with each other and with
    /// the torque.
    fn trials(&self, at: &Self::At, joint: usize, steep: &[f64]) -> Trials;
    /// What coefficients leave.
    fn scatter(&self, at: &Self::At, theta: &[f64]) -> Scatter;
}

/// What a fit starts from where a similar one has been made.
pub(super) struct Start<'a> {
    pub shapes: &'a [[f64; 2]],
    pub weights: &'a [f64],
}

/// A fit of any rows.
pub(super) struct Varied<A> {
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
pub(super) fn vary<R: Rows>(rows: &R, non_negative: &[usize], start: Option<Start<'_>>) -> Varied<R::At> {
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
    Varied { shapes, theta: state.theta, weights, scatter, at: state.at, free }
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
