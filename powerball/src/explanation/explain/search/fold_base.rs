//! The base model fitted once without each fold.

use crate::identification::estimate::{Fit, Folds, Solver};
use crate::logs::vector::dot;
use faer::Mat;

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
