//! Logs into factors: one log after another, a long one part by part, so memory does not grow.
//!
//! The module also makes the columns tanh(γ·q̇) for every γ at once, and reduces logs in several bands.

use super::{Octaves, Summary, SummaryError};
use crate::log::Log;
use crate::parallel;
use crate::regression::{Data, DataError, DataOptions, Recording, RigidArm, column_in_bands};
pub use crate::signal::BANDS;
use std::f64::consts::PI;

/// A log is worked on in parts of this length, s.
const PART: f64 = 120.0;
/// Overlap of neighbouring parts, s: twice the time that a band leaves out at an end.
const OVERLAP: f64 = 0.6;

/// The columns of a joint's rows in a reduced log: the minimal set, q̇, 1, tanh(γ·q̇) at the nodes of its
/// [`Steepness`], the torque. All in the band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    /// Parameters of the minimal set.
    pub inertial: usize,
}

impl Columns {
    /// Index of the viscous column.
    #[must_use]
    pub fn viscous(&self) -> usize {
        self.inertial
    }

    /// Index of the constant one.
    #[must_use]
    pub fn constant(&self) -> usize {
        self.inertial + 1
    }

    /// Index of a node's saturating column.
    #[must_use]
    pub fn node(&self, k: usize) -> usize {
        self.inertial + 2 + k
    }

    /// Index of the torque.
    #[must_use]
    pub fn torque(&self) -> usize {
        self.inertial + 2 + NODES
    }

    /// Columns in all.
    #[must_use]
    pub fn width(&self) -> usize {
        self.torque() + 1
    }

    /// The columns on a joint's rows in each band.
    fn of(&self, bands: &[Data<'_>], joint: usize, steepness: &Steepness) -> Vec<Vec<Vec<f64>>> {
        let column =
            |f: &dyn Fn(f64) -> f64| column_in_bands(bands, joint, |r| r.velocity(joint).map(f).collect());
        let rows = || bands.iter().map(|data| &data.joints[joint]);
        let mut columns: Vec<Vec<Vec<f64>>> = rows().map(|rows| rows.inertial.clone()).collect();
        let mut push = |values: Vec<Vec<f64>>| {
            columns.iter_mut().zip(values).for_each(|(columns, values)| columns.push(values));
        };
        push(column(&|v| v));
        push(rows().map(|rows| vec![1.0; rows.len()]).collect());
        steepness.nodes().iter().for_each(|g| push(column(&|v| (g * v).tanh())));
        push(rows().map(|rows| rows.torque.clone()).collect());
        columns
    }
}

impl Summary {
    /// Adds a log. Returns notes on the samples that were left out.
    ///
    /// # Errors
    /// [`DataError`] where nothing of the log can be used; nothing has been added then.
    pub fn push(
        &mut self,
        body: &RigidArm,
        log: &Log,
        options: &DataOptions,
    ) -> Result<Vec<String>, DataError> {
        self.push_corrected(body, log, options, |_| {})
    }

    /// Takes a log in whose signals are corrected on the even grid, part by part.
    ///
    /// # Errors
    /// Those of [`Summary::push`].
    pub fn push_corrected(
        &mut self,
        body: &RigidArm,
        log: &Log,
        options: &DataOptions,
        correct: impl FnMut(&mut Recording),
    ) -> Result<Vec<String>, DataError> {
        push_in_bands(std::slice::from_mut(self), body, log, options, correct)
    }

