//! The rows of each joint: which samples count, and where blocks and logs begin.

use super::Recording;
use crate::logs::signal::Band;
use std::ops::Range;
use std::sync::Arc;

/// A stretch of about [`super::DataOptions::block`] seconds of one recording: the unit that is taken as
/// independent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Which recording.
    pub recording: usize,
    /// Which log.
    pub log: usize,
    /// Rows of each joint that lie in it; empty where the joint rests.
    pub rows: Vec<Range<usize>>,
}

/// What the samples of one joint say.
#[derive(Clone, Debug)]
pub struct JointRows {
    /// Torque in the band, N·m.
    pub torque: Vec<f64>,
    /// Columns of the minimal set in the band, column-major: p × rows.
    pub inertial: Vec<Vec<f64>>,
    /// By recording: which of the band's kept samples are rows.
    pub kept: Vec<Vec<usize>>,
    /// By recording: its rows.
    pub rows: Vec<Range<usize>>,
    /// The band that its torque and columns have passed.
    pub band: Band,
}

impl JointRows {
    /// Rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.torque.len()
    }

    /// Whether the joint has no row: it never moves.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.torque.is_empty()
    }

    /// Its rows that follow each other without a gap.
    #[must_use]
    pub fn runs(&self) -> Vec<Range<usize>> {
        let mut runs = Vec::new();
        for (kept, range) in self.kept.iter().zip(&self.rows) {
            let mut first = 0;
            for k in 1..=kept.len() {
                if k == kept.len() || kept[k] != kept[k - 1] + 1 {
                    runs.push(range.start + first..range.start + k);
                    first = k;
                }
            }
        }
        runs
    }

    /// A signal at full rate, one vector a recording, as a column of this joint.
    #[must_use]
    pub fn column<'r>(
        &self,
        recordings: &'r [Recording],
        mut signal: impl FnMut(usize, &'r Recording) -> Vec<f64>,
    ) -> Vec<f64> {
        let pass = |(r, recording): (usize, &'r Recording)| match self.kept[r].is_empty() {
            true => Vec::new(),
            false => self.band.pass(&signal(r, recording)),
        };
        let passed: Vec<Vec<f64>> = recordings.iter().enumerate().map(pass).collect();
        self.passed_rows(&passed)
    }

    /// The rows of a signal that has passed the band already: by recording, one value for each kept sample of the band.
    #[must_use]
    pub fn passed_rows(&self, passed: &[Vec<f64>]) -> Vec<f64> {
        self.kept.iter().zip(passed).flat_map(|(kept, passed)| kept.iter().map(|k| passed[*k])).collect()
    }
}

/// A regression column: its values on the joints it acts on. Copies share the values.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// (joint, values by row), each joint at most once.
    pub parts: Vec<(usize, Arc<Vec<f64>>)>,
}

impl Column {
    /// A column that acts on one joint.
    #[must_use]
    pub fn on(joint: usize, values: impl Into<Arc<Vec<f64>>>) -> Column {
        Column { parts: vec![(joint, values.into())] }
    }

    /// The values on a joint, where the column acts on it.
    #[must_use]
    pub fn at(&self, joint: usize) -> Option<&[f64]> {
        self.parts.iter().find(|(j, _)| *j == joint).map(|(_, v)| v.as_slice())
    }

    /// Adds a share of it to signals by joint and row.
    pub fn add_to(&self, signals: &mut [Vec<f64>], share: f64) {
        for (joint, values) in &self.parts {
            signals[*joint].iter_mut().zip(values.iter()).for_each(|(s, v)| *s += share * v);
        }
    }

    /// Whether all values are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.parts.iter().all(|(_, v)| v.iter().all(|x| x.is_finite()))
    }
}
