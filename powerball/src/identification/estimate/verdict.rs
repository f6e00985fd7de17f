//! A model that is there already, judged on logs that it has not seen.

use super::over_blocks;
use super::residual_stats;
use super::spectrum::noise_floor;
use crate::logs::regression::{Block, Data};
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
    /// Whether even the upper end of the interval is within the tolerance; `None` where the joint does not
    /// move in these logs.
    pub within: Option<bool>,
}

/// Judges what a model leaves on data: an error up to `tolerance` times the rms torque of a joint passes.
#[must_use]
pub fn verdicts(data: &Data<'_>, residual: &[Vec<f64>], tolerance: f64) -> Vec<JointVerdict> {
    let errors = residual_stats(data, residual);
    let floor = noise_floor(data);
    (0..data.dof())
        .map(|j| {
            let rms = errors.rms[j];
            let interval = interval(data, j, &residual[j]);
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

/// The interval of the mean square over blocks.
fn interval(data: &Data<'_>, joint: usize, residual: &[f64]) -> [f64; 2] {
    let of = |block: &Block| {
        let rows = block.rows[joint].clone();
        (residual[rows.clone()].iter().map(|r| r * r).sum(), rows.len() as f64)
    };
    let (mean, half) = over_blocks(&data.blocks.iter().map(of).collect::<Vec<_>>());
    if half.is_infinite() {
        return [0.0, f64::MAX];
    }
    [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()]
}