    /// Counts what is known of a log in the band in addition to its rows.
    fn count(&mut self, data: &Data<'_>) {
        self.samples += data.recordings.iter().map(|r| data.band.kept(r.len()).len() as u64).sum::<u64>();
        for (inactive, why) in self.inactive.iter_mut().zip(&data.inactive) {
            *inactive = why.clone().or(inactive.take());
        }
    }
}

/// Adds a log to the summaries of several bands. Each band is made of the one before; the first is that of
/// the options. Returns notes on the samples that were left out in the first band.
///
/// # Errors
/// [`DataError`] where nothing of the log can be used in the first band; nothing has been added then. A
/// log that is too short for a narrower band is missing from that band alone.
pub(super) fn push_in_bands(
    summaries: &mut [Summary],
    body: &RigidArm,
    log: &Log,
    options: &DataOptions,
    mut correct: impl FnMut(&mut Recording),
) -> Result<Vec<String>, DataError> {
    let (mut notes, mut refused) = (Vec::new(), None);
    // A log is reduced by itself and rounded once, so that it is the same in a file and together with others.
    let empty = |summary: &Summary| Summary::without_logs(summary.identity.clone());
    let mut reduced: Vec<Summary> = summaries.iter().map(empty).collect();
    // By band: the seconds that were taken in.
    let mut seconds: Vec<Option<f64>> = vec![None; summaries.len()];
    for part in parts(log) {
        let part = std::slice::from_ref(&part);
        let bands = Data::in_bands(body, part, options, reduced.len(), &mut correct);
        let mut bands: Vec<Result<Data<'_>, DataError>> = bands.unwrap_or_else(|error| vec![Err(error)]);
        // What is too little in a band is too little in narrower ones.
        let usable = bands.iter().take_while(|band| band.is_ok()).count();
        if let Some(Err(error)) = bands.drain(usable..).next().filter(|_| usable == 0) {
            refused = Some(error);
        }
        let bands: Vec<Data<'_>> = bands.into_iter().flatten().collect();
        let Some(widest) = bands.first() else { continue };
        notes.extend(widest.left_out.iter().cloned());
        let of_joint = |&j: &usize| -> Vec<Octaves> {
            let columns = reduced[0].columns().of(&bands, j, &reduced[0].identity.steepness[j]);
            let pushed = |((summary, data), columns): ((&Summary, &Data<'_>), Vec<Vec<f64>>)| {
                let mut octaves = summary.joints[j].clone();
                octaves.push_rows(&data.joints[j], &columns);
                octaves
            };
            reduced.iter().zip(&bands).zip(columns).map(pushed).collect()
        };
        let joints = parallel::map(&(0..widest.dof()).collect::<Vec<_>>(), of_joint);
        for (j, octaves) in joints.into_iter().enumerate() {
            reduced.iter_mut().zip(octaves).for_each(|(summary, octaves)| summary.joints[j] = octaves);
        }
        for ((summary, data), seconds) in reduced.iter_mut().zip(&bands).zip(&mut seconds) {
            summary.count(data);
            let own: f64 = data.recordings.iter().map(|r| r.len() as f64 / r.rate).sum();
            *seconds = Some(seconds.unwrap_or(0.0) + own);
        }
    }
    for ((summary, mut reduced), seconds) in summaries.iter_mut().zip(reduced).zip(&seconds) {
        reduced.logs.extend(seconds.map(|seconds| (log.file.clone(), seconds)));
        reduced.joints.iter_mut().for_each(Octaves::round);
        summary.join(&reduced);
    }
    match refused {
        Some(error) if seconds[0].is_none() => Err(error),
        _ => Ok(notes),
    }
}

/// A log in overlapping parts: they share the time that a band leaves out at their ends. Each piece of the
/// log gives equal parts of about two minutes.
#[must_use]
pub fn parts(log: &Log) -> Vec<Log> {
    let whole = |log: &Log| log.t.last().unwrap_or(&0.0) - log.t.first().unwrap_or(&0.0);
    if whole(log) < 1.5 * PART {
        return vec![log.clone()];
    }
    let mut parts = Vec::new();
    for piece in &log.pieces {
        let t = &log.t[piece.clone()];
        let (start, span) = (t[0], t[t.len() - 1] - t[0]);
        let count = ((span / PART).round() as usize).max(1);
        for k in 0..count {
            let at = |k: usize| start + span * k as f64 / count as f64;
            let from = t.partition_point(|x| *x < at(k) - if k > 0 { OVERLAP / 2.0 } else { 0.0 });
            let to = t.partition_point(|x| *x <= at(k + 1) + OVERLAP / 2.0);
            parts.push(part(log, piece.start + from..piece.start + to));
        }
    }
    parts
}

fn part(log: &Log, range: std::ops::Range<usize>) -> Log {
    let cut = |x: &Vec<Vec<f64>>| x.iter().map(|c| c[range.clone()].to_vec()).collect();
    Log {
        file: log.file.clone(),
        t: log.t[range.clone()].to_vec(),
        q: cut(&log.q),
        torque: cut(&log.torque),
        temperature: log.temperature.as_ref().map(cut),
        motor: log.motor.as_ref().map(cut),
        pieces: std::iter::once(0..range.len()).collect(),
        doubts: log.doubts.clone(),
        clock: log.clock,
    }
}

// Columns tanh(γ·q̇) for every γ at once.
//
// A reduced log cannot give the column of a steepness that is found later. As a function of ln γ the
// column is smooth (it is analytic in the strip |Im ln γ| < π/2), so its interpolant at Chebyshev's nodes
// comes near it as fast as a geometric series: with [`NODES`] nodes over [`Steepness::range`] no value is
// off by more than 4e-5 (a test finds it). The columns at the nodes therefore hold those of all steepnesses
// between, and their derivatives, as linear combinations.

/// Number of columns that represent all steepnesses.
pub const NODES: usize = 32;
/// The range of a joint whose velocity limit is v: nearly straight up to v, and a step for all that is
/// measurable.
const LOW: f64 = 0.5;
const HIGH: f64 = 2000.0;

/// The steepnesses of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steepness {
    low: f64,
    high: f64,
}

impl Steepness {
    /// For a joint of velocity limit `velocity`, rad/s or m/s.
    #[must_use]
    pub fn new(velocity: f64) -> Steepness {
        Steepness { low: LOW / velocity, high: HIGH / velocity }
    }

