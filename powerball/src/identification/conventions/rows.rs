//! The rows of a regression for one reading of the positions; every reading of the torques is judged on them.
//!
//! The columns are those of the minimal set and a textbook friction: Coulomb, viscous, constant. They fall
//! into two parts, each of which is fitted and judged by the other.

use super::reading::Torques;
use crate::logs::log::Log;
use crate::logs::regression::{Data, DataError, DataOptions, Recording, RigidArm};
use faer::Mat;

/// Friction columns of a joint: tanh(q̇/v₀), q̇, 1.
pub(super) const FRICTION: usize = 3;
/// v₀ of the Coulomb column, as a share of the joint's fast velocity.
const STEP: f64 = 0.02;
/// The band, Hz: below it arms are rigid, and encoder noise that is differentiated twice is small.
const BAND: f64 = 4.0;
/// A joint with fewer rows in a part is not judged.
const FEWEST: usize = 20;
/// The longest shift that can be asked for, s: rows keep this distance from the ends of a recording.
pub(super) const LONGEST: f64 = 0.2;

/// What the torques are held to contain of gravity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Gravity {
    Included,
    TakenOut,
}

/// One joint's rows in one part.
#[derive(Debug)]
pub(super) struct Part {
    /// (recording, sample of its grid) by row.
    pub(super) at: Vec<(usize, usize)>,
    /// By column of the joint.
    pub(super) columns: Vec<Vec<f64>>,
    /// The products of the columns.
    pub(super) gram: Mat<f64>,
}

/// The rows of all joints.
#[derive(Debug)]
pub(super) struct Rows<'a> {
    pub(super) data: Data<'a>,
    /// By log: the part that it belongs to; without one its halves are the parts.
    part: Vec<Option<usize>>,
    /// By joint: where its columns stand among all coefficients.
    pub(super) places: Vec<Vec<usize>>,
    /// By joint and part.
    pub(super) joints: Vec<[Part; 2]>,
    /// By recording and torque column, in the band at the rate of the grid.
    torque: Vec<Vec<Vec<f64>>>,
}

impl<'a> Rows<'a> {
    /// The rows of thin logs; the part of each log is `part`'s, or its first half is part 0 and its second
    /// half part 1.
    ///
    /// # Errors
    /// As [`Data::new`].
    pub(super) fn new(
        body: &'a RigidArm,
        logs: &[Log],
        part: &[Option<usize>],
        gravity: Gravity,
    ) -> Result<Rows<'a>, DataError> {
        let options = DataOptions { cutoff: BAND, block: 1.0, ..DataOptions::default() };
        let mut data = Data::new(body, logs, &options)?;
        if gravity == Gravity::TakenOut {
            take_gravity_out(&mut data);
        }
        Ok(Rows::of(data, part))
    }

    /// The same rows with the columns of another arm: `count` parameters, and what they are along a recording,
    /// samples × n × parameters.
    pub(super) fn of_columns(&self, count: usize, columns: impl Fn(&Recording) -> Vec<f64>) -> Rows<'a> {
        Rows::of(self.data.of_other_columns(count, columns), &self.part)
    }

    fn of(data: Data<'a>, part: &[Option<usize>]) -> Rows<'a> {
        let of_recording =
            |r: &Recording| (0..r.dof).map(|j| data.band.filtered(&r.smooth_torque(j))).collect();
        let torque = data.recordings.iter().map(of_recording).collect();
        let (mut places, mut joints) = (Vec::new(), Vec::new());
        for joint in 0..data.dof() {
            let (of_joint, parts) = joint_rows(&data, joint, part);
            places.push(of_joint);
            joints.push(parts);
        }
        Rows { data, part: part.to_vec(), places, joints, torque }
    }

    pub(super) fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Inertial parameters.
    pub(super) fn inertial(&self) -> usize {
        self.data.joints[0].inertial.len()
    }

    /// All coefficients: the minimal set, then the friction of each joint.
    pub(super) fn size(&self) -> usize {
        self.inertial() + FRICTION * self.dof()
    }

    /// Whether a joint has enough rows to be judged.
    pub(super) fn moves(&self, joint: usize) -> bool {
        self.joints[joint].iter().all(|part| part.at.len() >= FEWEST)
    }

    /// The torque of a joint in a part, as it is read.
    pub(super) fn torque(&self, read: &Torques, joint: usize, part: usize) -> Vec<f64> {
        let (column, gain) = (read.column[joint], read.gain[joint]);
        let shift = (read.late[joint] * self.data.rate()).clamp(-1e4, 1e4);
        let of_row = |(recording, sample): &(usize, usize)| {
            gain * between(&self.torque[*recording][column], *sample as f64 + shift)
        };
        self.joints[joint][part].at.iter().map(of_row).collect()
    }
}

