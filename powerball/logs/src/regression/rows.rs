//! The rows of each joint: which samples count, and where blocks and logs begin.
//!
//! The module also finds stretches in which a joint's torque is saturated, and makes the rows for a separate
//! fit of each joint, for logs that repeat one path.

use super::Recording;
use super::prepare::Data;
use crate::log::Log;
use crate::parallel;
use crate::signal::Band;
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

/// The rows of one joint.
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

    /// The joint's rows that follow each other without a gap.
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

    /// The rows of a signal that has passed the band already: by recording, one value for each kept sample of
    /// the band.
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

// Stretches in which a joint's torque stays at its limit: such samples show the limit of the drive or the
// sensor, not the arm.

/// A torque that stays at the largest or the least value of all logs for this long was cut there, s: measured
/// torque that moves by its noise and its resolution does not stay.
const LEAST: f64 = 0.2;
/// … in this many samples in a row.
const SAMPLES: usize = 10;

/// When a joint's torque is at its limit, by log: spans of the log's own t, s.
pub(super) fn saturated(logs: &[Log], joint: usize) -> Vec<Vec<[f64; 2]>> {
    let values = || logs.iter().flat_map(|log| log.torque[joint].iter().copied()).filter(|v| v.is_finite());
    let (top, bottom) = (values().fold(f64::NEG_INFINITY, f64::max), values().fold(f64::INFINITY, f64::min));
    // A joint whose torque never changes is another matter.
    if top <= bottom {
        return vec![Vec::new(); logs.len()];
    }
    let of = |log: &Log| {
        let torque = &log.torque[joint];
        let mut spans = Vec::new();
        for piece in &log.pieces {
            let runs = torque[piece.clone()].chunk_by(|a, b| a == b);
            let mut start = piece.start;
            for run in runs {
                let end = start + run.len();
                let at_limit = run[0] == top || run[0] == bottom;
                if at_limit && run.len() >= SAMPLES && log.t[end - 1] - log.t[start] >= LEAST {
                    spans.push([log.t[start], log.t[end - 1]]);
                }
                start = end;
            }
        }
        spans
    };
    logs.iter().map(of).collect()
}

/// The note about a joint's saturated spans, one sentence per log.
pub(super) fn saturation_notes(logs: &[Log], joint: usize, spans: &[Vec<[f64; 2]>]) -> Vec<String> {
    let note = |(log, spans): (&Log, &Vec<[f64; 2]>)| {
        let seconds: f64 = spans.iter().map(|[from, to]| to - from).sum();
        format!(
            "{}: the torque of joint {} stays at the largest or least value of all logs for {seconds:.1} s \
                in total: it was at its limit; these samples of the joint were left out",
            log.file,
            joint + 1
        )
    };
    logs.iter().zip(spans).filter(|(_, spans)| !spans.is_empty()).map(note).collect()
}

// A fit of each joint by itself, for logs that repeat one path.
//
// One path, however often it is run, determines few parameters of a rigid body, and any other effect that
// depends on positions is one more function of that path. If the rigid body does not fit, its residual is
// large and smooth on every joint, and it hides everything that changes from one repeat to the next, or
// within a motor's turn. Then each joint is given inertial parameters of its own, an offset, and a slope with
// its position: all that the path alone can explain counts as explained, and only the rest is examined.

impl Data<'_> {
    /// Logs with columns of its own for every joint: the minimal set, an offset and its position.
    #[must_use]
    pub fn per_joint_fit(mut self) -> Self {
        let joints: Vec<usize> = (0..self.dof()).collect();
        let added = parallel::map(&joints, |&j| {
            let column = |signal: &dyn Fn(usize) -> Vec<f64>| {
                self.joints[j].column(&self.recordings, |r, _| signal(r))
            };
            let offset = column(&|r| vec![1.0; self.recordings[r].len()]);
            let slope = column(&|r| self.recordings[r].position(j).collect());
            [offset, slope]
        });
        for (joint, columns) in self.joints.iter_mut().zip(added) {
            joint.inertial.extend(columns);
        }
        self.per_joint = true;
        self
    }

    /// Logs with the columns of one minimal set for all joints.
    #[must_use]
    pub fn joint_fit(&self) -> Self {
        let mut joints = self.joints.clone();
        joints.iter_mut().for_each(|joint| joint.inertial.truncate(self.body.names().len()));
        self.with(Arc::clone(&self.recordings), joints)
    }

    /// Inertial columns of a joint: the minimal set; where each joint has its own fit, also the columns added
    /// to it.
    #[must_use]
    pub fn inertial_columns(&self) -> usize {
        self.joints.iter().map(|joint| joint.inertial.len()).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod saturated_tests {
    use super::*;
    use crate::log::Arrays;
    use crate::regression::{Data, DataOptions, RigidArm};
    use std::f64::consts::TAU;

    /// 20 s of one joint at 100 Hz: a torque of 10 N·m at most, cut at `limit`.
    fn log(limit: f64) -> Log {
        let t: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let wave = |size: f64| -> Vec<f64> { t.iter().map(|t| size * (TAU * 0.2 * t).sin()).collect() };
        let torque = wave(10.0).into_iter().map(|v| v.clamp(-limit, limit)).collect();
        let dof = Arrays { t: &t, q: &[wave(0.5)], torque: &[torque], ..Arrays::default() };
        Log::from_arrays("log", &arm(), &dof).unwrap().0
    }

    fn arm() -> dyngen::Arm {
        let text = "name = \"one\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\nkind = \
                    \"revolute\"\na = 0.5\nalpha = 0.0\nd = 0.0\ntheta = 0.0\n";
        dyngen::Arm::parse(text, "one.toml").unwrap()
    }

    #[test]
    fn a_torque_at_its_limit_is_left_out_and_said() {
        let (arm, whole, cut) = (arm(), log(11.0), log(8.0));
        let body = RigidArm::new(&arm).unwrap();
        // 0.2 Hz: above 0.8 of its peak for (π − 2 asin 0.8)/τ of each half turn, 1.02 s, eight times.
        let spans = saturated(std::slice::from_ref(&cut), 0);
        assert_eq!(spans[0].len(), 8);
        for [from, to] in &spans[0] {
            approx::assert_relative_eq!(to - from, 1.02, epsilon = 0.03);
        }
        assert!(saturated(std::slice::from_ref(&whole), 0)[0].is_empty());
        let data = |log: &Log| Data::new(&body, std::slice::from_ref(log), &DataOptions::default()).unwrap();
        let (whole, cut) = (data(&whole), data(&cut));
        assert!(cut.joints[0].len() < whole.joints[0].len() * 2 / 3);
        assert!(cut.joints[0].torque.iter().all(|t| t.abs() < 8.0));
        assert!(cut.notes.iter().any(|n| n.contains("joint 1") && n.contains("8.2 s")), "{:?}", cut.notes);
        assert!(whole.notes.iter().all(|n| !n.contains("limit")));
    }
}
