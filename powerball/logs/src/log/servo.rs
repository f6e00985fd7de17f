//! Logs of position servos: positions and set-points, and no torque.

use super::columns::{Asked, constants, group};
use super::headers::{self, Headers};
use super::map::ColumnMap;
use super::read::{Samples, read_asked};
use super::times::clocks;
use super::{Doubt, Finding, LogError};
use crate::tables::{Format, Place, RowSink, columnar, is_address, read_dataset, text};
use dyngen::Arm;
use std::fs::File;
use std::ops::Range;
use std::path::Path;

/// One recording of position servos as it was logged, after its faults were taken out.
#[derive(Clone, Debug)]
pub struct ServoLog {
    /// The file, as the caller named it.
    pub file: String,
    /// Rising time stamps, s.
    pub t: Vec<f64>,
    /// Joint positions by joint, rad or m, without wraps.
    pub q: Vec<Vec<f64>>,
    /// Set-points by joint, in the unit of the positions.
    pub goal: Vec<Vec<f64>>,
    /// Joint temperatures by joint, °C, where they were logged.
    pub temperature: Option<Vec<Vec<f64>>>,
    /// Voltages of the drives by joint, V, where they were logged; not a number where a sample has none.
    pub volts: Option<Vec<Vec<f64>>>,
    /// Loads as the drives report them, in whatever unit, where they were logged; not a number where a sample
    /// has none.
    pub load: Option<Vec<Vec<f64>>>,
    /// Whether each drive was switched on, by joint, where that was logged; else it was.
    pub enabled: Option<Vec<Vec<bool>>>,
    /// Index ranges without a gap.
    pub pieces: Vec<Range<usize>>,
    /// What in its signals makes every result useless as it stands.
    pub doubts: Vec<Doubt>,
    /// Seconds to add to `t` for a clock that runs through all logs.
    pub clock: f64,
}

impl ServoLog {
    /// Reads a log of position servos from a file of any format, with what is odd about it.
    ///
    /// # Errors
    /// Why the log cannot be used: no such file, no set-points, units that cannot be right.
    pub fn read(path: &Path, arm: &Arm, map: &ColumnMap) -> Result<(ServoLog, Vec<Finding>), LogError> {
        let (file, mut findings) = (path.display().to_string(), Vec::new());
        let asked = Asked { arm, map, file: &file, header: None, goals: true };
        let log = read_asked(path, asked, &mut findings, ServoLog::of)?;
        Ok((log, findings))
    }

    /// A log of position servos from columns in memory, named as in a file: `t`, `q1` …, `goal1` …, and where
    /// they are there `volts1` …, `load1` …, `torque_enable1` …, `temp1` ….
    ///
    /// # Errors
    /// As [`ServoLog::read`].
    pub fn from_columns(
        name: &str,
        arm: &Arm,
        columns: &[(String, &[f64])],
    ) -> Result<(ServoLog, Vec<Finding>), LogError> {
        ServoLog::from_columns_as(name, arm, columns, &ColumnMap::default())
    }

    /// As [`ServoLog::from_columns`], with a map of the columns.
    ///
    /// # Errors
    /// As [`ServoLog::read`].
    pub fn from_columns_as(
        name: &str,
        arm: &Arm,
        columns: &[(String, &[f64])],
        map: &ColumnMap,
    ) -> Result<(ServoLog, Vec<Finding>), LogError> {
        let mut findings = Vec::new();
        let asked = Asked { arm, map, file: name, header: Some(1), goals: true };
        let samples = Samples::of_columns(asked, columns, &mut findings)?;
        let log = ServoLog::of(samples, false)?;
        Ok((log, findings))
    }

    fn of(samples: Samples<'_>, torn: bool) -> Result<ServoLog, LogError> {
        let (log, _, more) = samples.finished(torn)?;
        let [volts, load, enabled] = <[_; 3]>::try_from(more).unwrap_or_default();
        let on = |signals: Vec<Vec<f64>>| -> Vec<Vec<bool>> {
            signals.into_iter().map(|signal| signal.into_iter().map(|x| x != 0.0).collect()).collect()
        };
        Ok(ServoLog {
            file: log.file,
            q: log.q,
            goal: log.torque,
            temperature: log.temperature,
            volts,
            load,
            enabled: enabled.map(on),
            pieces: log.pieces,
            clock: -log.t.first().copied().unwrap_or(0.0),
            doubts: log.doubts,
            t: log.t,
        })
    }

    /// Lets one clock run through all logs, as [`common_clock`](super::common_clock) does.
    pub fn common_clock<'o>(logs: impl Iterator<Item = &'o mut ServoLog>) {
        let logs: Vec<&mut ServoLog> = logs.collect();
        let clocks = clocks(logs.iter().map(|log| log.t.as_slice()));
        logs.into_iter().zip(clocks).for_each(|(log, clock)| log.clock = clock);
    }
}

/// Whether a file is a log of position servos: its columns are ([`are_of_servos`]), or every joint of the arm
/// has its `[joint.servo]` where they cannot be looked at first.
#[must_use]
pub fn is_of_servos(path: &Path, arm: &Arm, map: &ColumnMap) -> bool {
    match names(path) {
        Some(names) => are_of_servos(&names, arm, map),
        None => has_servos(arm),
    }
}

fn has_servos(arm: &Arm) -> bool {
    arm.moving_joints().all(|joint| joint.servo.is_some())
}

/// Whether columns, by their names, are those of position servos: set-points and neither torques nor currents
/// with a constant, or no torques where every joint of the arm has its `[joint.servo]`.
#[must_use]
pub fn are_of_servos(names: &[String], arm: &Arm, map: &ColumnMap) -> bool {
    let servos = has_servos(arm);
    let asked = Asked { arm, map, file: "", header: Some(1), goals: false };
    let has = |key: &str| group(names, key, asked).is_ok();
    let torques = match headers::of(names, asked) {
        Headers::Clear(map, _) => map.tau.column.is_some() || map.i.column.is_some(),
        _ => false,
    };
    let currents = has("i") && constants(arm).is_ok();
    if has("tau") || torques {
        return false;
    }
    if has("goal") { servos || !currents } else { servos && !currents }
}

/// The names of the columns of a file of one table; the rest of it is not read.
fn names(path: &Path) -> Option<Vec<String>> {
    // What is at an address is fetched once.
    if is_address(path) {
        return None;
    }
    let place = Place::of(path).ok()?;
    let (file, mut names, mut notes) = (path.display().to_string(), Names::default(), Vec::new());
    // Whoever takes the names ends the reading.
    let _ = match place.format {
        Format::Csv => text::read(File::open(&place.path).ok()?, &file, &mut names, &mut notes).map(|_| ()),
        Format::Parquet => columnar::read(File::open(&place.path).ok()?, &file, &mut names),
        Format::LeRobot => read_dataset(&place.path, &file, &mut names, &mut notes),
        _ => return None,
    };
    names.0
}

/// Takes the names of columns and no row.
#[derive(Default)]
struct Names(Option<Vec<String>>);

impl RowSink for Names {
    fn begin(&mut self, names: &[String]) -> Result<(), LogError> {
        self.0 = Some(names.to_vec());
        Err(LogError(Vec::new()))
    }

    fn expect(&mut self, _: usize) {}

    fn kept(&self) -> usize {
        0
    }

    fn row(&mut self, _: usize, _: &dyn Fn(usize) -> Option<f64>) {}
}
