//! The last samples of a stream, and stretches of them on the even grid that all rows share.

use powerball_logs::log::{LiveSample, Log};
use powerball_logs::signal::resample;

/// Time that is kept, s.
const KEPT: f64 = 40.0;
/// A longer step is a gap, s.
const GAP: f64 = 0.1;

/// Samples without a gap.
#[derive(Debug)]
pub(super) struct Buffer {
    /// s.
    step: f64,
    /// Stretches begin on multiples of this many points of the grid, so that rows are at the same times in
    /// all.
    decimation: usize,
    /// A point of the grid, s.
    origin: f64,
    t: Vec<f64>,
    q: Vec<Vec<f64>>,
    torque: Vec<Vec<f64>>,
}

impl Buffer {
    pub(super) fn new(dof: usize, step: f64, decimation: usize) -> Buffer {
        let [q, torque] = [(); 2].map(|()| vec![Vec::new(); dof]);
        Buffer { step, decimation, origin: 0.0, t: Vec::new(), q, torque }
    }

    /// Whether there is a gap before a sample of that time.
    pub(super) fn would_break(&self, t: f64) -> bool {
        self.t.last().is_some_and(|last| t - last > GAP.max(5.0 * self.step))
    }

    /// Takes a sample; after a gap all before it is forgotten.
    pub(super) fn push(&mut self, sample: &LiveSample) {
        if self.would_break(sample.t) {
            self.clear();
        }
        if self.t.is_empty() {
            self.origin = sample.t;
        }
        self.t.push(sample.t);
        for (to, from) in [(&mut self.q, &sample.q), (&mut self.torque, &sample.torque)] {
            to.iter_mut().zip(from).for_each(|(to, value)| to.push(*value));
        }
    }

    fn clear(&mut self) {
        self.t.clear();
        self.q.iter_mut().chain(&mut self.torque).for_each(Vec::clear);
    }

    /// Drops what is older than is kept.
    pub(super) fn trim(&mut self) {
        let old = self.t.partition_point(|t| *t < self.latest() - KEPT);
        // Not each time: the remaining samples are moved.
        if old as f64 * self.step > KEPT {
            self.t.drain(..old);
            self.q.iter_mut().chain(&mut self.torque).for_each(|x| drop(x.drain(..old)));
        }
    }

    /// The time of the last sample.
    pub(super) fn latest(&self) -> f64 {
        self.t.last().copied().unwrap_or(f64::NEG_INFINITY)
    }

    /// The time of the first one that is kept.
    pub(super) fn first(&self) -> f64 {
        self.t.first().copied().unwrap_or(f64::INFINITY)
    }

    /// Samples from about a time on, on the grid, as a log of that name.
    pub(super) fn log(&self, from: f64, file: &str) -> Option<Log> {
        let stride = self.decimation as f64 * self.step;
        let strides = ((from.max(self.first()) - self.origin) / stride).ceil();
        let start = self.origin + strides * stride;
        let count = ((self.latest() - start) / self.step + 1e-6).floor();
        if count.is_nan() || count < 2.0 {
            return None;
        }
        let count = count as usize + 1;
        let near = self.t.partition_point(|t| *t < start - 3.0 * self.step);
        let t = &self.t[near..];
        let smooth = |x: &Vec<f64>| resample::cubic(t, &x[near..], start, self.step, count);
        let linear = |x: &Vec<f64>| resample::linear(t, &x[near..], start, self.step, count);
        Some(Log {
            file: file.to_string(),
            t: (0..count).map(|k| start + k as f64 * self.step).collect(),
            q: self.q.iter().map(smooth).collect(),
            torque: self.torque.iter().map(linear).collect(),
            temperature: None,
            motor: None,
            pieces: std::iter::once(0..count).collect(),
            doubts: Vec::new(),
            clock: 0.0,
        })
    }
}
