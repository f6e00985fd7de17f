//! The steepnesses γ2, γ4 of Eq. 16: columns for given shapes, and a search that needs no start.

use super::design::{Design, FRICTION, runs};
use super::folds::Folds;
use super::solve::Solver;
use crate::parallel;
use crate::regression::Data;
use faer::Mat;

/// Steepnesses tried for each level.
const GRID: usize = 14;

/// Friction columns of a joint in the band: tanh(γ2 q̇), tanh(γ4 q̇), q̇, and ∂/∂ ln γ of the first two.
#[must_use]
pub(super) fn columns(data: &Data<'_>, joint: usize, shape: [f64; 2]) -> [Vec<f64>; FRICTION] {
    let column = |f: &dyn Fn(f64) -> f64| {
        data.joints[joint].column(&data.band, &data.recordings, |_, r| r.speed(joint).map(f).collect())
    };
    let tangent = |g: f64| {
        move |v: f64| {
            let t = (g * v).tanh();
            g * v * (1.0 - t * t)
        }
    };
    let [g2, g4] = shape;
    [
        column(&|v| (g2 * v).tanh()),
        column(&|v| (g4 * v).tanh()),
        column(&|v| v),
        column(&tangent(g2)),
        column(&tangent(g4)),
    ]
}

/// The steepnesses that make sense for a joint, s/rad: from nearly straight over its speeds to a step.
#[must_use]
pub(super) fn range(data: &Data<'_>, joint: usize) -> (f64, f64) {
    let top = data.top_speed(joint);
    (1.0 / top, 1000.0 / top)
}

/// The pair of steepnesses that leaves the least on one joint, all else refitted, levels ≥ 0.
#[must_use]
pub(super) fn search(
    data: &Data<'_>,
    design: &Design,
    gram: &Mat<f64>,
    right: &[f64],
    joint: usize,
    weight: f64,
    folds: &Folds,
) -> [f64; 2] {
    let (low, high) = range(data, joint);
    let steep: Vec<f64> = (0..GRID).map(|k| low * (high / low).powf(k as f64 / (GRID - 1) as f64)).collect();
    let trial: Vec<Vec<f64>> = parallel::map(&steep, |g| {
        data.joints[joint]
            .column(&data.band, &data.recordings, |_, r| r.speed(joint).map(|v| (g * v).tanh()).collect())
    });
    // Everything but this joint's levels and all tangents stays as nuisance.
    let nuisance = |c: usize| {
        let friction = c.checked_sub(design.inertial).filter(|f| *f < FRICTION * design.dof());
        friction.is_none_or(|f| {
            let (j, which) = (f / FRICTION, f % FRICTION);
            which == 2 || (which < 2 && j != joint)
        })
    };
    let solver = Solver::new(gram, nuisance);
    let base = solver.solve(right);
    let columns: Vec<&[f64]> = trial.iter().map(Vec::as_slice).collect();
    let mut cross = vec![vec![0.0; design.size]; GRID];
    let (mut square, mut score) = (vec![vec![0.0; GRID]; GRID], vec![0.0; GRID]);
    let y = &data.joints[joint].torque;
    for (_, rows) in runs(data, folds, joint) {
        for (g, values) in design.cross(joint, &rows, &columns) {
            for (k, value) in values.iter().enumerate() {
                cross[k][g] += weight * value;
            }
        }
        let dot = |a: &[f64], b: &[f64]| {
            a[rows.clone()].iter().zip(&b[rows.clone()]).map(|(x, y)| x * y).sum::<f64>()
        };
        for a in 0..GRID {
            for b in 0..=a {
                square[a][b] += weight * dot(&trial[a], &trial[b]);
            }
            score[a] += weight * dot(&trial[a], y);
        }
    }
    let projected: Vec<Vec<f64>> = cross.iter().map(|c| solver.solve(c)).collect();
    let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    for a in 0..GRID {
        for b in 0..=a {
            square[a][b] -= inner(&cross[a], &projected[b]);
        }
        score[a] -= inner(&cross[a], &base);
    }
    let single =
        |a: usize| if score[a] > 0.0 && square[a][a] > 0.0 { score[a].powi(2) / square[a][a] } else { 0.0 };
    let (mut best, mut found) = (0.0, [steep[GRID - 3], steep[2]]);
    for a in 0..GRID {
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
                (best, found) = (gain, [steep[a], steep[b]]);
            }
        }
    }
    found
}
