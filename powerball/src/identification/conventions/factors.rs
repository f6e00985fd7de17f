//! A factor by joint: what each torque column must be multiplied by to be of one body with the others.
//!
//! The rigid arm is shared by all joints, so a factor on one of them shows. A common factor does not: the
//! median joint keeps its own. A joint that shares nothing with others keeps its own too.

use super::change::FACTOR;
use super::fit::factors_of_body;
use super::reading::Torques;
use super::rows::Rows;

/// The factors of all joints that fit a part best, relative to those of `read`, where some are not one.
pub(super) fn factors(rows: &Rows<'_>, read: &Torques, part: usize, ridge: f64) -> Option<Vec<f64>> {
    relative(factors_of_body(rows, read, part, ridge).iter().map(|kappa| 1.0 / kappa).collect())
}

/// Numbers of the arm file by joint as factors; `None` where some are missing or all are alike.
pub(super) fn filed(numbers: impl Iterator<Item = Option<f64>>) -> Option<Vec<f64>> {
    let numbers = numbers.map(|x| x.map(f64::abs)).collect::<Option<Vec<f64>>>()?;
    relative(numbers)
}

/// Over the median, where that leaves factors that are not one.
fn relative(numbers: Vec<f64>) -> Option<Vec<f64>> {
    let middle = median(numbers.clone());
    let factors: Vec<f64> = numbers.iter().map(|x| x / middle).collect();
    let sound = factors.iter().all(|f| f.is_finite() && *f > 0.0);
    (sound && factors.iter().any(|f| f.ln().abs() > FACTOR.ln())).then_some(factors)
}

pub(super) fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x.get(x.len() / 2).copied().unwrap_or(1.0)
}
