//! How well the constants of a servo are known: standard errors under coloured errors.
//!
//! What a simulation leaves is the same sign for half a second and more, and its size changes from one motion
//! to the next. The sandwich (JᵀWJ)⁻¹·(Σ g·gᵀ)·(JᵀWJ)⁻¹ with g = JᵀWr summed over stretches that count as
//! independent holds for any colour within a stretch (Liang and Zeger, Biometrika 73, 1986), with the factor
//! m/(m − p) for m stretches and p parameters.

use super::fit::{Free, normal_equations};
use faer::{Mat, Side};

/// A direction in which the errors hardly change, compared with the strongest one, is not shown.
const UNSHOWN: f64 = 1e-9;
/// A parameter of which this share lies in such directions is not shown.
const UNSHOWN_SHARE: f64 = 1e-3;

/// The standard error of each parameter, in its own unit; `None` where the errors do not change with it
/// alone.
#[must_use]
pub fn standard_errors(
    slopes: &[Vec<Vec<f64>>],
    errors: &[Vec<f64>],
    free: &[Free],
    block: usize,
) -> Vec<Option<f64>> {
    let size = free.len();
    let (normal, _) = normal_equations(slopes, errors, size);
    let Ok(eigen) = normal.self_adjoint_eigen(Side::Lower) else { return vec![None; size] };
    let (strengths, directions) = (eigen.S().column_vector(), eigen.U());
    let strongest = (0..size).fold(0.0f64, |most, c| most.max(strengths[c]));
    let shown: Vec<usize> = (0..size).filter(|c| strengths[*c] > UNSHOWN * strongest).collect();
    let share = |i: usize| shown.iter().map(|c| directions[(i, *c)].powi(2)).sum::<f64>();
    let inverse = Mat::from_fn(size, size, |i, j| {
        shown.iter().map(|c| directions[(i, *c)] * directions[(j, *c)] / strengths[*c]).sum::<f64>()
    });
    let (mut scatter, mut blocks) = (Mat::<f64>::zeros(size, size), 0usize);
    for (k, errors) in errors.iter().enumerate() {
        for from in (0..errors.len()).step_by(block.max(1)) {
            let own = from..(from + block.max(1)).min(errors.len());
            let part: Vec<Vec<Vec<f64>>> =
                slopes.iter().map(|by| vec![by[k][own.clone()].to_vec()]).collect();
            let (_, g) = normal_equations(&part, &[errors[own].to_vec()], size);
            scatter += &g * g.transpose();
            blocks += 1;
        }
    }
    let factor = blocks as f64 / blocks.saturating_sub(size).max(1) as f64;
    let covariance = &inverse * &scatter * &inverse;
    let error = |i: usize| free[i].scale * (factor * covariance[(i, i)].max(0.0)).sqrt();
    (0..size).map(|i| (share(i) > 1.0 - UNSHOWN_SHARE).then(|| error(i))).collect()
}
