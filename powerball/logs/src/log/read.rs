//! Logs found by their column names, from a file of any format.
//!
//! The file also has samples as they were read, before any doubt; the samples of a log while it is read, by
//! whatever reader.

use super::columns::{Asked, Columns, TORQUE_LATE};
use super::map::{ByJoint, ColumnMap, Mapped};
use super::{Finding, Log, LogError, check, topics};
use crate::tables::{Format, Place, RowSink, Table, columnar, make_room, read_dataset, read_topics, text};
use dyngen::Arm;
use std::fs::File;
#[cfg(test)]
use std::io::Read;
use std::path::Path;

/// Reads several logs of an arm; the findings are of all of them.
///
/// # Errors
/// Every reason why one of the logs cannot be used.
pub fn read_logs<P: AsRef<Path>>(files: &[P], arm: &Arm) -> Result<(Vec<Log>, Vec<Finding>), LogError> {
    read_logs_as(files, arm, &ColumnMap::default())
}

/// As [`read_logs`], with a map of their columns.
///
/// # Errors
/// Every reason why one of the logs cannot be used.
pub fn read_logs_as<P: AsRef<Path>>(
    files: &[P],
    arm: &Arm,
    map: &ColumnMap,
) -> Result<(Vec<Log>, Vec<Finding>), LogError> {
    let (mut logs, mut findings, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match read_log_as(file.as_ref(), arm, map, &mut findings) {
            Ok(log) => logs.push(log),
            Err(LogError(reasons)) => errors.extend(reasons),
        }
    }
    if errors.is_empty() { Ok((logs, findings)) } else { Err(LogError(errors)) }
}

/// Reads one log of an arm and adds what is odd about it to `findings`.
///
/// # Errors
/// Why the log cannot be used: no such file, missing columns, no torque constant, units that cannot be right.
pub fn read_log(path: &Path, arm: &Arm, findings: &mut Vec<Finding>) -> Result<Log, LogError> {
    read_log_as(path, arm, &ColumnMap::default(), findings)
}

/// As [`read_log`], with a map of its columns.
///
/// # Errors
/// As [`read_log`].
pub fn read_log_as(
    path: &Path,
    arm: &Arm,
    map: &ColumnMap,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    let file = path.display().to_string();
    read_asked(path, Asked { arm, map, file: &file, header: None, goals: false }, findings, log_of)
}

/// A log of what was asked for, as `finish` makes it of the samples.
pub(super) fn read_asked<T>(
    path: &Path,
    asked: Asked<'_>,
    findings: &mut Vec<Finding>,
    finish: Finish<T>,
) -> Result<T, LogError> {
    let (map, file) = (asked.map, asked.file.to_string());
    let unreadable = |e| LogError::of_file(&file, "file", format!("cannot be read: {e}"));
    let mut place = Place::of(path)?;
    let path = place.path.clone();
    match place.format {
        Format::Csv => {
            let opened = File::open(&path).map_err(unreadable)?;
            rows(asked, findings, finish, |samples, notes| text::read(opened, &file, samples, notes))
        }
        Format::Parquet => {
            let opened = File::open(&path).map_err(unreadable)?;
            rows(asked, findings, finish, |samples, _| columnar::read(opened, &file, samples).map(|()| false))
        }
        Format::LeRobot => {
            let read = |samples: &mut Samples<'_>, notes: &mut Vec<Finding>| {
                read_dataset(&path, &file, samples, notes).map(|()| false)
            };
            rows(asked, findings, finish, read)
        }
        _ => {
            // With other topics left aside; an error names them all.
            if let Some(only) = map.topics() {
                let contents = read_topics(&mut place, &file, Some(&only))?;
                let mut own = contents.notes;
                if let Ok(log) = topics::log(contents.tables, asked, &mut own, finish) {
                    findings.extend(own);
                    return Ok(log);
                }
            }
            let contents = read_topics(&mut place, &file, None)?;
            findings.extend(contents.notes);
            topics::log(contents.tables, asked, findings, finish)
        }
    }
}

/// Reads a log from lines.
#[cfg(test)]
pub(super) fn parse(
    input: impl Read,
    asked: Asked<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    rows(asked, findings, log_of, |samples, notes| text::read(input, asked.file, samples, notes))
}

/// A signal that a log may lack, by joint and sample.
pub(super) type Optional = Option<Vec<Vec<f64>>>;

