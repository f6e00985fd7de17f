//! One piece of a log on an even grid: positions smoothed once, velocities and accelerations from them.
//! Joints are those of the log, or the motors that it was turned to.

use crate::log::Log;
use crate::signal::{Butterworth, difference, resample};
use std::ops::Range;

/// A stretch without gaps on an even grid.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Which log it is a piece of.
    pub log: usize,
    /// Time of the first sample in the log's own t, s.
    pub start: f64,
    /// Time of the first sample on the clock common to all logs, s.
    pub clock: f64,
    /// Samples a second.
    pub rate: f64,
    /// Smoothed positions, n a sample.
    pub q: Vec<f64>,
    /// Velocities, n a sample.
    pub v: Vec<f64>,
    /// Accelerations, n a sample.
    pub a: Vec<f64>,
    /// Torques as logged, by joint.
    pub torque: Vec<Vec<f64>>,
    /// Temperatures, by joint, °C, where they were logged.
    pub temperature: Option<Vec<Vec<f64>>>,
    /// Cutoff of the filter that smoothed positions, Hz.
    pub smoothing: f64,
    /// Joints.
    pub dof: usize,
}

impl Recording {
    /// Puts the samples `piece` of a log onto a grid of `step` seconds, positions smoothed to `smoothing` Hz.
    ///
    /// `None` where the piece is shorter than two samples.
    #[must_use]
    pub fn new(log: &Log, index: usize, piece: Range<usize>, step: f64, smoothing: f64) -> Option<Recording> {
        let t = log.t.get(piece.clone()).filter(|t| t.len() >= 2)?;
        let start = t[0];
        let count = ((t[t.len() - 1] - start) / step).floor() as usize + 1;
        let rate = 1.0 / step;
        let dof = log.q.len();
        let onto = |x: &Vec<f64>| resample::linear(t, &x[piece.clone()], start, step, count);
        let [q, v, a] = [const { Vec::new() }; 3].map(|_: Vec<f64>| vec![0.0; dof * count]);
        let mut recording = Recording {
            log: index,
            start,
            clock: start + log.clock,
            rate,
            q,
            v,
            a,
            torque: log.torque.iter().map(onto).collect(),
            temperature: log.temperature.as_ref().map(|t| t.iter().map(onto).collect()),
            smoothing,
            dof,
        };
        let positions: Vec<&[f64]> = log.q.iter().map(|q| &q[piece.clone()]).collect();
        recording.follow(t, &positions, smoothing).then_some(recording)
    }

    /// Takes positions, velocities and accelerations from samples at times `t`, by joint, smoothed to
    /// `smoothing` Hz.
    ///
    /// `false` if there are too few samples or no such filter; nothing has changed then.
    pub fn follow(&mut self, t: &[f64], positions: &[&[f64]], smoothing: f64) -> bool {
        let Some(filter) = smoother(smoothing, self.rate) else { return false };
        if t.len() < 2 {
            return false;
        }
        let (step, count, dof) = (1.0 / self.rate, self.len(), self.dof);
        for (j, q) in positions.iter().enumerate() {
            let smooth = filter.zero_phase(&resample::cubic(t, q, self.start, step, count));
            let v = difference::derivative(&smooth, step);
            let a = difference::second_derivative(&smooth, step);
            for (state, values) in [&mut self.q, &mut self.v, &mut self.a].into_iter().zip([smooth, v, a]) {
                for (k, value) in values.into_iter().enumerate() {
                    state[k * dof + j] = value;
                }
            }
        }
        self.smoothing = smoothing;
        true
    }

    /// One joint's torque, smoothed as the positions are: a torque that is linear in the motion stays so.
    #[must_use]
    pub fn smooth_torque(&self, joint: usize) -> Vec<f64> {
        let torque = &self.torque[joint];
        smoother(self.smoothing, self.rate).map_or_else(|| torque.clone(), |filter| filter.zero_phase(torque))
    }

    /// Samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.q.len() / self.dof
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.q.is_empty()
    }

    /// One joint's positions.
    pub fn position(&self, joint: usize) -> impl Iterator<Item = f64> + '_ {
        self.q.iter().skip(joint).step_by(self.dof).copied()
    }

    /// One joint's velocities.
    pub fn velocity(&self, joint: usize) -> impl Iterator<Item = f64> + '_ {
        self.v.iter().skip(joint).step_by(self.dof).copied()
    }

    /// One joint's accelerations.
    pub fn acceleration(&self, joint: usize) -> impl Iterator<Item = f64> + '_ {
        self.a.iter().skip(joint).step_by(self.dof).copied()
    }
}

/// The filter for positions before they are differentiated, and for torques with them.
fn smoother(smoothing: f64, rate: f64) -> Option<Butterworth> {
    Butterworth::low_pass(4, smoothing.min(0.4 * rate), rate)
}
