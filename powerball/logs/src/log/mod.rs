//! Logs of joint positions and torques: read, checked, and every doubt about them said.
//!
//! Files ([`Log::read`]: CSV, Parquet, LeRobot, MCAP, bags of ROS, npz, mat, HDF5), arrays
//! ([`Log::from_arrays`]) and samples ([`Log::from_samples`]) come to columns by name, and these pass the
//! same checks. A [`ColumnMap`] says what names do not.

mod arrays;
mod check;
mod columns;
mod file;
mod headers;
mod inspect;
mod live;
mod map;
mod motors;
mod outliers;
mod read;
mod servo;
mod signal_checks;
mod times;
mod topics;

pub use crate::tables::{Finding, LogError};
pub use arrays::{Arrays, Sample};
pub use columns::TORQUE_LATE;
pub use file::LogFile;
pub use inspect::{Aligned, Inspected, InspectedColumn, InspectedTable, TakenAs, inspect};
pub use live::{LiveRows, LiveSample, Taken};
pub use map::{ByJoint, Clock, ColumnMap, Mapped};
pub use motors::{Motors, logs_of_motors, notes_of};
pub use read::{read_log, read_log_as, read_logs, read_logs_as};
pub use servo::{ServoLog, are_of_servos, is_of_servos};
use signal_checks::{Severity, Warnings};
pub use times::common_clock;
pub use topics::{Alignment, alignment};

/// One recording as it was logged, after its faults were taken out.
#[derive(Clone, Debug)]
pub struct Log {
    /// The file, as the caller named it.
    pub file: String,
    /// Rising time stamps, s.
    pub t: Vec<f64>,
    /// Joint positions by joint, rad or m, without wraps.
    pub q: Vec<Vec<f64>>,
    /// Joint torques by joint, N·m or N, positive in the direction of q.
    pub torque: Vec<Vec<f64>>,
    /// Joint temperatures by joint, °C, where they were logged.
    pub temperature: Option<Vec<Vec<f64>>>,
    /// Torques on the motors' side of the gears by joint (n × N, as `torque`), where they were logged. Unit,
    /// sign and ratio are whatever the drives say; not a number where a sample has none.
    pub motor: Option<Vec<Vec<f64>>>,
    /// Index ranges without a gap.
    pub pieces: Vec<std::ops::Range<usize>>,
    /// What in its signals makes every result useless as it stands.
    pub doubts: Vec<Doubt>,
    /// Seconds to add to `t` for a clock that runs through all logs (see [`common_clock`]).
    pub clock: f64,
}

/// Why results of a log should not be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doubt {
    /// The reason, a sentence.
    pub sentence: String,
    /// The line of a column map that sets it right, where one does.
    pub map: Option<String>,
}

impl Log {
    /// The log's first and second half by samples, as logs of their own.
    #[must_use]
    pub fn halves(&self) -> [Log; 2] {
        let middle = self.t.len() / 2;
        [self.part(0..middle, "first half"), self.part(middle..self.t.len(), "second half")]
    }

    /// The samples of its pieces one by one, as a stream has them.
    pub fn samples(&self) -> impl Iterator<Item = LiveSample> + '_ {
        let of = |x: &[Vec<f64>], k: usize| x.iter().map(|x| x[k]).collect();
        let sample = move |k| LiveSample { t: self.t[k], q: of(&self.q, k), torque: of(&self.torque, k) };
        self.pieces.iter().cloned().flatten().map(sample)
    }

    /// The log's first samples.
    #[must_use]
    pub fn cut(mut self, samples: usize) -> Log {
        let samples = samples.min(self.t.len());
        let cut = |values: &mut Vec<f64>| {
            values.truncate(samples);
            values.shrink_to_fit();
        };
        cut(&mut self.t);
        let optional = self.temperature.iter_mut().chain(&mut self.motor).flatten();
        self.q.iter_mut().chain(&mut self.torque).chain(optional).for_each(cut);
        self.pieces.retain(|piece| piece.start < samples);
        self.pieces.iter_mut().for_each(|piece| piece.end = piece.end.min(samples));
        self
    }

    fn part(&self, own: std::ops::Range<usize>, name: &str) -> Log {
        let cut = |all: &Vec<Vec<f64>>| all.iter().map(|x| x[own.clone()].to_vec()).collect();
        let clip = |piece: &std::ops::Range<usize>| {
            let (from, to) = (piece.start.max(own.start), piece.end.min(own.end));
            (from < to).then(|| from - own.start..to - own.start)
        };
        Log {
            file: format!("{} ({name})", self.file),
            t: self.t[own.clone()].to_vec(),
            q: cut(&self.q),
            torque: cut(&self.torque),
            temperature: self.temperature.as_ref().map(cut),
            motor: self.motor.as_ref().map(cut),
            pieces: self.pieces.iter().filter_map(clip).collect(),
            doubts: self.doubts.clone(),
            clock: self.clock,
        }
    }
}

#[cfg(test)]
mod tests;
