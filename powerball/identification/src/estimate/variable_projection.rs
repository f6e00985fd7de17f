//! A fit by variable projection: linear parameters by weighted least squares, friction steepnesses by
//! Gauss–Newton.
//!
//! Variable projection needs of the rows only their cross products at given steepnesses, so rows in memory
//! and reduced logs are fitted alike.
//!
//! The module also has the steepnesses γ2, γ4 of the tanh model, and the trait for rows of a regression whose
//! friction steepnesses are free.

use super::solve::{NormalEquations, Solver};
use faer::Mat;
pub(super) use powerball_logs::regression::FRICTION;
use powerball_logs::regression::{Data, Recording};
use powerball_logs::summary::{NODES, Steepness};
use std::sync::Arc;

/// The start of a fit from a similar fit.
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
pub(super) fn variable_projection<R: SeparableRows>(
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
        None => (0..n).map(|j| first(rows.range(j))).collect(),
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
                trial[j] = search(rows, &state.at, &weights, j, present);
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
    fn new<R: SeparableRows<At = A>>(
        rows: &R,
        bounds: &[usize],
        shapes: &[[f64; 2]],
        weights: &[f64],
    ) -> State<A> {
        let at = rows.at(shapes);
        let solver = Solver::new(&Mat::zeros(0, 0), |_| false);
        let mut state = State { at, theta: Vec::new(), solver, error: f64::INFINITY };
        state.solve(rows, bounds, weights);
        state
    }

    fn solve<R: SeparableRows<At = A>>(&mut self, rows: &R, bounds: &[usize], weights: &[f64]) {
        let (normal, layout) = (rows.products(&self.at, weights), rows.layout());
        let (theta, solver) = normal.solve_bounded(|c| !layout.is_tangent(c), bounds);
        self.error = normal.left(&theta);
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
fn descend<R: SeparableRows>(
    mut state: State<R::At>,
    rows: &R,
    bounds: &[usize],
    shapes: &mut Vec<[f64; 2]>,
    weights: &[f64],
) -> State<R::At> {
    let layout = rows.layout();
    for _ in 0..SHAPE_STEPS {
        let free = state.free(layout);
        let normal = rows.products(&state.at, weights);
        let theta = normal.solver(|c| free[c]).solve(&normal.right);
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
fn new_weights<R: SeparableRows>(rows: &R, scatter: &Scatter) -> Vec<f64> {
    let top = scatter.sigma.iter().fold(0.0f64, |m, s| m.max(*s));
    (0..scatter.sigma.len())
        .map(|j| {
            // A residual of exactly zero (a dead sensor) must not outweigh everything.
            let s = scatter.sigma[j].max(1e-9 * top);
            if !rows.moves(j) || s == 0.0 { 0.0 } else { 1.0 / (s * s * scatter.inflation[j]) }
        })
        .collect()
}

// The steepnesses γ2, γ4 of Eq. 16: columns for given shapes, and a search that needs no start.

/// Steepnesses tried for each level. A steep level that is off by a grid's step leaves an error at which a
/// second steep one is worth more than the bend that is there, and from two steep levels no descent finds the
/// way back: the grid is fine.
const GRID: usize = 64;

/// Friction columns of a joint in the band: tanh(γ2 q̇), tanh(γ4 q̇), q̇, and ∂/∂ ln γ of the first two.
#[must_use]
pub(super) fn columns(data: &Data<'_>, joint: usize, shape: [f64; 2]) -> [Arc<Vec<f64>>; FRICTION] {
    let column =
        |signal: &dyn Fn(usize, &Recording) -> Vec<f64>| data.joints[joint].column(&data.recordings, signal);
    let level = |g: f64| {
        let of = |r: &Recording| r.velocity(joint).map(|v| (g * v).tanh()).collect();
        let levels: Vec<Vec<f64>> = data.recordings.iter().map(of).collect();
        let slope = |k: usize, r: &Recording| {
            levels[k].iter().zip(r.velocity(joint)).map(|(t, v)| slope(g, v, *t)).collect()
        };
        [column(&|k, _| levels[k].clone()), column(&slope)]
    };
    let [first, second] = shape.map(|g| data.level_columns(joint, g, || level(g)));
    let ([first, first_tangent], [second, second_tangent]) = (first, second);
    [first, second, data.viscous_column(joint), first_tangent, second_tangent]
}

/// ∂ tanh(γ·q̇) / ∂ ln γ.
#[must_use]
pub(super) fn tangent(g: f64, v: f64) -> f64 {
    slope(g, v, (g * v).tanh())
}

/// Like [`tangent`], if t = tanh(γ·q̇) is known.
fn slope(g: f64, v: f64, t: f64) -> f64 {
    g * v * (1.0 - t * t)
}

/// The steepnesses that make sense for a joint whose fast velocity is `top`, s/rad: from straight over its
/// velocities to a step.
#[must_use]
pub(super) fn range(top: f64) -> (f64, f64) {
    (0.2 / top, 2000.0 / top)
}

/// The start of a search without earlier results: a step and a bend.
#[must_use]
pub(super) fn first((low, high): (f64, f64)) -> [f64; 2] {
    [high / 10.0, low * 20.0]
}

/// The pair of steepnesses with the smallest residual on one joint, all else refitted, levels ≥ 0. Where
/// `present` holds the joint's steepnesses, they are among those tried, with their tangents: a bend in
/// addition to a step that is known is then not outdone by a second step that corrects the first.
#[must_use]
pub(super) fn search<R: SeparableRows>(
    rows: &R,
    at: &R::At,
    weights: &[f64],
    joint: usize,
    present: Option<[f64; 2]>,
) -> [f64; 2] {
    let layout = rows.layout();
    let (lowest, highest) = rows.range(joint);
    // The ends of the range can hardly be distinguished from straight lines and steps.
    let (low, high) = (5.0 * lowest, 0.5 * highest);
    let mut steep: Vec<f64> =
        (0..GRID).map(|k| low * (high / low).powf(k as f64 / (GRID - 1) as f64)).collect();
    steep.extend(present.into_iter().flatten().filter(|g| (low..=high).contains(g)));
    let count = steep.len();
    // Everything but this joint's levels and the other joints' tangents stays as nuisance.
    let nuisance = |c: usize| {
        let friction = c.checked_sub(layout.inertial).filter(|f| *f < FRICTION * layout.dof);
        friction.is_none_or(|f| {
            let (j, which) = (f / FRICTION, f % FRICTION);
            which == 2 || (which < 2 && j != joint) || (which > 2 && j == joint && present.is_some())
        })
    };
    let normal = rows.products(at, weights);
    let solver = normal.solver(nuisance);
    let base = solver.solve(&normal.right);
    let weight = weights[joint];
    // Columns at a few nodes hold those of all steepnesses between them.
    let nodes = Steepness::between(low, high);
    let trials = rows.trials(at, joint, &nodes.nodes());
    let shares: Vec<[f64; NODES]> = steep.iter().map(|g| nodes.weights(*g)).collect();
    let sum = |g: usize, of: &dyn Fn(usize) -> f64| -> f64 {
        weight * shares[g].iter().enumerate().map(|(k, share)| share * of(k)).sum::<f64>()
    };
    let cross: Vec<Vec<f64>> =
        (0..count).map(|g| (0..layout.size()).map(|c| sum(g, &|k| trials.cross[(c, k)])).collect()).collect();
    let half: Vec<Vec<f64>> = (0..count)
        .map(|g| (0..NODES).map(|i| sum(g, &|k| trials.square[(i.max(k), i.min(k))])).collect())
        .collect();
    let (mut square, mut score) = (vec![vec![0.0; count]; count], vec![0.0; count]);
    let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let projected: Vec<Vec<f64>> = cross.iter().map(|c| solver.solve(c)).collect();
    for a in 0..count {
        for b in 0..=a {
            square[a][b] = inner(&half[a], &shares[b]) - inner(&cross[a], &projected[b]);
        }
        score[a] = sum(a, &|k| trials.score[k]) - inner(&cross[a], &base);
    }
    let single =
        |a: usize| if score[a] > 0.0 && square[a][a] > 0.0 { score[a].powi(2) / square[a][a] } else { 0.0 };
    let (mut best, mut found) = (0.0, [steep[GRID - GRID / 5], steep[GRID / 5]]);
    for a in 0..count {
        for b in 0..a {
            let det = square[a][a] * square[b][b] - square[a][b].powi(2);
            if det <= 1e-9 * square[a][a] * square[b][b] {
                continue;
            }
            let x = (score[a] * square[b][b] - score[b] * square[a][b]) / det;
            let z = (score[b] * square[a][a] - score[a] * square[a][b]) / det;
            let gain =
                if x >= 0.0 && z >= 0.0 { x * score[a] + z * score[b] } else { single(a).max(single(b)) };
            if gain > best {
                // The steeper level comes first, whatever the order in which they were tried.
                (best, found) = (gain, [steep[a].max(steep[b]), steep[a].min(steep[b])]);
            }
        }
    }
    found
}

// Rows of a regression whose friction steepnesses are free, whatever they are kept in.

/// The order of the coefficients: the minimal set, five friction columns a joint, further columns.
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
    /// The layout of some data's rows.
    #[must_use]
    pub fn of(data: &Data<'_>, extra: usize) -> Layout {
        let (dof, set) = (data.dof(), data.inertial_columns());
        Layout { inertial: if data.per_joint { dof * set } else { set }, dof, extra }
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

    /// Whether a column is a tangent of a shape, whose coefficient is not a parameter.
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

/// Cross products of trial columns on one joint, by trial.
#[derive(Debug)]
pub(super) struct Trials {
    /// Products of the trial columns with the columns of all rows, columns × trials.
    pub cross: Mat<f64>,
    /// Products of the trial columns with each other.
    pub square: Mat<f64>,
    /// Products of the trial columns with the torque.
    pub score: Vec<f64>,
}

/// Rows of a regression that is linear but for the steepnesses of friction (separable least squares).
pub(super) trait SeparableRows: Sync {
    /// The columns at given steepnesses.
    type At;
    /// The order of the columns.
    fn layout(&self) -> Layout;
    /// Whether a joint has rows.
    fn moves(&self, joint: usize) -> bool;
    /// The steepnesses that a joint may take, s/rad.
    fn range(&self, joint: usize) -> (f64, f64);
    /// Mean square of a joint's torque.
    fn power(&self, joint: usize) -> f64;
    /// The columns at γ2, γ4 of each joint.
    fn at(&self, shapes: &[[f64; 2]]) -> Self::At;
    /// The normal equations of columns, summed over joints.
    fn products(&self, at: &Self::At, weights: &[f64]) -> NormalEquations;
    /// Cross products of one joint's columns tanh(γ·q̇) for some γ with all others, with each other and with
    /// the torque.
    fn trials(&self, at: &Self::At, joint: usize, steep: &[f64]) -> Trials;
    /// The residual of coefficients.
    fn scatter(&self, at: &Self::At, theta: &[f64]) -> Scatter;
}
