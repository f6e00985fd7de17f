//! Quantities that cannot be negative: the energy of motion, and the power that friction takes.
//!
//! Both are linear in the coefficients of a fit, so each comes with a standard error. A reading of the
//! torques with the wrong sign fits as well as the right one; these two distinguish them.

use super::fit::{FRICTION, PartFit, Rows};

/// Samples of a part that are used.
const SAMPLES: usize = 300;
/// Errors of neighbouring rows are alike: standard errors of independent rows are multiplied by this.
const ALIKE: f64 = 3.0;

/// A quantity that a fit determines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) std: f64,
}

impl Estimate {
    /// Standard errors from zero.
    pub(super) fn clear(&self) -> f64 {
        if self.std > 0.0 { self.value / self.std } else { 0.0 }
    }
}

/// The factors of the coefficients of a fit to a part.
#[derive(Debug)]
pub(super) struct Energies {
    /// The mean energy of motion of the whole arm, J.
    kinetic: Vec<f64>,
    /// By joint: the mean power that friction takes, W.
    friction: Vec<Vec<f64>>,
}

impl Energies {
    /// From the states of one part.
    pub(super) fn new(rows: &Rows<'_>, part: usize) -> Energies {
        let (n, p, size, body) = (rows.dof(), rows.inertial(), rows.size(), rows.data.body);
        let mut samples: Vec<(usize, usize)> =
            rows.joints.iter().flat_map(|parts| parts[part].at.iter().copied()).collect();
        samples.sort_unstable();
        samples.dedup();
        let every = samples.len().div_ceil(SAMPLES).max(1);
        let (mut q, mut v) = (Vec::new(), Vec::new());
        for (recording, sample) in samples.iter().step_by(every) {
            let recording = &rows.data.recordings[*recording];
            let of = sample * n..(sample + 1) * n;
            q.extend_from_slice(&recording.q[of.clone()]);
            v.extend_from_slice(&recording.v[of]);
        }
        let count = (q.len() / n).max(1) as f64;
        let still = vec![0.0; q.len()];
        let gravity = body.regressor(&q, &still, &still);
        // B(q)·q̇ as columns; half of it times q̇ is the energy of motion.
        let y = body.regressor(&q, &still, &v);
        let mut kinetic = vec![0.0; size];
        for (row, velocity) in v.iter().enumerate() {
            let of = row * p..(row + 1) * p;
            for ((sum, y), g) in kinetic.iter_mut().zip(&y[of.clone()]).zip(&gravity[of]) {
                *sum += 0.5 * velocity * (y - g) / count;
            }
        }
        let friction = (0..n).map(|j| {
            let mut sum = vec![0.0; size];
            let rows_of = &rows.joints[j][part];
            let first = rows.places[j].len() - FRICTION;
            let [step, velocity] = [0, 1].map(|k| &rows_of.columns[first + k]);
            let rows_count = velocity.len().max(1) as f64;
            let mean = |x: &[f64]| x.iter().zip(velocity).map(|(x, v)| x * v).sum::<f64>() / rows_count;
            sum[p + FRICTION * j] = mean(step);
            sum[p + FRICTION * j + 1] = mean(velocity);
            sum
        });
        let friction = friction.collect();
        Energies { kinetic, friction }
    }

    /// The energy of motion of the arm by a fit.
    pub(super) fn kinetic(&self, fit: &PartFit) -> Estimate {
        estimate(&self.kinetic, fit)
    }

    /// The power that friction takes of a joint.
    pub(super) fn friction(&self, fit: &PartFit, joint: usize) -> Estimate {
        estimate(&self.friction[joint], fit)
    }

    /// The power that friction takes of all joints.
    pub(super) fn all_friction(&self, fit: &PartFit) -> Estimate {
        let size = self.kinetic.len();
        let sum = (0..size).map(|c| self.friction.iter().map(|f| f[c]).sum()).collect::<Vec<f64>>();
        estimate(&sum, fit)
    }
}

fn estimate(share: &[f64], fit: &PartFit) -> Estimate {
    let dot = |x: &[f64]| share.iter().zip(x).map(|(a, b)| a * b).sum::<f64>();
    let seen = fit.solver.solve(share);
    // Parameters that no kept column shows are not determined.
    let kept = fit.solver.kept();
    let lost = share.iter().enumerate().any(|(c, s)| *s != 0.0 && kept.binary_search(&c).is_err());
    let std = ALIKE * dot(&seen).max(0.0).sqrt();
    Estimate { value: dot(&fit.theta), std: if lost { std.max(f64::MIN_POSITIVE) } else { std } }
}
