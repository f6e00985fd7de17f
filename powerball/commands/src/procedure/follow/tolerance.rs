//! How far a joint may be from its path in current mode before the arm is stopped: by the gains of the law
//! and by the torque that the feedback must supply.

use super::path::{Parts, between};
use nalgebra::{SMatrix, SVector};

/// Assumed error of the torques by the best known model: share of the rigid arm and the effects at this
/// instant, and of each joint's torque.
const RIGID: f64 = 0.05;
const EFFECTS: f64 = 0.25;
const OF_LIMIT: f64 = 0.01;
/// Share of the greatest friction on the path: it can hold a joint that came to rest.
const FRICTION: f64 = 0.3;
/// The error of a joint follows the torque that is missing with the loop's time constant: this number of
/// cycles counts, before and after.
const CYCLES: usize = 60;
/// A loop that is pushed goes beyond where it settles, and joints push each other.
const DYNAMIC: f64 = 2.0;
/// Whatever the model: a reference that is half a cycle off, encoders, a sampled loop; rad.
const LEAST: f64 = 0.015;

/// The greatest torque, by sample and joint, that the feedback may have to make up for, N·m.
#[derive(Clone, Debug)]
pub(super) struct Tolerance<const N: usize> {
    missing: Vec<SVector<f64, N>>,
    give: f64,
}

impl<const N: usize> Tolerance<N> {
    /// The tolerance of a path for which `fed` is fed forward, or nothing, and that needs `best` by the best
    /// known model. `limits` are the joints' torques, N·m; `give` is how far a push may take a joint off the
    /// path, rad.
    pub(super) fn new(fed: Option<&Parts<N>>, best: &Parts<N>, limits: &SVector<f64, N>, give: f64) -> Self {
        let greatest = |series: &mut dyn Iterator<Item = SVector<f64, N>>| {
            series.fold(SVector::zeros(), |most: SVector<f64, N>, x| most.sup(&x))
        };
        let now: Vec<SVector<f64, N>> = (0..best.rigid.len())
            .map(|k| {
                let at = k as f64;
                let fed = fed.map_or_else(SVector::zeros, |fed| fed.total(at));
                let part = |series: &[SVector<f64, N>], share: f64| between(series, at).abs() * share;
                (best.total(at) - fed).abs() + part(&best.rigid, RIGID) + part(&best.effects, EFFECTS)
            })
            .collect();
        let friction = greatest(&mut best.friction.iter().map(|f| f.abs())) * FRICTION + limits * OF_LIMIT;
        let missing = |k: usize| {
            let near = now.iter().take(k + CYCLES).skip(k.saturating_sub(CYCLES));
            greatest(&mut near.copied()) * DYNAMIC + friction
        };
        Tolerance { missing: (0..now.len()).map(missing).collect(), give }
    }

    /// By joint, rad, at a sample and with this stiffness (N·m/rad) of the loop. Infinite where the stiffness
    /// cannot be inverted: the driver's other limits hold.
    pub(super) fn at(&self, sample: usize, stiffness: &SMatrix<f64, N, N>) -> [f64; N] {
        let last = self.missing.len().saturating_sub(1);
        let (Some(missing), Some(yielding)) = (self.missing.get(sample.min(last)), stiffness.try_inverse())
        else {
            return [f64::INFINITY; N];
        };
        let error = yielding.abs() * missing;
        error.map(|error| LEAST + self.give + error).into()
    }
}
