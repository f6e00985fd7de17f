//! The logs whose columns are checked, and the rows of any reading of their positions.
//!
//! The module also reduces logs, and defines a reading of the columns of a log and a factor by joint.

use super::arm_file::FACTOR;
use super::fit::{Gravity, Rows, factors_of_body};
use dyngen::Arm;
use dyngen::arm::JointKind;
use powerball_logs::log::Log;
use powerball_logs::regression::{DataError, RigidArm};
use powerball_logs::signal::Butterworth;
use powerball_logs::signal::resample::{cubic, linear, median_step};
use std::ops::Range;

/// The part of the logs that is used: seconds, and samples per second.
#[derive(Clone, Copy, Debug)]
struct Size {
    seconds: f64,
    rate: f64,
}

/// For questions about the torques: one set of rows for all questions.
const WHOLE: Size = Size { seconds: 240.0, rate: 50.0 };
/// For questions about the positions: other rows for each question.
const FEW: Size = Size { seconds: 60.0, rate: 25.0 };
/// For questions about the arm file: other columns for each question, and small differences.
const SLOW: Size = Size { seconds: 240.0, rate: 25.0 };

/// Logs with the part that each belongs to; without one its halves are the parts.
#[derive(Debug)]
struct Thinned {
    logs: Vec<Log>,
    parts: Vec<Option<usize>>,
}

impl Thinned {
    fn new(logs: &[Log], validate: &[Log], size: Size) -> Thinned {
        let half = Size { seconds: 0.5 * size.seconds, ..size };
        let other = decimate(validate, half.seconds, size.rate);
        let whole = if other.is_empty() { size } else { half };
        let mut all = decimate(logs, whole.seconds, size.rate);
        let mut parts = vec![(!other.is_empty()).then_some(0); all.len()];
        parts.extend(vec![Some(1); other.len()]);
        all.extend(other);
        Thinned { logs: all, parts }
    }

    fn rows<'a>(
        &self,
        body: &'a RigidArm,
        read: &Positions,
        gravity: Gravity,
    ) -> Result<Rows<'a>, DataError> {
        if read.is_plain() {
            return Rows::new(body, &self.logs, &self.parts, gravity);
        }
        let otherwise = |log: &Log| {
            let of_joint = |joint: usize| {
                let factor = read.factor(body.arm(), joint);
                log.q[read.column[joint]].iter().map(|q| factor * q).collect()
            };
            Log { q: (0..body.dof()).map(of_joint).collect(), ..log.clone() }
        };
        let logs: Vec<Log> = self.logs.iter().map(otherwise).collect();
        Rows::new(body, &logs, &self.parts, gravity)
    }
}

/// The logs whose columns are checked.
#[derive(Debug)]
pub(super) struct Asked<'a> {
    pub(super) body: &'a RigidArm,
    whole: Thinned,
    few: Thinned,
    slow: Thinned,
}

impl<'a> Asked<'a> {
    pub(super) fn new(body: &'a RigidArm, logs: &[Log], validate: &[Log]) -> Asked<'a> {
        let of = |size: Size| Thinned::new(logs, validate, size);
        Asked { body, whole: of(WHOLE), few: of(FEW), slow: of(SLOW) }
    }

    /// The rows of a reading of the positions.
    ///
    /// # Errors
    /// If too little remains.
    pub(super) fn rows(&self, read: &Positions, gravity: Gravity) -> Result<Rows<'a>, DataError> {
        self.whole.rows(self.body, read, gravity)
    }

    /// Few rows, for comparing readings of the positions.
    ///
    /// # Errors
    /// If too little remains.
    pub(super) fn few(&self, read: &Positions, gravity: Gravity) -> Result<Rows<'a>, DataError> {
        self.few.rows(self.body, read, gravity)
    }

    /// Rows over as many seconds as [`Asked::rows`] at a lower rate, for comparing arms.
    ///
    /// # Errors
    /// If too little remains.
    pub(super) fn slow(&self, read: &Positions, gravity: Gravity) -> Result<Rows<'a>, DataError> {
        self.slow.rows(self.body, read, gravity)
    }
}