/// What is made of samples; whether the last one is torn.
pub(super) type Finish<T> = for<'s> fn(Samples<'s>, bool) -> Result<T, LogError>;

/// The log of an arm whose torques are measured.
pub(super) fn log_of(samples: Samples<'_>, torn: bool) -> Result<Log, LogError> {
    samples.finish(torn)
}

/// Reads a log row by row; `read` says whether the last one is torn.
pub(super) fn rows<T>(
    asked: Asked<'_>,
    findings: &mut Vec<Finding>,
    finish: Finish<T>,
    read: impl FnOnce(&mut Samples<'_>, &mut Vec<Finding>) -> Result<bool, LogError>,
) -> Result<T, LogError> {
    // Their header is their first line.
    let asked = Asked { header: Some(1), ..asked };
    let mut notes = Vec::new();
    let mut samples = Samples::new(asked, "line", findings);
    let torn = read(&mut samples, &mut notes)?;
    let log = finish(samples, torn);
    findings.extend(notes);
    log
}

impl Log {
    /// Reads a log of an arm from a file, CSV, Parquet, MCAP, a bag of ROS, npz, mat or HDF5, with what is
    /// odd about it.
    ///
    /// # Errors
    /// Why the log cannot be used: no such file, missing columns, no torque constant, units that cannot be
    /// right.
    pub fn read(path: impl AsRef<Path>, arm: &Arm) -> Result<(Log, Vec<Finding>), LogError> {
        Log::read_as(path, arm, &ColumnMap::default())
    }

    /// As [`Log::read`], with a map of its columns.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn read_as(
        path: impl AsRef<Path>,
        arm: &Arm,
        map: &ColumnMap,
    ) -> Result<(Log, Vec<Finding>), LogError> {
        let mut findings = Vec::new();
        let log = read_log_as(path.as_ref(), arm, map, &mut findings)?;
        Ok((log, findings))
    }
}

// Samples as they were read, before any doubt.

/// What the effort columns hold.
pub(super) enum Effort {
    /// N·m or N.
    Torque,
    /// A, with N·m/A (N/A) by joint.
    Current(Vec<f64>),
    /// Set-points of position servos, rad or m.
    Goal,
}

/// What columns of set-points are called.
pub(super) const GOAL: &str = "goal";

impl Effort {
    /// What its columns are called.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Effort::Torque => "tau",
            Effort::Current(_) => "i",
            Effort::Goal => GOAL,
        }
    }
}

/// Samples as read: joint-major.
pub(super) struct Raw {
    pub(super) line: Vec<usize>,
    pub(super) t: Vec<f64>,
    pub(super) q: Vec<Vec<f64>>,
    pub(super) effort: Vec<Vec<f64>>,
    pub(super) temperature: Option<Vec<Vec<f64>>>,
    pub(super) dq: Vec<Vec<f64>>,
    pub(super) motor: Option<Vec<Vec<f64>>>,
    pub(super) of_servos: Vec<Optional>,
}

impl Raw {
    pub(super) fn new(dof: usize, columns: &Columns) -> Raw {
        let empty = || vec![Vec::new(); dof];
        Raw {
            line: Vec::new(),
            t: Vec::new(),
            q: empty(),
            effort: empty(),
            temperature: columns.temperature.as_ref().map(|_| empty()),
            dq: empty(),
            motor: columns.motor.as_ref().map(|_| empty()),
            of_servos: columns.of_servos.iter().map(|group| group.as_ref().map(|_| empty())).collect(),
        }
    }

    /// Makes room for `samples` more samples.
    fn expect(&mut self, samples: usize) {
        make_room(&mut self.line, samples);
        let of_servos = self.of_servos.iter_mut().flatten().flatten();
        let motor = self.motor.iter_mut().flatten().chain(of_servos).chain(&mut self.dq);
        let optional = self.temperature.iter_mut().flatten().chain(motor);
        let by_joint = self.q.iter_mut().chain(&mut self.effort).chain(optional);
        by_joint.chain([&mut self.t]).for_each(|values| make_room(values, samples));
    }

    /// How many signals there are.
    fn signals(&self) -> usize {
        let of_servos = self.of_servos.iter().flatten();
        let optional =
            self.temperature.iter().chain(&self.motor).chain(of_servos).map(Vec::len).sum::<usize>();
        1 + self.q.len() + self.effort.len() + self.dq.len() + optional
    }

