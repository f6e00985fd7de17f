//! A path that passed all checks, and the torques that a model predicts for it.

use crate::procedure::{Cleared, Envelope, RecordError};
use nalgebra::SVector;
use powerball_bus::driver::Profile;
use powerball_controller::dynamics::Reference;
use powerball_logs::motion::Motion;

/// Cycles at rest before and after a path, in which what is fed forward comes and goes.
pub(super) const REST: usize = 100;

/// The torques that the model predicts for a path, one vector per sample, N·m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts<const N: usize> {
    /// The rigid arm.
    pub rigid: Vec<SVector<f64, N>>,
    /// Eq. 16.
    pub friction: Vec<SVector<f64, N>>,
    /// Torque of the effects, in addition to the rigid arm and friction.
    pub effects: Vec<SVector<f64, N>>,
}

impl<const N: usize> Parts<N> {
    /// The sum of the parts at a time in samples.
    pub(super) fn total(&self, at: f64) -> SVector<f64, N> {
        between(&self.rigid, at) + self.losses(at)
    }

    /// The torque in addition to that of the rigid arm: friction and effects.
    pub(super) fn losses(&self, at: f64) -> SVector<f64, N> {
        between(&self.friction, at) + between(&self.effects, at)
    }

    /// The joint that needs more torque at a sample than `limits` (N·m): sample, joint from 0, torque.
    #[must_use]
    pub fn beyond(&self, limits: &SVector<f64, N>) -> Option<(usize, usize, f64)> {
        (0..self.rigid.len()).find_map(|k| {
            let torque = self.total(k as f64);
            let wrong =
                |j: &usize| torque[*j].abs().partial_cmp(&limits[*j]).is_none_or(std::cmp::Ordering::is_gt);
            (0..N).find(wrong).map(|j| (k, j, torque[j]))
        })
    }
}

/// A series at a time in samples; its ends hold.
pub(super) fn between<const N: usize>(series: &[SVector<f64, N>], at: f64) -> SVector<f64, N> {
    let last = series.len().saturating_sub(1);
    let at = at.clamp(0.0, last as f64);
    let (k, part) = (at as usize, at.fract());
    let sample = |k: usize| series.get(k.min(last)).copied().unwrap_or_else(SVector::zeros);
    sample(k) * (1.0 - part) + sample(k + 1) * part
}

/// A path with rest before and after it.
#[derive(Clone, Debug)]
pub struct Path<const N: usize> {
    motion: Cleared,
    /// q, q̇ and q̈, the latter by central differences of the positions.
    pub(super) reference: Vec<Reference<f64, N>>,
}

impl<const N: usize> Path<N> {
    /// Looks at a path as [`Envelope::clear`] does.
    ///
    /// # Errors
    /// Where the arm must not go along it.
    pub fn clear(
        motion: &Motion,
        envelope: &Envelope<N>,
        profile: &Profile<N>,
    ) -> Result<Path<N>, RecordError> {
        // A motion of other joints or without samples is refused here.
        envelope.clear(profile, motion.clone())?;
        let (all, h) = (motion.len(), motion.period);
        let place = |k: usize| {
            let k = k.saturating_sub(REST).min(all - 1);
            SVector::<f64, N>::from_column_slice(&motion.q[k * N..(k + 1) * N])
        };
        let mut rested = Motion::new(N, h);
        let mut reference = Vec::with_capacity(all + 2 * REST);
        for k in 0..all + 2 * REST {
            let [before, now, after] = [place(k.saturating_sub(1)), place(k), place(k + 1)];
            let (dq, ddq) = ((after - before) / (2.0 * h), (after - now * 2.0 + before) / (h * h));
            reference.push(Reference { q: now, dq, ddq });
            rested.push((0..N).map(|j| [now[j], dq[j], ddq[j]]));
        }
        Ok(Path { motion: envelope.clear(profile, rested)?, reference })
    }

    /// The motion, rest included.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        self.motion.motion()
    }

    /// The position at which the path begins.
    #[must_use]
    pub fn start(&self) -> SVector<f64, N> {
        self.reference.first().map_or_else(SVector::zeros, |r| r.q)
    }

    pub(super) fn at(&self, at: f64) -> Reference<f64, N> {
        let of = |pick: fn(&Reference<f64, N>) -> SVector<f64, N>| {
            let (k, part) = (at.max(0.0) as usize, at.max(0.0).fract());
            let last = self.reference.len().saturating_sub(1);
            let sample = |k: usize| self.reference.get(k.min(last)).map_or_else(SVector::zeros, pick);
            sample(k) * (1.0 - part) + sample(k + 1) * part
        };
        Reference { q: of(|r| r.q), dq: of(|r| r.dq), ddq: of(|r| r.ddq) }
    }

    /// Whether a cycle belongs to the path itself.
    pub(super) fn is_within(&self, k: usize) -> bool {
        (REST..self.reference.len().saturating_sub(REST)).contains(&k)
    }
}
