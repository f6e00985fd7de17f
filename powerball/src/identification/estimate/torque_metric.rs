//! How far apart values of a parameter set are, in torque.

use dyngen::{Error, Evaluator, Function, Model, SetKind};
use faer::Mat;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// States over which torques are compared.
const STATES: usize = 400;
/// Velocities and accelerations where the arm file gives no limit.
const SPEED: f64 = 1.0;
const ACCELERATION: f64 = 3.0;
/// What a unit of a parameter counts beside a N·m: directions that no torque shows are held by it alone.
const UNSEEN: f64 = 1e-2;

/// Torque differences of a parameter set's values over random states within an arm's limits.
#[derive(Clone, Debug)]
pub struct TorqueMetric {
    /// By joint: mean of YᵀY over the states, (N·m)² for each unit².
    joints: Vec<Mat<f64>>,
}

impl TorqueMetric {
    /// For a set of an arm; the states are the same at every call.
    ///
    /// # Errors
    /// As [`Evaluator::new`].
    pub fn new(model: &Model, kind: SetKind) -> Result<TorqueMetric, Error> {
        let evaluator = Evaluator::new(model, Function::Regressor, kind)?;
        let arm = model.arm();
        let n = arm.dof();
        let p = evaluator.outputs() / n.max(1);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let [mut q, mut v, mut a] = [const { Vec::new() }; 3];
        for _ in 0..STATES {
            for joint in &arm.joints {
                let [low, high] = joint.position.unwrap_or([-std::f64::consts::PI, std::f64::consts::PI]);
                q.push(low + (high - low) * rng.random_range(0.0..1.0));
                v.push(joint.velocity.unwrap_or(SPEED) * rng.random_range(-1.0..1.0));
                a.push(joint.acceleration.unwrap_or(ACCELERATION) * rng.random_range(-1.0..1.0));
            }
        }
        let mut y = vec![0.0; STATES * n * p];
        evaluator.evaluate(&q, &v, &a, &[], &mut y);
        let joint = |j: usize| {
            let rows = Mat::from_fn(STATES, p, |s, c| y[(s * n + j) * p + c]);
            rows.transpose() * &rows * faer::Scale(1.0 / STATES as f64)
        };
        Ok(TorqueMetric { joints: (0..n).map(joint).collect() })
    }

    /// As the metric of [`super::nearest`], where a torque of `noise` N·m counts 1.
    #[must_use]
    pub fn matrix(&self, noise: f64) -> Mat<f64> {
        let p = self.joints.first().map_or(0, Mat::ncols);
        Mat::from_fn(p, p, |i, k| {
            let seen: f64 = self.joints.iter().map(|g| g[(i, k)]).sum();
            (seen + if i == k { UNSEEN * UNSEEN } else { 0.0 }) / (noise * noise)
        })
    }

    /// rms of the torque that a difference of values makes, by joint, N·m.
    #[must_use]
    pub fn rms(&self, difference: &[f64]) -> Vec<f64> {
        let square = |g: &Mat<f64>| -> f64 {
            (0..g.nrows())
                .map(|i| difference[i] * (0..g.ncols()).map(|k| g[(i, k)] * difference[k]).sum::<f64>())
                .sum()
        };
        self.joints.iter().map(|g| square(g).max(0.0).sqrt()).collect()
    }
}
