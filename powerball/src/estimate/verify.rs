//! A model that is there already, judged on logs that it has not seen.

use super::distribution::t_quantile_975;
use super::fit::friction_columns;
use super::noise::noise_floor;
use super::{Design, Solution, spread};
use crate::regression::Data;
use serde::Serialize;

/// The figures of a model: the minimal set's values, and γ1 … γ5 of Eq. 16 by joint.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueModel {
    /// In the order of the minimal set, SI units.
    pub inertial: Vec<f64>,
    /// By joint: N·m, s/rad, N·m, s/rad, N·m·s/rad.
    pub friction: Vec<[f64; 5]>,
    /// Constant torques by joint, N·m; 0 where the law has none.
    pub offset: Vec<f64>,
}

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

impl TorqueModel {
    /// The model of a fit.
    #[must_use]
    pub fn of(solution: &Solution) -> TorqueModel {
        let joints = || 0..solution.layout.dof;
        TorqueModel {
            inertial: solution.inertial().to_vec(),
            friction: joints().map(|j| solution.friction(j)).collect(),
            offset: joints().map(|j| solution.offset(j)).collect(),
        }
    }

    /// Measured less predicted torque, by joint, N·m.
    #[must_use]
    pub fn residual(&self, data: &Data<'_>) -> Vec<Vec<f64>> {
        let shapes: Vec<[f64; 2]> = self.friction.iter().map(|g| [g[1], g[3]]).collect();
        let design = Design::new(data, &friction_columns(data, &shapes), &[]);
        let mut theta = vec![0.0; design.size];
        theta[..design.inertial].copy_from_slice(&self.inertial);
        for (j, gamma) in self.friction.iter().enumerate() {
            for (k, level) in [gamma[0], gamma[2], gamma[4]].into_iter().enumerate() {
                theta[design.friction(j, k)] = level;
            }
        }
        (0..data.dof())
            .map(|j| {
                let predicted = design.predict(j, &theta);
                let torque = data.joints[j].torque.iter();
                torque.zip(predicted).map(|(y, p)| y - p - self.offset[j]).collect()
            })
            .collect()
    }

    /// Judges the model on data: an error up to `tolerance` times the rms torque of a joint passes.
    #[must_use]
    pub fn verify(&self, data: &Data<'_>, tolerance: f64) -> Vec<JointVerdict> {
        let residual = self.residual(data);
        let errors = spread(data, &residual);
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
