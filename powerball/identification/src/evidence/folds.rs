//! Held-out gains: the model is fitted once without each fold, columns then cost a small solve.

use super::base::{Base, Trial};
use crate::estimate::{Added, Fit, Folds, NormalEquations, Solver, runs};
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_logs::vector::dot;
use std::sync::OnceLock;

/// A model fitted without each fold, made at the first use.
#[derive(Debug)]
pub struct FoldFits<'f> {
    fit: &'f Fit,
    /// The model's columns that are refitted.
    free: Vec<bool>,
    /// Whole logs, stretches.
    fits: [OnceLock<Vec<FoldFit>>; 2],
}

/// The model fitted without one fold.
#[derive(Debug)]
struct FoldFit {
    held: Vec<usize>,
    left_out: Vec<usize>,
    /// Over what is fitted.
    solver: Solver,
    theta: Vec<f64>,
    /// Over what is held.
    gram: Mat<f64>,
    /// (y − Aθ)'A over what is held.
    slope: Vec<f64>,
    /// Weighted squared error of what is held, by joint.
    error: Vec<f64>,
}

impl<'f> FoldFits<'f> {
    /// For a fit of which the columns in `free` are refitted.
    #[must_use]
    pub fn new(fit: &'f Fit, free: Vec<bool>) -> FoldFits<'f> {
        FoldFits { fit, free, fits: [OnceLock::new(), OnceLock::new()] }
    }

    /// Share by which the held-out squared error of some joints falls with a trial's columns, by fold; the
    /// model and the columns are fitted to the rest. `local` is as in [`Folds::folds`].
    ///
    /// The model is fitted once without each of `folds`, so every call must give the same ones.
    #[must_use]
    pub fn gains(
        &self,
        base: &Base<'_>,
        trial: &Trial,
        joints: &[JointNumber],
        folds: &Folds,
        local: bool,
    ) -> Vec<f64> {
        let (data, fit) = (base.rows.data, self.fit);
        let (size, k) = (fit.design.size, trial.columns.len());
        let mut cells: Vec<Option<Added>> = vec![None; folds.cells];
        for j in base.joints_of(&trial.columns) {
            for (cell, rows) in runs(data, folds, j) {
                let cell = cells[cell].get_or_insert_with(|| Added::zero(size, k));
                let torque = &data.joints[j].torque;
                cell.add_rows(&fit.design, (j, &rows), &trial.columns, torque, fit.weights[j]);
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
        let fits = self.fits[usize::from(local)].get_or_init(|| self.without_each(folds, local));
        let gain = |fold: &FoldFit| {
            let scale: f64 = joints.iter().map(|j| fold.error[j.index()]).sum();
            let fitted = sum(&|cell| !fold.left_out.contains(&cell));
            let held = sum(&|cell| fold.held.contains(&cell));
            (scale > 0.0).then(|| fold.fall(&fitted, &held) / scale)
        };
        fits.iter().filter_map(gain).collect()
    }

    fn without_each(&self, folds: &Folds, local: bool) -> Vec<FoldFit> {
        let FoldFits { fit, free, .. } = self;
        let (held, left_out) = folds.folds(local);
        let one = |(held, left_out): (&Vec<usize>, &Vec<usize>)| {
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
            FoldFit { held: held.clone(), left_out: left_out.clone(), solver, theta, gram, slope, error }
        };
        held.iter().zip(left_out).map(one).collect()
    }
}

impl FoldFit {
    /// The fall of the held-out squared error.
    fn fall(&self, fitted: &Added, held: &Added) -> f64 {
        let (base, rest) = fitted.without_base(&self.solver);
        let right: Vec<f64> = fitted
            .right
            .iter()
            .zip(&fitted.cross)
            .map(|(own, cross)| own - dot(cross, &self.theta))
            .collect();
        let x = fitted.solver(&rest).solve(&right);
        // The addition of the columns to the prediction: C x − A s.
        let mut shift = vec![0.0; self.theta.len()];
        for (b, x) in base.iter().zip(&x) {
            shift.iter_mut().zip(b).for_each(|(s, b)| *s += x * b);
        }
        let mut change = -2.0 * dot(&shift, &self.slope);
        for a in 0..x.len() {
            change += 2.0 * x[a] * (held.right[a] - dot(&held.cross[a], &self.theta));
            change += 2.0 * x[a] * dot(&held.cross[a], &shift);
            for b in 0..x.len() {
                change -= x[a] * x[b] * held.square[(a, b)];
            }
        }
        change - (0..shift.len()).map(|i| shift[i] * times(&self.gram, i, &shift)).sum::<f64>()
    }
}

/// A column of a symmetric matrix times a vector.
fn times(gram: &Mat<f64>, column: usize, x: &[f64]) -> f64 {
    gram.col_as_slice(column).iter().zip(x).map(|(g, v)| g * v).sum()
}