// Reduced logs: a few samples per second and a few minutes show the meaning of a column.

/// Signals slower than this share of the rate are kept.
const KEPT: f64 = 0.25;
/// Shorter stretches say nothing, s.
const SHORTEST: f64 = 1.0;
/// Stretches of this length are taken from long logs, s.
const STRETCH: f64 = 10.0;

/// The logs on even grids of about `rate` samples a second, at most `most` seconds of them in all, evenly
/// chosen; one piece a log. Every signal passes the same filter.
pub(super) fn decimate(logs: &[Log], most: f64, rate: f64) -> Vec<Log> {
    let length = |log: &Log, piece: &Range<usize>| log.t[piece.end - 1] - log.t[piece.start];
    let whole: f64 = logs.iter().flat_map(|log| log.pieces.iter().map(move |piece| length(log, piece))).sum();
    let mut out = Vec::new();
    // One stretch in `every` is taken.
    let every = (whole / most).ceil().max(1.0) as usize;
    let mut count = 0;
    for log in logs {
        for piece in log.pieces.iter().filter(|piece| length(log, piece) >= SHORTEST) {
            if every == 1 {
                out.extend(of_stretch(log, piece.clone(), rate));
                continue;
            }
            for stretch in stretches(log, piece) {
                if count % every == 0 {
                    out.extend(of_stretch(log, stretch, rate));
                }
                count += 1;
            }
        }
    }
    out
}

/// A piece in stretches of about [`STRETCH`] seconds.
fn stretches(log: &Log, piece: &Range<usize>) -> Vec<Range<usize>> {
    let (first, last) = (log.t[piece.start], log.t[piece.end - 1]);
    let count = ((last - first) / STRETCH).floor().max(1.0) as usize;
    let at = |k: usize| {
        let time = first + (last - first) * k as f64 / count as f64;
        if k == count { piece.end } else { piece.start + log.t[piece.clone()].partition_point(|t| *t < time) }
    };
    (0..count).map(|k| at(k)..at(k + 1)).collect()
}

fn of_stretch(log: &Log, piece: Range<usize>, wanted: f64) -> Option<Log> {
    let t = &log.t[piece.clone()];
    let step = median_step(t)?;
    let (start, rate) = (t[0], 1.0 / step);
    let count = ((t[t.len() - 1] - start) / step).floor() as usize + 1;
    // A clock that is a little slow does not count.
    let every = ((1.05 * rate / wanted).floor() as usize).max(1);
    let filter = if every > 1 { Butterworth::low_pass(4, KEPT * wanted, rate) } else { None };
    let small = |x: Vec<f64>| -> Vec<f64> {
        // A sensor that is dead must not come alive by the filter's rounding.
        let is_dead = x.windows(2).all(|pair| pair[0] == pair[1]);
        let filter = filter.as_ref().filter(|_| !is_dead);
        let x = filter.map_or_else(|| x.clone(), |f| f.zero_phase(&x));
        x.into_iter().step_by(every).collect()
    };
    let samples = count.div_ceil(every);
    Some(Log {
        motor: None,
        file: log.file.clone(),
        t: (0..samples).map(|k| start + (k * every) as f64 * step).collect(),
        q: log.q.iter().map(|q| small(cubic(t, &q[piece.clone()], start, step, count))).collect(),
        torque: log.torque.iter().map(|x| small(linear(t, &x[piece.clone()], start, step, count))).collect(),
        temperature: None,
        pieces: std::iter::once(0..samples).collect(),
        doubts: log.doubts.clone(),
        clock: log.clock,
    })
}

// A way to read the columns of a log.

/// A reading of the position columns: joint k's position is `sign[k]`·`scale` times column
/// `column[k]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Positions {
    pub(super) column: Vec<usize>,
    pub(super) sign: Vec<f64>,
    /// rad for one unit of the columns of revolute joints.
    pub(super) scale: f64,
}

