//! A model that is there already, judged on logs that it has not seen.

use super::distribution::t_quantile_975;
use super::noise::noise_floor;
use super::spread;
use crate::regression::Data;
use serde::Serialize;

/// How a joint's prediction does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointVerdict {
    /// Joint, from 1.
    pub joint: usize,
    /// rms of the error, N·m.
    pub rms: f64,
    /// 95 % interval of the rms, from blocks that count as independent, N·m.
    pub interval: [f64; 2],
    /// rms of the error over rms of the measured torque.
    pub relative: f64,
    /// What white measurement noise alone would leave, N·m.
    pub noise_floor: f64,
    /// Whether even the upper end of the interval is within the tolerance; `None` where the joint does not move in these logs.
    pub within: Option<bool>,
}

/// Judges what a model leaves on data: an error up to `tolerance` times the rms torque of a joint passes.
#[must_use]
pub fn verify(data: &Data<'_>, residual: &[Vec<f64>], tolerance: f64) -> Vec<JointVerdict> {
    let errors = spread(data, residual);
    let floor = noise_floor(data);
    (0..data.dof())
        .map(|j| {
            let rms = errors.rms[j];
            let interval = interval(data, j, &residual[j], rms);
            let torque = if errors.relative[j] > 0.0 { rms / errors.relative[j] } else { 0.0 };
            let moves = !data.joints[j].is_empty();
            JointVerdict {
                joint: j + 1,
                rms,
                interval,
                relative: errors.relative[j],
                noise_floor: floor[j],
                within: moves.then_some(interval[1] <= tolerance * torque),
            }
        })
        .collect()
}

/// The interval of the mean square as a ratio of sums over blocks, Student's t with as many degrees of freedom.
fn interval(data: &Data<'_>, joint: usize, residual: &[f64], rms: f64) -> [f64; 2] {
    let (mut count, mut squares) = (0.0, 0.0);
    let mean = rms * rms;
    let total = residual.len() as f64;
    for block in &data.blocks {
        let rows = block.rows[joint].clone();
        if rows.is_empty() {
            continue;
        }
        count += 1.0;
        let excess: f64 = residual[rows].iter().map(|r| r * r - mean).sum();
        squares += excess * excess;
    }
    if count < 2.0 || total == 0.0 {
        return [0.0, f64::MAX];
    }
    let error = (squares * count / (count - 1.0)).sqrt() / total;
    let half = t_quantile_975(count - 1.0) * error;
    [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()]
}
