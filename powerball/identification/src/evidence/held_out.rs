//! The error on logs that took no part in the fit.

use super::base::{Rows, Trial};
use powerball_controller::JointNumber;
use powerball_logs::regression::{Column, Data};
use powerball_logs::vector::dot;

/// The share of the squared error of `joints` that a trial takes away on other logs, on which its columns are
/// `columns`: the median over these logs.
#[must_use]
pub fn gain_on(
    other: &Rows<'_>,
    (trial, columns): (&Trial, &[Column]),
    weights: &[f64],
    joints: &[JointNumber],
) -> f64 {
    let data = other.data;
    let added = other.added(columns, trial);
    let (mut fall, mut scale) = (vec![0.0; data.logs.len()], vec![0.0; data.logs.len()]);
    for (j, weight) in weights.iter().enumerate() {
        for (recording, rows) in data.recordings.iter().zip(&data.joints[j].rows) {
            fall[recording.log] += weight * other.fall(&added, j, rows.clone());
            if joints.contains(&JointNumber::from_index(j)) {
                let residual = &other.residual[j][rows.clone()];
                scale[recording.log] += weight * dot(residual, residual);
            }
        }
    }
    // The median keeps one odd log (something held, something touched) from deciding.
    let mut gains: Vec<f64> =
        fall.iter().zip(&scale).filter(|(_, s)| **s > 0.0).map(|(f, s)| f / s).collect();
    gains.sort_by(f64::total_cmp);
    match gains.len() {
        0 => 0.0,
        n if n % 2 == 1 => gains[n / 2],
        n => 0.5 * (gains[n / 2 - 1] + gains[n / 2]),
    }
}

/// The mean over joints of the logarithm of the squared error on other logs, with a trial less without it:
/// negative if the trial predicts better. It does not depend on the units or sizes of the joints.
#[must_use]
pub fn log_change(other: &Rows<'_>, (trial, columns): (&Trial, &[Column])) -> f64 {
    let added = other.added(columns, trial);
    let (mut sum, mut joints) = (0.0, 0.0);
    for (j, residual) in other.residual.iter().enumerate() {
        let before = dot(residual, residual);
        let after = before - other.fall(&added, j, 0..residual.len());
        if before > 0.0 && after > 0.0 {
            sum += (after / before).ln();
            joints += 1.0;
        }
    }
    if joints > 0.0 { sum / joints } else { 0.0 }
}

/// The mean square of a residual in one log over the variance that each joint has elsewhere, `sigma` squared,
/// mean over the joints that have a variance and at least `rows` rows in the log; `None` where none has.
#[must_use]
pub fn error_in_log(
    data: &Data<'_>,
    residual: &[Vec<f64>],
    sigma: &[f64],
    (log, rows): (usize, usize),
) -> Option<f64> {
    let of = |j: usize| {
        let own = data.recordings.iter().zip(&data.joints[j].rows).filter(|(r, _)| r.log == log);
        let (square, count) = own.fold((0.0, 0), |(square, count), (_, rows)| {
            let own = &residual[j][rows.clone()];
            (square + dot(own, own), count + rows.len())
        });
        (count >= rows && sigma[j] > 0.0).then(|| square / count as f64 / sigma[j].powi(2))
    };
    let joints: Vec<f64> = (0..data.dof()).filter_map(of).collect();
    (!joints.is_empty()).then(|| joints.iter().sum::<f64>() / joints.len() as f64)
}

/// The correlation of two additions to the prediction of the same rows: 1 where they are the same but for
/// their size, 0 where one of them is nothing.
#[must_use]
pub fn correlation(weights: &[f64], a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let sum = |x: &[Vec<f64>], y: &[Vec<f64>]| -> f64 {
        weights.iter().zip(x.iter().zip(y)).map(|(w, (x, y))| w * dot(x, y)).sum()
    };
    let power = sum(a, a) * sum(b, b);
    if power > 0.0 { sum(a, b) / power.sqrt() } else { 0.0 }
}
