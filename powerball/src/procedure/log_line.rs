//! What a line of a recording says of its cycle.
//!
//! Also here: what a person is told while the arm moves.

use crate::bus::canopen::Micros;
use crate::bus::driver::{Counters, Driver};
use std::fmt;
use std::fmt::Write as _;

/// The time of a log: so many s at the first of its SYNCs, and from there on what the bus's clock measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LogTime {
    start: f64,
    first: Option<Micros>,
}

impl LogTime {
    /// A log, or a part of one, that begins at `start`, s.
    #[must_use]
    pub fn from(start: f64) -> LogTime {
        LogTime { start, first: None }
    }

    /// The time of a SYNC in the log, s. The first that is asked for is where it begins.
    pub fn at(&mut self, sync: Micros) -> f64 {
        let since = sync.saturating_sub(*self.first.get_or_insert(sync));
        self.start + since as f64 * 1e-6
    }
}

/// Which columns a recording has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Columns {
    /// `t`, `q1…qn` (rad) and `tau1…taun` (N·m).
    Torques,
    /// Besides, all that was told and heard: `ref1…refn`, the set-points (rad); `dq1…dqn`, as the drives tell it
    /// (rad/s); `status1…statusn`, the statuswords; `answer1…answern`, from SYNC to the joint's data (s); and `late`,
    /// `skipped`, `dropped`, how many SYNCs and set-points were so since the recording began.
    Everything,
}

impl Columns {
    /// The first line of a log of `n` joints.
    pub(super) fn header(self, n: usize) -> String {
        let (joint, once): (&[&str], &[&str]) = match self {
            Columns::Torques => (&["q", "tau"], &[]),
            Columns::Everything => {
                (&["q", "tau", "ref", "dq", "status", "answer"], &["late", "skipped", "dropped"])
            }
        };
        let numbered = joint.iter().flat_map(|name| (1..=n).map(move |j| format!("{name}{j}")));
        let names = ["t".to_string()].into_iter().chain(numbered).chain(once.iter().map(ToString::to_string));
        names.collect::<Vec<_>>().join(",") + "\n"
    }

    /// The line of the present cycle at `t`, s, in which `reference` (rad) was given; counts from `begin` on.
    pub(super) fn line<const N: usize>(
        self,
        line: &mut String,
        t: f64,
        driver: &Driver<N>,
        reference: &[f64],
        begin: &Counters,
    ) {
        let joints = driver.joints();
        line.clear();
        // Writing to a string cannot fail.
        let _ = write!(line, "{t:.6}");
        let mut cell = |value: std::fmt::Arguments<'_>| {
            let _ = write!(line, ",{value}");
        };
        // A digit finer than the encoders' step.
        joints.iter().for_each(|joint| cell(format_args!("{:.7}", joint.position)));
        joints.iter().for_each(|joint| cell(format_args!("{:.4}", joint.torque)));
        if self == Columns::Everything {
            reference.iter().for_each(|q| cell(format_args!("{q:.7}")));
            joints.iter().for_each(|joint| cell(format_args!("{:.6}", joint.velocity)));
            joints.iter().for_each(|joint| cell(format_args!("{}", joint.status.map_or(0, |s| s.0))));
            let since = |at: Micros| at.saturating_sub(driver.synced_at()) as f64 * 1e-6;
            joints.iter().for_each(|joint| cell(format_args!("{:.6}", since(joint.answered_at))));
            let now = driver.counters();
            let counts = [now.late - begin.late, now.skipped - begin.skipped, now.dropped - begin.dropped];
            counts.iter().for_each(|count| cell(format_args!("{count}")));
        }
        line.push('\n');
    }
}

// What a person is told while the arm moves.

/// How far a motion has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Samples that were given, and all there are.
    pub samples: [usize; 2],
    /// Where the joints are, rad.
    pub position: Vec<f64>,
    /// The greatest distance of a joint from its set-point now, rad.
    pub error: f64,
    /// SYNCs that were late since the master began.
    pub late: u64,
    /// Joints' data that was missing since then, in cycles.
    pub missing: u64,
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [done, all] = self.samples;
        let share = 100 * done / all.max(1);
        write!(f, "{share:3} % of {all} samples, at (")?;
        for (j, q) in self.position.iter().enumerate() {
            write!(f, "{}{q:.3}", if j == 0 { "" } else { ", " })?;
        }
        let Told { error, late, missing, .. } = self;
        write!(f, ") rad, {:.1} mrad off, {late} cycles late, {missing} without data", 1e3 * error)
    }
}
