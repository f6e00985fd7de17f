//! The logs that are asked, and the rows of any reading of their positions.

use super::decimate::decimate;
use super::reading::Positions;
use super::rows::{Gravity, Rows};
use crate::logs::log::Log;
use crate::logs::regression::{DataError, RigidArm};

/// How much of the logs is looked at: seconds, and samples a second.
#[derive(Clone, Copy, Debug)]
struct Size {
    seconds: f64,
    rate: f64,
}

/// For what is asked of the torques: one set of rows for all questions.
const WHOLE: Size = Size { seconds: 240.0, rate: 50.0 };
/// For what is asked of the positions: other rows for each question.
const FEW: Size = Size { seconds: 60.0, rate: 25.0 };
/// For what is asked of the arm file: other columns for each question, and small differences.
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

/// What is asked.
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
    /// Where too little remains.
    pub(super) fn rows(&self, read: &Positions, gravity: Gravity) -> Result<Rows<'a>, DataError> {
        self.whole.rows(self.body, read, gravity)
    }

    /// Few rows, for comparing readings of the positions.
    ///
    /// # Errors
    /// Where too little remains.
    pub(super) fn few(&self, read: &Positions, gravity: Gravity) -> Result<Rows<'a>, DataError> {
        self.few.rows(self.body, read, gravity)
    }

    /// As many seconds as [`Asked::rows`] at a lower rate, for comparing arms.
    ///
    /// # Errors
    /// Where too little remains.
    pub(super) fn slow(&self, read: &Positions, gravity: Gravity) -> Result<Rows<'a>, DataError> {
        self.slow.rows(self.body, read, gravity)
    }
}
