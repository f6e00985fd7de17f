//! Logs into factors: one log after another, a long one part by part, so memory does not grow.

use super::{Octaves, Steepness, Summary, steepness};
use crate::log::Log;
use crate::parallel;
use crate::regression::{Data, DataError, DataOptions, Recording, RigidBody};

/// A log is worked on in parts of this length, s.
const PART: f64 = 120.0;
/// What neighbouring parts share, s: twice what a band leaves out at an end.
const OVERLAP: f64 = 0.6;

/// The columns of a joint's rows in a reduced log: the minimal set, q̇, 1, tanh(γ·q̇) at the nodes of its [`Steepness`], the
/// torque. All in the band.
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

    /// The columns on a joint's rows.
    fn of(&self, data: &Data<'_>, joint: usize, steepness: &Steepness) -> Vec<Vec<f64>> {
        let rows = &data.joints[joint];
        let column = |f: &dyn Fn(f64) -> f64| {
            rows.column(&data.band, &data.recordings, |_, r| r.speed(joint).map(f).collect())
        };
        let mut columns = rows.inertial.clone();
        columns.push(column(&|v| v));
        columns.push(vec![1.0; rows.len()]);
        columns.extend(steepness.nodes().iter().map(|g| column(&|v| (g * v).tanh())));
        columns.push(rows.torque.clone());
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
        body: &RigidBody,
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
        body: &RigidBody,
        log: &Log,
        options: &DataOptions,
        mut correct: impl FnMut(&mut Recording),
    ) -> Result<Vec<String>, DataError> {
        let (mut notes, mut seconds, mut refused) = (Vec::new(), 0.0, None);
        let mut joints = std::mem::take(&mut self.joints);
        let mut taken = false;
        for part in parts(log) {
            match Data::corrected(body, std::slice::from_ref(&part), options, &mut correct) {
                Ok(data) => {
                    joints = parallel::map(&(0..data.dof()).collect::<Vec<_>>(), |&j| {
                        let mut octaves = joints[j].clone();
                        self.push_joint(&mut octaves, &data, j);
                        octaves
                    });
                    seconds += data.recordings.iter().map(|r| r.len() as f64 / r.rate).sum::<f64>();
                    self.samples +=
                        data.recordings.iter().map(|r| data.band.kept(r.len()).len() as u64).sum::<u64>();
                    for (silent, why) in self.silent.iter_mut().zip(data.silent) {
                        *silent = why.or(silent.take());
                    }
                    notes.extend(data.left_out);
                    taken = true;
                }
                Err(error) => refused = Some(error),
            }
        }
        self.joints = joints;
        match refused {
            Some(error) if !taken => Err(error),
            _ => {
                self.logs.push((log.file.clone(), seconds));
                Ok(notes)
            }
        }
    }

    fn push_joint(&self, octaves: &mut Octaves, data: &Data<'_>, joint: usize) {
        let rows = &data.joints[joint];
        if rows.is_empty() {
            return;
        }
        let columns = self.columns().of(data, joint, &self.identity.steepness[joint]);
        octaves.push_rows(rows, &columns);
    }
}

/// A log in parts that share what a band leaves out at their ends: each piece of it in equal ones of about [`PART`].
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
        pieces: std::iter::once(0..range.len()).collect(),
        clock: log.clock,
    }
}
