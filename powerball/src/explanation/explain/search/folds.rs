//! Held-out gains: the base is fitted once without each fold, a candidate then costs a small solve.
//!
//! Also here: the base model fitted once without each fold.

use super::screen::{Screen, Trial};
use crate::controller::JointNumber;
use crate::identification::estimate::{Added, Fit, Folds, NormalEquations, Solver, runs};
use crate::logs::vector::dot;
use faer::Mat;

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
    let mut cells: Vec<Option<Added>> = vec![None; folds.cells];
    for j in screen.joints_of(&trial.columns) {
        for (cell, rows) in runs(data, folds, j) {
            let cell = cells[cell].get_or_insert_with(|| Added::zero(size, k));
            cell.add_rows(&fit.design, (j, &rows), &trial.columns, &data.joints[j].torque, fit.weights[j]);
        }
    }
    // A difference from the sum over all cells would leave rounding where nothing is left.
    let sum = |wanted: &dyn Fn(usize) -> bool| {
        let own = cells.iter().enumerate().filter(|(cell, _)| wanted(*cell));
        own.filter_map(|(_, products)| products.as_ref()).fold(Added::zero(size, k), |mut sum, cell| {
            sum.add(cell, 1.0);
            sum
        })
    };
    screen
        .folds(folds, local)
        .iter()
        .filter_map(|fold| {
            let scale: f64 = joints.iter().map(|j| fold.error[j.index()]).sum();
            let fitted = sum(&|cell| !fold.left_out.contains(&cell));
            let held = sum(&|cell| fold.held.contains(&cell));
            (scale > 0.0).then(|| change(fold, &fitted, &held) / scale)
        })
        .collect()
}

/// By how much the held squared error falls.
fn change(fold: &FoldBase, fitted: &Added, held: &Added) -> f64 {
    let (base, rest) = fitted.without_base(&fold.solver);
    let right: Vec<f64> =
        fitted.right.iter().zip(&fitted.cross).map(|(own, cross)| own - dot(cross, &fold.theta)).collect();
    let x = fitted.solver(&rest).solve(&right);
    // What the candidate adds to the prediction: C x − A s.
    let mut shift = vec![0.0; fold.theta.len()];
    for (b, x) in base.iter().zip(&x) {
        shift.iter_mut().zip(b).for_each(|(s, b)| *s += x * b);
    }
    let mut change = -2.0 * dot(&shift, &fold.slope);
    for a in 0..x.len() {
        change += 2.0 * x[a] * (held.right[a] - dot(&held.cross[a], &fold.theta));
        change += 2.0 * x[a] * dot(&held.cross[a], &shift);
        for b in 0..x.len() {
            change -= x[a] * x[b] * held.square[(a, b)];
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
                let fitted = fit.gram.fitted(&fit.weights, |c| !left_out.contains(&c));
                let solver = fitted.solver(|c| free[c]);
                let theta = solver.solve(&fitted.right);
                let NormalEquations { gram, right, .. } = fit.gram.sum(&fit.weights, |c| held.contains(&c));
                let slope = (0..theta.len()).map(|i| right[i] - times(&gram, i, &theta)).collect();
                let error = (0..fit.design.dof())
                    .map(|j| {
                        let mut own = vec![0.0; fit.design.dof()];
                        own[j] = fit.weights[j];
                        fit.gram.sum(&own, |c| held.contains(&c)).left(&theta)
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