    pub(super) fn push(&mut self, line: usize, values: &[f64]) {
        let mut values = values.iter().copied();
        self.line.push(line);
        self.t.extend(values.next());
        for joint in self.q.iter_mut().chain(&mut self.effort) {
            joint.extend(values.next());
        }
        // Last what says by being empty that it is not there.
        let motor = self.motor.iter_mut().flatten().chain(self.of_servos.iter_mut().flatten().flatten());
        for joint in self.temperature.iter_mut().flatten().chain(motor).chain(&mut self.dq) {
            joint.extend(values.next());
        }
    }

    pub(super) fn retain(&mut self, keep: &[bool]) {
        let filter = |x: &mut Vec<f64>| {
            if x.len() == keep.len() {
                let mut k = keep.iter();
                x.retain(|_| *k.next().unwrap_or(&true));
            }
        };
        filter(&mut self.t);
        self.q.iter_mut().chain(&mut self.effort).for_each(filter);
        let motor = self.motor.iter_mut().flatten().chain(self.of_servos.iter_mut().flatten().flatten());
        self.temperature.iter_mut().flatten().chain(&mut self.dq).chain(motor).for_each(filter);
        let mut k = keep.iter();
        self.line.retain(|_| *k.next().unwrap_or(&true));
    }
}

// The samples of a log while it is read, by whatever reader.

/// More samples without a number than this share make a log unusable.
const MOST_BAD_LINES: f64 = 0.2;

/// The samples of a log while it is read, and how many of its lines are none.
pub(super) struct Samples<'a> {
    asked: Asked<'a>,
    findings: &'a mut Vec<Finding>,
    /// What a sample is called: "line", "sample" or "message".
    called: &'static str,
    names: Vec<String>,
    found: Option<(Columns, Raw)>,
    total: usize,
    bad: usize,
    first_bad: Option<(usize, String)>,
    late: Option<Late>,
}

/// What the column [`TORQUE_LATE`] says.
struct Late {
    /// The column.
    at: usize,
    /// Its value, s, once there was a line.
    value: Option<f64>,
    /// The first line with another one.
    changed: Option<usize>,
}

impl Late {
    fn take(&mut self, line: usize, value: Option<f64>) {
        let Some(value) = value else { return };
        if *self.value.get_or_insert(value) != value {
            self.changed.get_or_insert(line);
        }
    }
}

