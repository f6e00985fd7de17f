//! Logs into factors: one log after another, a long one part by part, so memory does not grow.

use super::{Octaves, Steepness, Summary, steepness};
use crate::logs::log::Log;
use crate::logs::parallel;
use crate::logs::regression::{Data, DataError, DataOptions, Recording, RigidArm, column_in_bands};

/// A log is worked on in parts of this length, s.
const PART: f64 = 120.0;
/// What neighbouring parts share, s: twice what a band leaves out at an end.
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
        self.inertial + 2 + steepness::NODES
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
    /// Takes a log in. Returns what was left out of it, in words.
    ///
    /// # Errors
    /// [`DataError`] where nothing of the log can be used; nothing has been taken in then.
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
    /// As [`Summary::push`].
    pub fn push_corrected(
        &mut self,
        body: &RigidArm,
        log: &Log,
        options: &DataOptions,
        correct: impl FnMut(&mut Recording),
    ) -> Result<Vec<String>, DataError> {
        push_in_bands(std::slice::from_mut(self), body, log, options, correct)
    }

    /// Counts what is known of a log in the band beside its rows.
    fn count(&mut self, data: &Data<'_>) {
        self.samples += data.recordings.iter().map(|r| data.band.kept(r.len()).len() as u64).sum::<u64>();
        for (inactive, why) in self.inactive.iter_mut().zip(&data.inactive) {
            *inactive = why.clone().or(inactive.take());
        }
    }
}

/// Takes a log into summaries of bands, each made of the one before, the first that of the
/// options. Returns what was left out of it in the first, in words.
///
/// # Errors
/// [`DataError`] where nothing of the log can be used in the first band; nothing has been taken in then. A
/// log that is too short for a narrower band is missing from that band alone.
pub(super) fn push_in_bands(
    summaries: &mut [Summary],
    body: &RigidArm,
    log: &Log,
    options: &DataOptions,
    mut correct: impl FnMut(&mut Recording),
) -> Result<Vec<String>, DataError> {
    let (mut notes, mut refused) = (Vec::new(), None);
    // A log is reduced by itself and rounded once, so that it is the same in a file and beside others.
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

/// A log in parts that share what a band leaves out at their ends: each piece of it in equal ones of about
/// [`PART`].
pub(crate) fn parts(log: &Log) -> Vec<Log> {
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
        clock: log.clock,
    }
}
