//! The result of a driven path: positions, torques by their cause, and errors as figures.

use super::Law;
use super::path::{Path, REST};
use nalgebra::SVector;
use serde::Serialize;
use std::collections::BTreeMap;

/// One cycle of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const N: usize> {
    /// Since the path began, s.
    pub t: f64,
    /// Measured positions, rad.
    pub q: SVector<f64, N>,
    /// Feed-forward torque by part, N·m: rigid arm, friction, effects.
    pub forward: [SVector<f64, N>; 3],
    /// Torque of the feedback, N·m: that of the drives in interpolated position mode.
    pub feedback: SVector<f64, N>,
    /// External torque by the momentum observer, N·m; nothing in interpolated position mode.
    pub external: Option<SVector<f64, N>>,
}

/// A path that was followed once.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<const N: usize> {
    /// Cycles of the path itself.
    pub samples: Vec<Sample<N>>,
    /// The contact that stopped the arm.
    pub contact: Option<Touched>,
    /// Cycles in which data of a joint was missing and its state was carried on, in current mode.
    pub carried_on: u64,
}

/// A contact at which the arm was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Touched {
    /// Since the path began, s.
    pub t: f64,
    /// The joint, from 1, on which it shows most, and its external torque, N·m.
    pub joint: usize,
    /// N·m.
    pub torque: f64,
    /// The contact is on this link, from 1, or beyond it.
    pub link: usize,
}

/// The error of a track relative to its path.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrackingError {
    /// By joint, rad.
    pub rms: Vec<f64>,
    /// By joint, rad.
    pub max: Vec<f64>,
}

impl<const N: usize> Track<N> {
    /// Position less reference, rad, a vector a sample, the reference taken `delay` s late.
    #[must_use]
    pub fn errors(&self, path: &Path<N>, delay: f64) -> Vec<SVector<f64, N>> {
        let period = path.motion().period;
        let at = |s: &Sample<N>| REST as f64 + (s.t - delay) / period;
        self.samples.iter().map(|s| s.q - path.at(at(s)).q).collect()
    }

    /// The errors of [`Self::errors`] as figures by joint.
    #[must_use]
    pub fn error(&self, path: &Path<N>, delay: f64) -> TrackingError {
        let errors = self.errors(path, delay);
        let of = |j: usize| errors.iter().map(move |e| e[j]);
        let count = errors.len().max(1) as f64;
        TrackingError {
            rms: (0..N).map(|j| (of(j).map(|e| e * e).sum::<f64>() / count).sqrt()).collect(),
            max: (0..N).map(|j| of(j).fold(0.0, |m: f64, e| m.max(e.abs()))).collect(),
        }
    }
}

/// The delay, s, common to all joints and tracks, with which they follow a path best: drives that interpolate
/// are late by whole cycles, and that is not an error.
#[must_use]
pub fn common_delay<const N: usize>(tracks: &[&Track<N>], path: &Path<N>) -> f64 {
    let period = path.motion().period;
    let misfit =
        |delay: f64| tracks.iter().flat_map(|t| t.errors(path, delay)).map(|e| e.norm_squared()).sum::<f64>();
    let tries = (0..=80).map(|k| 0.1 * f64::from(k) * period);
    tries.map(|d| (misfit(d), d)).fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a }).1
}

/// The result of following a path with one or several models; the keys of the maps name them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Followed {
    /// The arm's name.
    pub arm: String,
    /// `feedforward`, `torque` or `impedance`.
    pub with: String,
    /// Root mean square by joint, rad.
    pub tracking_error: BTreeMap<String, Vec<f64>>,
    /// Greatest by joint, rad.
    pub largest_error: BTreeMap<String, Vec<f64>>,
    /// The delay, s, with which drives follow set-points, the same for all runs; 0 in current mode.
    pub delay: f64,
    /// Root mean square of the torque by joint, N·m, by its cause.
    pub torque: BTreeMap<String, TorqueParts>,
    /// Bandwidth of the feedback, rad/s, and the largest pole of its sampled loop, where this program closes
    /// it.
    pub bandwidth: Option<f64>,
    /// See [`powerball_controller::laws::largest_pole`].
    pub largest_pole: Option<f64>,
    /// Cycles of the path in each run.
    pub cycles: usize,
    /// The virtual arm that moved: its file, or `built-in`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant: Option<String>,
    /// Runs that were stopped because something touched the arm.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub contact: BTreeMap<String, Touched>,
    /// Cycles of each run in which data of a joint was missing and its state was carried on; runs without any
    /// are left out.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub carried_on: BTreeMap<String, u64>,
}

impl Followed {
    /// Figures of tracks of one path, each with the name of its model.
    #[must_use]
    pub fn of<const N: usize>(
        arm: &str,
        law: &Law<N>,
        path: &Path<N>,
        tracks: &[(&str, Track<N>)],
    ) -> Followed {
        let only: Vec<&Track<N>> = tracks.iter().map(|(_, track)| track).collect();
        let delay = if *law == Law::Feedforward { common_delay(&only, path) } else { 0.0 };
        let mut followed = Followed {
            arm: arm.to_string(),
            with: law.name().to_string(),
            delay,
            cycles: only.iter().map(|track| track.samples.len()).max().unwrap_or(0),
            ..Followed::default()
        };
        for (name, track) in tracks {
            let error = track.error(path, delay);
            followed.tracking_error.insert((*name).to_string(), error.rms);
            followed.largest_error.insert((*name).to_string(), error.max);
            followed.torque.insert((*name).to_string(), track.torques());
            if track.carried_on > 0 {
                followed.carried_on.insert((*name).to_string(), track.carried_on);
            }
            followed.contact.extend(track.contact.map(|contact| ((*name).to_string(), contact)));
        }
        followed
    }

    /// The explained model's share of the base model's error over all joints, where both were driven.
    #[must_use]
    pub fn share_of_base(&self) -> Option<f64> {
        let of = |name| self.tracking_error.get(name).map(|e| e.iter().map(|x| x * x).sum::<f64>().sqrt());
        Some(of("explained")? / of("base")?)
    }
}

/// Root mean squares by joint, N·m.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TorqueParts {
    /// Fed forward for the rigid arm.
    pub rigid: Vec<f64>,
    /// For Eq. 16.
    pub friction: Vec<f64>,
    /// For the effects.
    pub effects: Vec<f64>,
    /// Torque of the feedback.
    pub feedback: Vec<f64>,
    /// External torque that the observer sees, where it ran.
    pub external: Option<Vec<f64>>,
}

impl<const N: usize> Track<N> {
    /// The torques as figures.
    #[must_use]
    pub fn torques(&self) -> TorqueParts {
        let rms = |of: &dyn Fn(&Sample<N>) -> SVector<f64, N>| -> Vec<f64> {
            let sum = self.samples.iter().fold(SVector::<f64, N>::zeros(), |sum, s| {
                let x = of(s);
                sum + x.component_mul(&x)
            });
            let count = self.samples.len().max(1) as f64;
            sum.iter().map(|x| (x / count).sqrt()).collect()
        };
        let observed = self.samples.iter().any(|s| s.external.is_some());
        TorqueParts {
            rigid: rms(&|s| s.forward[0]),
            friction: rms(&|s| s.forward[1]),
            effects: rms(&|s| s.forward[2]),
            feedback: rms(&|s| s.feedback),
            external: observed.then(|| rms(&|s| s.external.unwrap_or_else(SVector::zeros))),
        }
    }
}