    /// Over a given range, s/rad.
    #[must_use]
    pub fn between(low: f64, high: f64) -> Steepness {
        Steepness { low, high }
    }

    /// Lowest and highest steepness, s/rad.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The steepnesses of the columns that are kept, s/rad.
    #[must_use]
    pub fn nodes(&self) -> [f64; NODES] {
        let (middle, half) = self.scale();
        std::array::from_fn(|k| (middle + half * node(k).cos()).exp())
    }

    /// Weights of the nodes' columns whose sum is the column of `gamma`.
    #[must_use]
    pub fn weights(&self, gamma: f64) -> [f64; NODES] {
        let angle = self.angle(gamma);
        // Lagrange's polynomials in Chebyshev's: ℓₖ = (1 + 2·Σ Tₘ(xₖ)·Tₘ(x))/N.
        std::array::from_fn(|k| {
            let sum: f64 = (1..NODES).map(|m| (m as f64 * node(k)).cos() * (m as f64 * angle).cos()).sum();
            (1.0 + 2.0 * sum) / NODES as f64
        })
    }

    /// Like [`Self::weights`], for the column's derivative by ln γ.
    #[must_use]
    pub fn slopes(&self, gamma: f64) -> [f64; NODES] {
        let (_, half) = self.scale();
        let angle = self.angle(gamma);
        // dTₘ/dx = m·sin(mφ)/sin φ at x = cos φ, m² at the upper end and ±m² at the lower one.
        let slope = |m: usize| {
            let m = m as f64;
            if angle.sin() < 1e-9 {
                m * m * if angle < 1.0 { 1.0 } else { -(m * PI).cos() }
            } else {
                m * (m * angle).sin() / angle.sin()
            }
        };
        std::array::from_fn(|k| {
            let sum: f64 = (1..NODES).map(|m| (m as f64 * node(k)).cos() * slope(m)).sum();
            2.0 * sum / (NODES as f64 * half)
        })
    }

    fn scale(&self) -> (f64, f64) {
        let (low, high) = (self.low.ln(), self.high.ln());
        (0.5 * (low + high), 0.5 * (high - low))
    }

    /// The angle φ with cos φ the place of ln γ in the range, which it does not leave.
    fn angle(&self, gamma: f64) -> f64 {
        let (middle, half) = self.scale();
        ((gamma.ln() - middle) / half).clamp(-1.0, 1.0).acos()
    }
}

fn node(k: usize) -> f64 {
    PI * (2 * k + 1) as f64 / (2 * NODES) as f64
}

#[cfg(test)]
mod steepness_tests {
    use super::*;