/// The value of a signal between its samples, by a cubic through the four nearest.
fn between(x: &[f64], at: f64) -> f64 {
    let first = (at.floor() as isize - 1).clamp(0, x.len().saturating_sub(4) as isize) as usize;
    let Some(&[a, b, c, d]) = x.get(first..first + 4) else { return x.first().copied().unwrap_or(0.0) };
    let s = at - first as f64 - 1.0;
    let (before, after) = (s * (s - 1.0) / 6.0, (s + 1.0) * (s - 2.0) / 2.0);
    -before * (s - 2.0) * a + after * (s - 1.0) * b - after * s * c + before * (s + 1.0) * d
}

/// The columns of the same parameters without what gravity does.
fn take_gravity_out(data: &mut Data<'_>) {
    let (n, p) = (data.dof(), data.body.names().len());
    let of_gravity = |r: &Recording| {
        let still = vec![0.0; r.q.len()];
        data.body.regressor(&r.q, &still, &still)
    };
    let all: Vec<Vec<f64>> = data.recordings.iter().map(of_gravity).collect();
    for joint in 0..n {
        for c in 0..p {
            let gravity = data.joints[joint].column(&data.recordings, |r, _| {
                all[r].iter().skip(joint * p + c).step_by(n * p).copied().collect()
            });
            data.joints[joint].inertial[c].iter_mut().zip(gravity).for_each(|(x, g)| *x -= g);
        }
    }
}

fn joint_rows(data: &Data<'_>, joint: usize, part: &[Option<usize>]) -> (Vec<usize>, [Part; 2]) {
    let (rows, p) = (&data.joints[joint], data.joints[joint].inertial.len());
    let step = STEP * data.top_velocity(joint);
    let friction =
        |f: &dyn Fn(f64) -> f64| rows.column(&data.recordings, |_, r| r.velocity(joint).map(f).collect());
    let is_there = |c: &usize| rows.inertial[*c].iter().any(|x| *x != 0.0);
    let used: Vec<usize> = (0..p).filter(is_there).collect();
    let own = [friction(&|v| (v / step).tanh()), friction(&|v| v), friction(&|_| 1.0)];
    let columns: Vec<&[f64]> =
        used.iter().map(|c| rows.inertial[*c].as_slice()).chain(own.iter().map(Vec::as_slice)).collect();
    let places = used.iter().copied().chain((0..FRICTION).map(|k| p + FRICTION * joint + k)).collect();
    let empty = || Part { at: Vec::new(), columns: vec![Vec::new(); columns.len()], gram: Mat::zeros(0, 0) };
    let mut parts = [empty(), empty()];
    let margin = (LONGEST * data.rate()).ceil() as usize;
    for (r, recording) in data.recordings.iter().enumerate() {
        let (kept, length) = (data.band.kept(recording.len()), recording.len());
        for (row, k) in rows.rows[r].clone().zip(&rows.kept[r]) {
            let sample = kept[*k];
            if sample < margin || sample + margin + 2 > length {
                continue;
            }
            let to = part[recording.log].unwrap_or(usize::from(2 * sample > length));
            parts[to].at.push((r, sample));
            parts[to].columns.iter_mut().zip(&columns).for_each(|(x, from)| x.push(from[row]));
        }
    }
    for part in &mut parts {
        part.gram = products(&part.columns);
    }
    (places, parts)
}

fn products(columns: &[Vec<f64>]) -> Mat<f64> {
    let mut gram = Mat::zeros(columns.len(), columns.len());
    for (i, a) in columns.iter().enumerate() {
        for (k, b) in columns.iter().enumerate().take(i + 1) {
            let value: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
            gram[(i, k)] = value;
            gram[(k, i)] = value;
        }
    }
    gram
}
