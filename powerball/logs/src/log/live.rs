//! Rows one by one, while they are recorded: found by their column names as those of files, and nothing is
//! known of what comes after.

use super::check::RESTART;
use super::columns::{Asked, Columns};
use super::map::ColumnMap;
use super::read::Effort;
use super::{Finding, LogError, Motors};
use dyngen::Arm;
use dyngen::arm::JointKind;
use std::f64::consts::TAU;

/// A sample in the log's own units: s, rad or m, N·m or N.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LiveSample {
    /// Time, s.
    pub t: f64,
    /// Positions by joint, without wraps.
    pub q: Vec<f64>,
    /// Torques by joint.
    pub torque: Vec<f64>,
}

/// What a row is.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    /// A sample; where the clock `restarted` its time goes on from the last one's.
    Sample {
        /// The sample.
        sample: LiveSample,
        /// Whether time fell back before it.
        restarted: bool,
    },
    /// The sample's time does not rise.
    Stale,
    /// A needed column has no finite number.
    Nothing,
}

/// Time that falls back by more than this is a clock that restarts, s.
const RESTARTS: f64 = 0.5;

/// How the rows of a stream become samples.
pub struct LiveRows {
    columns: Columns,
    motors: Option<Motors>,
    turns: Vec<bool>,
    last: Option<LiveSample>,
    /// Added to times since the clock restarted, s.
    added: f64,
}

impl LiveRows {
    /// The rows of columns of these names; `name` stands in messages where a file does.
    ///
    /// # Errors
    /// Why such rows are of no use: missing columns, more joints than the arm has, no torque constant.
    pub fn new(name: &str, arm: &Arm, names: &[String], map: &ColumnMap) -> Result<LiveRows, LogError> {
        let mut findings: Vec<Finding> = Vec::new();
        let asked = Asked { arm, map, file: name, header: Some(1), goals: false };
        Ok(LiveRows {
            columns: Columns::find(names, asked, &mut findings)?,
            motors: Motors::of(arm),
            turns: arm.joints.iter().map(|joint| joint.kind == JointKind::Revolute).collect(),
            last: None,
            added: 0.0,
        })
    }

    /// The sample of a row.
    pub fn sample(&mut self, number: impl Fn(usize) -> Option<f64>) -> Taken {
        let finite = |k: usize| number(k).filter(|v: &f64| v.is_finite());
        let Some(values) = self.columns.sample(&finite) else { return Taken::Nothing };
        let n = self.turns.len();
        let [t, q, torque] = [&values[..1], &values[1..=n], &values[n + 1..=2 * n]];
        let (mut t, mut q, mut torque) = (t[0] + self.added, q.to_vec(), torque.to_vec());
        let mut restarted = false;
        if let Some(last) = self.last.as_ref().filter(|last| t <= last.t) {
            if last.t - t < RESTARTS {
                return Taken::Stale;
            }
            self.added += last.t + RESTART - t;
            (t, restarted) = (last.t + RESTART, true);
        }
        if let Effort::Current(constants) = &self.columns.effort {
            torque.iter_mut().zip(constants).for_each(|(x, c)| *x *= c);
            if let Some(motors) = &self.motors {
                torque = motors.joint_torques(&torque);
            }
        }
        if let Some(last) = &self.last {
            for ((q, last), _) in q.iter_mut().zip(&last.q).zip(&self.turns).filter(|(_, turns)| **turns) {
                let jumps = ((*q - last) / TAU).round();
                // Within half a radian of a whole turn: a wrap, and no motion.
                if jumps != 0.0 && (*q - last - jumps * TAU).abs() < 0.5 {
                    *q -= jumps * TAU;
                }
            }
        }
        let sample = LiveSample { t, q, torque };
        self.last = Some(sample.clone());
        Taken::Sample { sample, restarted }
    }
}

impl std::fmt::Debug for LiveRows {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LiveRows").field("last", &self.last).finish_non_exhaustive()
    }
}