impl<'a> Samples<'a> {
    pub(super) fn new(asked: Asked<'a>, called: &'static str, findings: &'a mut Vec<Finding>) -> Samples<'a> {
        let names = Vec::new();
        Samples { asked, findings, called, names, found: None, total: 0, bad: 0, first_bad: None, late: None }
    }

    /// The log of what was taken; `torn` where the last line is.
    pub(super) fn finish(mut self, torn: bool) -> Result<Log, LogError> {
        let map = self.asked.map;
        let known = self.known_shift()?;
        let (log, effort, _) = self.finished(torn)?;
        Ok(match effort {
            Effort::Torque => log.shifted(known.as_ref().unwrap_or(&map.tau)),
            Effort::Current(_) => log.shifted(&map.i),
            Effort::Goal => log,
        })
    }

    /// How the torques are shifted by what the log itself says, where the map does not say it.
    fn known_shift(&mut self) -> Result<Option<Mapped>, LogError> {
        let map = &self.asked.map.tau;
        let (Some(late), None) = (&self.late, &map.shift) else { return Ok(None) };
        let finding = |line: Option<usize>, message: String| Finding {
            file: self.asked.file.to_string(),
            line,
            quantity: TORQUE_LATE.to_string(),
            message,
        };
        if late.changed.is_some() {
            let message = "its value changes here: cut the log into one for each value".to_string();
            return Err(LogError(vec![finding(late.changed, message)]));
        }
        let Some(value) = late.value.filter(|value| *value != 0.0) else { return Ok(None) };
        let message = format!(
            "torques are taken {:.2} ms earlier, as this column says; --map 'tau.shift = 0' leaves them",
            1e3 * value
        );
        self.findings.push(finding(None, message));
        Ok(Some(Mapped { shift: Some(ByJoint::All(-value)), ..map.clone() }))
    }

    /// The log of what was taken, what its torques were made of, and what only logs of servos have.
    pub(super) fn finished(mut self, torn: bool) -> Result<(Log, Effort, Vec<Optional>), LogError> {
        let file = self.asked.file;
        if torn && self.total > 0 {
            let message =
                "the last line is torn (fewer or more fields than the header); it was left out".to_string();
            self.findings.push(Finding::of_file(file, "last line", message));
            self.bad -= 1;
        }
        let (bad, total, called) = (self.bad, self.total, self.called);
        if let Some((line, culprit)) = self.first_bad.filter(|_| bad > 0) {
            let finding = |message: String| Finding {
                file: file.to_string(),
                line: Some(line),
                quantity: culprit.clone(),
                message,
            };
            if bad as f64 > MOST_BAD_LINES * total as f64 {
                return Err(LogError(vec![finding(format!(
                    "{bad} of {total} {called}s hold no finite number in every needed column: record the log \
                        again or leave it out"
                ))]));
            }
            self.findings.push(finding(format!(
                "{bad} of {total} {called}s hold no finite number in every needed column (the first is this \
                    one) and were left out; short holes are filled by interpolation, long ones split the log"
            )));
        }
        let Some((columns, mut raw)) = self.found else {
            return Err(LogError::of_file(file, "samples", "there are none"));
        };
        let log = check::into_log(&mut raw, &columns.effort, file, self.asked.arm, self.findings)?;
        Ok((log, columns.effort, raw.of_servos))
    }
}

impl Samples<'_> {
    /// Takes a whole table, whose columns become the log's without a copy; `time` is the time of its samples
    /// where no column is.
    pub(super) fn table(&mut self, table: Table, time: Option<Vec<f64>>) -> Result<(), LogError> {
        // A message may have a `t` of its own in addition to the time that counts.
        let own = |name: String| if time.is_some() && name == "t" { "t of the message".into() } else { name };
        let names = table.columns.iter().map(|column| own(column.name.clone()));
        self.begin(&time.iter().map(|_| "t".to_string()).chain(names).collect::<Vec<_>>())?;
        let Some((columns, raw)) = &mut self.found else { return Ok(()) };
        let mut values: Vec<Vec<f64>> =
            time.into_iter().chain(table.columns.into_iter().map(|c| c.values)).collect();
        if let Some(late) = &mut self.late {
            let of_column = values.get(late.at).into_iter().flatten();
            let each = table.line.iter().zip(of_column);
            each.for_each(|(line, value)| late.take(*line, Some(*value).filter(|v| v.is_finite())));
        }
        let mut uses = columns.uses(&mut values);
        let keep: Vec<bool> = (0..table.line.len())
            .map(|k| {
                let field = |at: usize| values.get(at)?.get(k).copied().filter(|v| v.is_finite());
                if self.called == "message" && !columns.touches(&field) {
                    return false;
                }
                self.total += 1;
                let whole = columns.are_whole(&field);
                if !whole {
                    self.bad += 1;
                    let names = &self.names;
                    self.first_bad.get_or_insert_with(|| (table.line[k], columns.culprit(&field, names)));
                }
                whole
            })
            .collect();
        raw.line = table.line;
        columns.take(&mut values, &mut uses, raw);
        raw.retain(&keep);
        Ok(())
    }
}

impl RowSink for Samples<'_> {
    fn begin(&mut self, names: &[String]) -> Result<(), LogError> {
        let columns = Columns::find(names, self.asked, self.findings)?;
        let raw = Raw::new(self.asked.arm.dof(), &columns);
        self.found = Some((columns, raw));
        let at = names.iter().position(|name| name == TORQUE_LATE);
        self.late = at.map(|at| Late { at, value: None, changed: None });
        self.names = names.to_vec();
        Ok(())
    }

    fn expect(&mut self, rows: usize) {
        if let Some((_, raw)) = &mut self.found {
            raw.expect(rows);
        }
    }

    fn kept(&self) -> usize {
        self.found.as_ref().map_or(0, |(_, raw)| raw.signals() + 1)
    }

    fn row(&mut self, line: usize, number: &dyn Fn(usize) -> Option<f64>) {
        let Some((columns, raw)) = &mut self.found else { return };
        let field = |k: usize| number(k).filter(|v: &f64| v.is_finite());
        // Others, such as a gripper, may publish on the same topic.
        if self.called == "message" && !columns.touches(&field) {
            return;
        }
        self.total += 1;
        match columns.sample(&field) {
            Some(values) => {
                raw.push(line, &values);
                if let Some(late) = &mut self.late {
                    late.take(line, field(late.at));
                }
            }
            None => {
                self.bad += 1;
                let names = &self.names;
                self.first_bad.get_or_insert_with(|| (line, columns.culprit(&field, names)));
            }
        }
    }
}
