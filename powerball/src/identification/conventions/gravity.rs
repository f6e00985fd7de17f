//! Whether the torques hold what gravity asks for.
//!
//! The first moments of the links show twice: in gravity and in inertia. Where gravity was taken out of the
//! torques, inertia still shows them, and the weight that they would have is missing.

use super::rows::Rows;

/// Samples that are looked at.
const SAMPLES: usize = 500;
/// Gravity acts on a joint where it is more than this share of its torque.
const ACTS: f64 = 0.2;

/// The rms torque of gravity by joint that a fit's inertial parameters stand for, N·m, and the largest of any
/// joint.
pub(super) fn weight(rows: &Rows<'_>, theta: &[f64]) -> (Vec<f64>, f64) {
    let (n, body) = (rows.dof(), rows.data.body);
    let all: usize = rows.data.recordings.iter().map(|r| r.len()).sum();
    let every = all.div_ceil(SAMPLES).max(1);
    let mut q = Vec::new();
    for recording in &rows.data.recordings {
        recording.q.chunks_exact(n).step_by(every).for_each(|sample| q.extend_from_slice(sample));
    }
    let still = vec![0.0; q.len()];
    let torque = body.torque(&q, &still, &still, &theta[..rows.inertial()]);
    let count = (torque.len() / n).max(1) as f64;
    let rms = |j: usize| (torque.iter().skip(j).step_by(n).map(|x| x * x).sum::<f64>() / count).sqrt();
    let largest = torque.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    ((0..n).map(rms).collect(), largest)
}

/// Whether gravity acts on any joint of the arm where it was.
pub(super) fn acts(rows: &Rows<'_>) -> bool {
    let (n, body) = (rows.dof(), rows.data.body);
    let of_g = 1e-3 * body.gravity().iter().map(|x| x * x).sum::<f64>().sqrt();
    rows.data.recordings.iter().any(|recording| {
        let q: Vec<f64> = recording.q.iter().take(n).copied().collect();
        let still = vec![0.0; n];
        of_g > 0.0 && body.regressor(&q, &still, &still).iter().any(|y| y.abs() > of_g)
    })
}

/// The joints on which gravity acts, by a fit to torques that it was taken out of.
pub(super) fn acts_on(rows: &Rows<'_>, theta: &[f64], power: &[f64]) -> Vec<usize> {
    let (rms, _) = weight(rows, theta);
    (0..rows.dof()).filter(|j| rows.moves(*j) && rms[*j] > ACTS * power[*j].sqrt()).collect()
}
