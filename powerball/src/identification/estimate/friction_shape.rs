//! The steepnesses γ2, γ4 of Eq. 16: columns for given shapes, and a search that needs no start.

use super::rows::{FRICTION, Rows};
use super::solve::Solver;
use crate::logs::regression::{Data, Recording};
use crate::logs::summary::{NODES, Steepness};

/// Steepnesses tried for each level. A steep level that is off by a grid's step leaves an error at which a
/// second steep one is worth more than the bend that is there, and from two steep levels no descent finds the
/// way back: the grid is fine.
const GRID: usize = 64;

/// Friction columns of a joint in the band: tanh(γ2 q̇), tanh(γ4 q̇), q̇, and ∂/∂ ln γ of the first two.
#[must_use]
pub(super) fn columns(data: &Data<'_>, joint: usize, shape: [f64; 2]) -> [Vec<f64>; FRICTION] {
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
    let ([first, first_tangent], [second, second_tangent]) = (level(shape[0]), level(shape[1]));
    [first, second, column(&|_, r| r.velocity(joint).collect()), first_tangent, second_tangent]
}

/// ∂ tanh(γ·q̇) / ∂ ln γ.
#[must_use]
pub(super) fn tangent(g: f64, v: f64) -> f64 {
    slope(g, v, (g * v).tanh())
}

/// The same where t = tanh(γ·q̇) is known.
fn slope(g: f64, v: f64, t: f64) -> f64 {
    g * v * (1.0 - t * t)
}

/// The steepnesses that make sense for a joint whose fast velocity is `top`, s/rad: from straight over its
/// velocities to a step.
#[must_use]
pub(super) fn range(top: f64) -> (f64, f64) {
    (0.2 / top, 2000.0 / top)
}

/// Where a search begins that finds nothing: a step and a bend.
#[must_use]
pub(super) fn first((low, high): (f64, f64)) -> [f64; 2] {
    [high / 10.0, low * 20.0]
}

/// The pair of steepnesses that leaves the least on one joint, all else refitted, levels ≥ 0. Where `present`
/// holds the joint's steepnesses, they are among those tried, with their tangents: a bend beside a step that
/// is known is then not outdone by a second step that corrects the first.
#[must_use]
pub(super) fn search<R: Rows>(
    rows: &R,
    at: &R::At,
    weights: &[f64],
    joint: usize,
    present: Option<[f64; 2]>,
) -> [f64; 2] {
    let layout = rows.layout();
    let (lowest, highest) = rows.range(joint);
    // The ends of the range are hardly told from straight lines and steps.
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
    let (gram, right, _) = rows.products(at, weights);
    let solver = Solver::new(&gram, nuisance);
    let base = solver.solve(&right);
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
