//! Held-out gains: the base is fitted once without each fold, a candidate then costs a small solve.
//!
//! Also here: the base model fitted once without each fold.

use super::screen::{Screen, Trial};
use crate::controller::JointNumber;
use crate::identification::estimate::{Fit, Folds, Solver, runs};
use crate::logs::vector::dot;
use faer::Mat;

/// A candidate's weighted cross products in one cell, all joints together.
#[derive(Clone, Debug)]
struct Cross {
    /// A'C by column of C.
    base: Vec<Vec<f64>>,
    /// C'C.
    square: Vec<f64>,
    /// C'y.
    right: Vec<f64>,
}

impl Cross {
    fn zero(size: usize, k: usize) -> Cross {
        Cross { base: vec![vec![0.0; size]; k], square: vec![0.0; k * k], right: vec![0.0; k] }
    }

    /// The sum over some cells; a difference from all of them would leave rounding where nothing is left.
    fn sum<'c>(cells: impl Iterator<Item = &'c Cross>, size: usize, k: usize) -> Cross {
        cells.fold(Cross::zero(size, k), |mut sum, cell| {
            sum.add(cell);
            sum
        })
    }

    fn add(&mut self, other: &Cross) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
        self.base.iter_mut().zip(&other.base).for_each(|(t, f)| add(t, f));
        add(&mut self.square, &other.square);
        add(&mut self.right, &other.right);
    }
}

/// Share by which the held-out squared error of the given joints falls with a candidate, by fold; the base
/// and the candidate are fitted to the rest.
#[must_use]
pub(crate) fn fold_gains(
    screen: &Screen<'_>,
    trial: &Trial,
    joints: &[JointNumber],
    folds: &Folds,
    local: bool,
) -> Vec<f64> {
    let (data, fit) = (screen.context.data, screen.context.fit);
    let (size, k) = (fit.design.size, trial.columns.len());
    let mut cells: Vec<Option<Cross>> = vec![None; folds.cells];
    for j in 0..fit.design.dof() {
        let parts: Vec<&[f64]> = trial.columns.iter().filter_map(|c| c.at(j)).collect();
        let w = fit.weights[j];
        if parts.len() < k || w == 0.0 {
            continue;
        }
        for (cell, rows) in runs(data, folds, j) {
            let cross = cells[cell].get_or_insert_with(|| Cross::zero(size, k));
            for (g, values) in fit.design.cross(j, &rows, &parts) {
                for c in 0..k {
                    cross.base[c][g] += w * values[c];
                }
            }
            let y = &data.joints[j].torque[rows.clone()];
            for a in 0..k {
                let own = &parts[a][rows.clone()];
                for b in 0..k {
                    cross.square[a * k + b] += w * dot(own, &parts[b][rows.clone()]);
                }
                cross.right[a] += w * dot(own, y);
            }
        }
    }
    let sum = |wanted: &dyn Fn(usize) -> bool| {
        let own = cells.iter().enumerate().filter(|(cell, _)| wanted(*cell));
        Cross::sum(own.filter_map(|(_, cross)| cross.as_ref()), size, k)
    };
    screen
        .folds(folds, local)
        .iter()
        .filter_map(|fold| {
            let scale: f64 = joints.iter().map(|j| fold.error[j.index()]).sum();
            let fitted = sum(&|cell| !fold.left_out.contains(&cell));
            let held = sum(&|cell| fold.held.contains(&cell));
            (scale > 0.0).then(|| change(fold, &fitted, &held, k) / scale)
        })
        .collect()
}

/// By how much the held squared error falls.
fn change(fold: &FoldBase, fitted: &Cross, held: &Cross, k: usize) -> f64 {
    let base: Vec<Vec<f64>> = fitted.base.iter().map(|c| fold.solver.solve(c)).collect();
    let mut gram = Mat::<f64>::zeros(k, k);
    for a in 0..k {
        for b in 0..k {
            gram[(a, b)] = fitted.square[a * k + b] - dot(&fitted.base[a], &base[b]);
        }
    }
    let right: Vec<f64> = (0..k).map(|a| fitted.right[a] - dot(&fitted.base[a], &fold.theta)).collect();
    let x = Solver::new(&gram, |a| gram[(a, a)] > 1e-6 * fitted.square[a * k + a]).solve(&right);
    // What the candidate adds to the prediction: C x − A s.
    let mut shift = vec![0.0; fold.theta.len()];
    for (b, x) in base.iter().zip(&x) {
        shift.iter_mut().zip(b).for_each(|(s, b)| *s += x * b);
    }
    let mut change = -2.0 * dot(&shift, &fold.slope);
    for a in 0..k {
        change += 2.0 * x[a] * (held.right[a] - dot(&held.base[a], &fold.theta));
        change += 2.0 * x[a] * dot(&held.base[a], &shift);
        for b in 0..k {
            change -= x[a] * x[b] * held.square[a * k + b];
        }
    }
    change - (0..shift.len()).map(|i| shift[i] * times(&fold.gram, i, &shift)).sum::<f64>()
}

// The base model fitted once without each fold.

/// The base model fitted without one fold.
#[derive(Debug)]
pub(crate) struct FoldBase {
    pub(super) held: Vec<usize>,
    pub(super) left_out: Vec<usize>,
    /// Over what is fitted.
    pub(super) solver: Solver,
    pub(super) theta: Vec<f64>,
    /// Over what is held.
    pub(super) gram: Mat<f64>,
    /// (y − Aθ)'A over what is held.
    pub(super) slope: Vec<f64>,
    /// Weighted squared error of what is held, by joint.
    pub(super) error: Vec<f64>,
}

impl FoldBase {
    /// Fits the columns of a model that are `free` without each fold.
    #[must_use]
    pub(crate) fn all(fit: &Fit, free: &[bool], folds: &Folds, local: bool) -> Vec<FoldBase> {
        let (held, left_out) = folds.folds(local);
        held.iter()
            .zip(left_out)
            .map(|(held, left_out)| {
                let (gram, right, _) = fit.gram.fitted(&fit.weights, |c| !left_out.contains(&c));
                let solver = Solver::new(&gram, |c| free[c]);
                let theta = solver.solve(&right);
                let (gram, right, _) = fit.gram.sum(&fit.weights, |c| held.contains(&c));
                let slope = (0..theta.len()).map(|i| right[i] - times(&gram, i, &theta)).collect();
                let error = (0..fit.design.dof())
                    .map(|j| {
                        let mut own = vec![0.0; fit.design.dof()];
                        own[j] = fit.weights[j];
                        let (gram, right, square) = fit.gram.sum(&own, |c| held.contains(&c));
                        let quadratic: f64 =
                            (0..theta.len()).map(|i| theta[i] * times(&gram, i, &theta)).sum();
                        square - 2.0 * dot(&theta, &right) + quadratic
                    })
                    .collect();
                FoldBase { held: held.clone(), left_out: left_out.clone(), solver, theta, gram, slope, error }
            })
            .collect()
    }
}

/// A column of a symmetric matrix times a vector.
pub(super) fn times(gram: &Mat<f64>, column: usize, x: &[f64]) -> f64 {
    gram.col_as_slice(column).iter().zip(x).map(|(g, v)| g * v).sum()
}
