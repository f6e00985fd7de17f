//! Logs from memory: they pass the same checks as those from files.

use super::columns::Asked;
use super::map::ColumnMap;
use super::read::Samples;
use super::{Finding, Log, LogError};
use crate::tables::RowSink;
use dyngen::Arm;

/// The signals of a log in memory, each by joint: as many values as times.
///
/// What is not there stays empty: `Arrays { t, q, torque, ..Arrays::default() }`. A log needs torques or
/// currents.
#[derive(Clone, Copy, Debug, Default)]
pub struct Arrays<'a> {
    /// Times, s.
    pub t: &'a [f64],
    /// Positions, rad or m.
    pub q: &'a [Vec<f64>],
    /// Torques, N·m or N, positive in the direction of q.
    pub torque: &'a [Vec<f64>],
    /// Motor currents, A: used where there are no torques, with the arm file's torque constants.
    pub current: &'a [Vec<f64>],
    /// Velocities, rad/s or m/s: they check positions and times; velocities are computed from positions.
    pub velocity: &'a [Vec<f64>],
    /// Temperatures, °C.
    pub temperature: &'a [Vec<f64>],
    /// Torques on the motors' side of the gears, in any unit: kept in addition to the torques.
    pub motor: &'a [Vec<f64>],
}

/// One sample of a log: its time, and by joint the quantities of [`Arrays`], empty where they were not
/// logged.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample<'a> {
    /// Time, s.
    pub t: f64,
    /// Positions, rad or m.
    pub q: &'a [f64],
    /// Torques, N·m or N.
    pub torque: &'a [f64],
    /// Motor currents, A.
    pub current: &'a [f64],
    /// Velocities, rad/s or m/s.
    pub velocity: &'a [f64],
    /// Temperatures, °C.
    pub temperature: &'a [f64],
    /// Torques on the motors' side of the gears, in any unit.
    pub motor: &'a [f64],
}

/// The prefixes of column names in a file, in the order of the fields above.
const PREFIXES: [&str; 6] = ["q", "tau", "i", "dq", "temp", "motor"];

impl Log {
    /// A log of an arm from signals in memory, with what is odd about it. `name` stands in messages where a
    /// file does, and a sample's number, from 1, where a line does.
    ///
    /// # Errors
    /// Why the log cannot be used: signals of unlike length, missing joints, units that cannot be right.
    pub fn from_arrays(name: &str, arm: &Arm, arrays: &Arrays<'_>) -> Result<(Log, Vec<Finding>), LogError> {
        let groups =
            [arrays.q, arrays.torque, arrays.current, arrays.velocity, arrays.temperature, arrays.motor];
        let by_joint = PREFIXES.iter().zip(groups).flat_map(|(prefix, group)| {
            group.iter().enumerate().map(move |(j, signal)| (format!("{prefix}{}", j + 1), signal.as_slice()))
        });
        let columns: Vec<(String, &[f64])> =
            std::iter::once(("t".to_string(), arrays.t)).chain(by_joint).collect();
        Log::from_columns(name, arm, &columns)
    }

    /// As [`Log::from_arrays`], from samples one after the other. The first one determines which quantities
    /// there are; a sample that lacks one of them has a hole there.
    ///
    /// # Errors
    /// As [`Log::from_arrays`].
    pub fn from_samples<'a>(
        name: &str,
        arm: &Arm,
        samples: impl IntoIterator<Item = Sample<'a>>,
    ) -> Result<(Log, Vec<Finding>), LogError> {
        let mut t = Vec::new();
        let mut signals: [Vec<Vec<f64>>; PREFIXES.len()] = Default::default();
        for sample in samples {
            let groups =
                [sample.q, sample.torque, sample.current, sample.velocity, sample.temperature, sample.motor];
            for (signals, values) in signals.iter_mut().zip(groups) {
                if t.is_empty() {
                    signals.resize(values.len(), Vec::new());
                }
                let value = |j: usize| values.get(j).copied().unwrap_or(f64::NAN);
                signals.iter_mut().enumerate().for_each(|(j, signal)| signal.push(value(j)));
            }
            t.push(sample.t);
        }
        let [q, torque, current, velocity, temperature, motor] = &signals;
        Log::from_arrays(name, arm, &Arrays { t: &t, q, torque, current, velocity, temperature, motor })
    }

    /// As [`Log::from_arrays`], from columns named as in a file: `t`, `q1` …, `tau1` … or `i1` …, `dq1` …,
    /// `temp1` ….
    ///
    /// # Errors
    /// As [`Log::from_arrays`].
    pub fn from_columns(
        name: &str,
        arm: &Arm,
        columns: &[(String, &[f64])],
    ) -> Result<(Log, Vec<Finding>), LogError> {
        Log::from_columns_as(name, arm, columns, &ColumnMap::default())
    }

    /// As [`Log::from_columns`], with a map of the columns.
    ///
    /// # Errors
    /// As [`Log::from_arrays`].
    pub fn from_columns_as(
        name: &str,
        arm: &Arm,
        columns: &[(String, &[f64])],
        map: &ColumnMap,
    ) -> Result<(Log, Vec<Finding>), LogError> {
        let mut findings = Vec::new();
        let asked = Asked { arm, map, file: name, header: Some(1), goals: false };
        let log = Samples::of_columns(asked, columns, &mut findings)?.finish(false)?;
        Ok((log, findings))
    }
}

impl<'a> Samples<'a> {
    /// The samples of columns in memory.
    ///
    /// # Errors
    /// Columns of unlike length, and why such columns are of no use.
    pub(super) fn of_columns(
        asked: Asked<'a>,
        columns: &[(String, &[f64])],
        findings: &'a mut Vec<Finding>,
    ) -> Result<Samples<'a>, LogError> {
        let times = columns.iter().find(|(column, _)| column == "t").map_or(0, |(_, t)| t.len());
        let unlike = columns.iter().filter(|(_, values)| values.len() != times);
        let unlike: Vec<Finding> = unlike
            .map(|(column, values)| Finding {
                file: asked.file.to_string(),
                line: None,
                quantity: column.clone(),
                message: format!("has {} values for {times} times t: give one for each", values.len()),
            })
            .collect();
        if !unlike.is_empty() {
            return Err(LogError(unlike));
        }
        let names: Vec<String> = columns.iter().map(|(column, _)| column.clone()).collect();
        let mut samples = Samples::new(asked, "sample", findings);
        samples.begin(&names)?;
        samples.expect(times);
        for k in 0..times {
            samples.row(k + 1, &|column| columns.get(column)?.1.get(k).copied());
        }
        Ok(samples)
    }
}