impl Positions {
    pub(super) fn plain(dof: usize) -> Positions {
        Positions { column: (0..dof).collect(), sign: vec![1.0; dof], scale: 1.0 }
    }

    pub(super) fn is_plain(&self) -> bool {
        *self == Positions::plain(self.column.len())
    }

    /// The factor of a joint's column.
    pub(super) fn factor(&self, arm: &Arm, joint: usize) -> f64 {
        let turns = arm.joints[joint].kind == JointKind::Revolute;
        self.sign[joint] * if turns { self.scale } else { 1.0 }
    }

    /// The column of joint `joint` the other way round.
    pub(super) fn reversed(&self, joint: usize) -> Positions {
        let mut other = self.clone();
        other.sign[joint] = -other.sign[joint];
        other
    }

    /// The columns of two joints exchanged.
    pub(super) fn exchanged(&self, a: usize, b: usize) -> Positions {
        let mut other = self.clone();
        other.column.swap(a, b);
        other.sign.swap(a, b);
        other
    }
}

/// A reading of the torque columns: joint k's torque at time t is `gain[k]` times column `column[k]`
/// at t + `late[k]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Torques {
    pub(super) column: Vec<usize>,
    /// Factor with its sign.
    pub(super) gain: Vec<f64>,
    /// How late the column is, s.
    pub(super) late: Vec<f64>,
}

impl Torques {
    pub(super) fn plain(dof: usize) -> Torques {
        Torques { column: (0..dof).collect(), gain: vec![1.0; dof], late: vec![0.0; dof] }
    }

    /// The column of joint `joint` the other way round.
    pub(super) fn reversed(&self, joint: usize) -> Torques {
        let mut other = self.clone();
        other.gain[joint] = -other.gain[joint];
        other
    }

    /// The columns of two joints exchanged, with their signs.
    pub(super) fn exchanged(&self, a: usize, b: usize) -> Torques {
        let mut other = self.clone();
        other.column.swap(a, b);
        other.gain.swap(a, b);
        other.late.swap(a, b);
        other
    }

    /// Whether some column is multiplied by more than a sign.
    pub(super) fn is_scaled(&self) -> bool {
        self.gain.iter().any(|gain| gain.abs() != 1.0)
    }

    /// All columns later by `by` seconds than taken so far.
    pub(super) fn later(&self, by: f64) -> Torques {
        let late = self.late.iter().map(|late| late + by).collect();
        Torques { late, ..self.clone() }
    }
}

// A factor by joint: each torque column must be multiplied by it to fit one body with the others.
//
// The rigid arm is shared by all joints, so a factor on one of them shows. A common factor does not: the
// median joint keeps its own. A joint that shares nothing with others keeps its own too.

/// The factors of all joints that fit a part best, relative to those of `read`, if some are not one.
pub(super) fn factors(rows: &Rows<'_>, read: &Torques, part: usize, ridge: f64) -> Option<Vec<f64>> {
    relative(factors_of_body(rows, read, part, ridge).iter().map(|kappa| 1.0 / kappa).collect())
}

/// Numbers of the arm file by joint as factors; `None` where some are missing or all are alike.
pub(super) fn filed(numbers: impl Iterator<Item = Option<f64>>) -> Option<Vec<f64>> {
    let numbers = numbers.map(|x| x.map(f64::abs)).collect::<Option<Vec<f64>>>()?;
    relative(numbers)
}

/// The factors over their median, if some of them are then not one.
fn relative(numbers: Vec<f64>) -> Option<Vec<f64>> {
    let middle = median(numbers.clone());
    let factors: Vec<f64> = numbers.iter().map(|x| x / middle).collect();
    let sound = factors.iter().all(|f| f.is_finite() && *f > 0.0);
    (sound && factors.iter().any(|f| f.ln().abs() > FACTOR.ln())).then_some(factors)
}

pub(super) fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x.get(x.len() / 2).copied().unwrap_or(1.0)
}