    #[test]
    fn columns_and_tangents_are_those_of_the_law() {
        let velocity = 1.3;
        let steepness = Steepness::new(velocity);
        let (low, high) = steepness.range();
        let (mut off, mut off_slope) = (0.0f64, 0.0f64);
        for i in 0..=300 {
            let gamma = (low * (high / low).powf(f64::from(i) / 300.0)).clamp(low, high);
            let (weights, slopes) = (steepness.weights(gamma), steepness.slopes(gamma));
            approx::assert_abs_diff_eq!(weights.iter().sum::<f64>(), 1.0, epsilon = 1e-9);
            for k in -40..=10 {
                let v = velocity * 1.4f64.powi(k);
                let at = |w: &[f64; NODES]| -> f64 {
                    steepness.nodes().iter().zip(w).map(|(g, w)| w * (g * v).tanh()).sum()
                };
                let t = (gamma * v).tanh();
                off = off.max((at(&weights) - t).abs());
                off_slope = off_slope.max((at(&slopes) - gamma * v * (1.0 - t * t)).abs());
            }
        }
        println!("off by {off:.1e}, tangents by {off_slope:.1e}");
        assert!(off < 4e-5 && off_slope < 4e-3, "{off:.1e} {off_slope:.1e}");
    }
}

// Logs reduced in several bands: in which of them they speak of a model is decided when there is one.

/// The power of a model's torque and of its residual, (N·m)², between neighbouring bands.
pub type Powers = [[f64; 2]; BANDS.len() - 1];

/// Logs of one arm, reduced in each of [`BANDS`].
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    bands: Vec<Summary>,
}

impl Bands {
    /// Empty summaries; the band of `options` is not used.
    #[must_use]
    pub fn new(body: &RigidArm, options: &DataOptions) -> Bands {
        Bands { bands: BANDS.iter().map(|band| Summary::new(body, &with(options, *band))).collect() }
    }

    /// The logs in each band, widest first.
    #[must_use]
    pub fn all(&self) -> &[Summary] {
        &self.bands
    }

    /// The logs with all joints in the widest band.
    #[must_use]
    pub fn widest(&self) -> &Summary {
        &self.bands[0]
    }

    /// The logs with a separate band for each joint.
    #[must_use]
    pub fn of_joints(&self, bands: &[usize]) -> Summary {
        let joint = |(j, band): (usize, &usize)| self.bands[*band].joints[j].clone();
        Summary {
            joints: bands.iter().enumerate().map(joint).collect(),
            joint_bands: bands.iter().map(|band| self.bands[*band].identity.cutoff).collect(),
            ..self.bands[0].clone()
        }
    }

    /// By joint and octave between neighbouring bands, from fast to slow: the power of a model's torque
    /// there, and of its residual. Summed over logs, each with its own model.
    #[must_use]
    pub fn spectrum(&self) -> &[Powers] {
        &self.bands[0].spectrum
    }

    /// Says it of the one log that is in.
    pub fn set_spectrum(&mut self, spectrum: &[Powers]) {
        self.bands[0].spectrum = spectrum.to_vec();
    }

    /// Adds a log. Returns notes on the samples that were left out.
    ///
    /// # Errors
    /// [`DataError`] where nothing of the log can be used; nothing has been added then. A log that is too
    /// short for a narrow band is missing from that band alone.
    pub fn push(
        &mut self,
        body: &RigidArm,
        log: &Log,
        options: &DataOptions,
    ) -> Result<Vec<String>, DataError> {
        push_in_bands(&mut self.bands, body, log, &with(options, BANDS[0]), |_| {})
    }

    /// The logs in the columns of another set of the same arm, as [`Summary::in_set`].
    #[must_use]
    pub fn in_set(&self, own: &RigidArm, general: &RigidArm) -> Option<Bands> {
        let bands = self.bands.iter().map(|summary| summary.in_set(own, general));
        Some(Bands { bands: bands.collect::<Option<_>>()? })
    }

    /// Takes in what other logs of the same arm gave.
    ///
    /// # Errors
    /// Those of [`Summary::merge`].
    pub fn merge(&mut self, other: &Bands) -> Result<(), SummaryError> {
        self.bands.iter_mut().zip(&other.bands).try_for_each(|(summary, other)| summary.merge(other))
    }

    /// The bytes of a file: one band after the other.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.bands.iter().flat_map(Summary::to_bytes).collect()
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`SummaryError::Unreadable`] if they are not a summary, of another version, or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Bands, SummaryError> {
        let (mut bands, mut rest) = (Vec::new(), bytes);
        while bands.len() < BANDS.len() {
            let (summary, after) = Summary::from_bytes(rest)?;
            bands.push(summary);
            rest = after;
        }
        let cutoffs = bands.iter().map(|summary| summary.identity.cutoff);
        if !rest.is_empty() || !cutoffs.eq(BANDS) {
            return Err(SummaryError::Unreadable("it is torn or damaged: summarize the log anew".into()));
        }
        Ok(Bands { bands })
    }
}

fn with(options: &DataOptions, cutoff: f64) -> DataOptions {
    DataOptions { cutoff, ..options.clone() }
}
