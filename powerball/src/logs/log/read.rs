//! Logs found by their column names, from CSV with a header line or from Parquet.

use super::check::{self, Raw};
use super::{Finding, Log, LogError};
use dyngen::Arm;
use std::collections::HashMap;
use std::path::Path;

/// More unreadable lines than this share make a log unusable.
const MOST_BAD_LINES: f64 = 0.2;

/// Reads several logs of an arm; the findings are of all of them.
///
/// # Errors
/// Every reason why one of the logs cannot be used.
pub fn read_logs<P: AsRef<Path>>(files: &[P], arm: &Arm) -> Result<(Vec<Log>, Vec<Finding>), LogError> {
    let (mut logs, mut findings, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match read_log(file.as_ref(), arm, &mut findings) {
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
    let file = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| {
        LogError(vec![Finding {
            file: file.clone(),
            line: None,
            quantity: "file".into(),
            message: format!("cannot be read: {e}"),
        }])
    })?;
    parse(&bytes, &file, arm, findings)
}

/// Reads a log from the bytes of a file: Parquet by its mark, CSV else.
pub(super) fn parse(
    bytes: &[u8],
    file: &str,
    arm: &Arm,
    findings: &mut Vec<Finding>,
) -> Result<Log, LogError> {
    if bytes.starts_with(b"PAR1") {
        return super::columnar::parse(bytes, file, arm, findings);
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let error = |line: Option<usize>, quantity: &str, message: String| Finding {
        file: file.to_string(),
        line,
        quantity: quantity.to_string(),
        message,
    };
    let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(bytes);
    let header = reader
        .byte_headers()
        .map_err(|e| LogError(vec![error(Some(1), "header", format!("cannot be read: {e}"))]))?
        .clone();
    let names: Vec<String> = header.iter().map(|h| String::from_utf8_lossy(h).into_owned()).collect();
    let mut samples = Samples::new(Columns::find(&names, arm, file, findings)?, arm);
    let mut record = csv::ByteRecord::new();
    let mut last_torn = false;
    loop {
        let line = reader.position().line() as usize;
        match reader.read_byte_record(&mut record) {
            Ok(false) => break,
            Ok(true) => {}
            Err(e) => {
                findings.push(error(Some(line), "line", format!("unreadable, left out: {e}")));
                continue;
            }
        }
        let line = record.position().map_or(line, |p| p.line() as usize);
        last_torn = record.len() != names.len();
        samples.take(line, &names, |k| {
            // A torn line's last number may be cut off too.
            let field = record.get(k).filter(|_| !last_torn)?;
            std::str::from_utf8(field).ok()?.parse().ok()
        });
    }
    if last_torn && samples.total > 0 {
        let message =
            "the last line is torn (fewer or more fields than the header); it was left out".to_string();
        findings.push(error(None, "last line", message));
        samples.bad -= 1;
    }
    samples.finish(file, arm, findings)
}

/// The samples of a log while it is read, and how many of its lines are none.
pub(super) struct Samples {
    columns: Columns,
    raw: Raw,
    total: usize,
    bad: usize,
    first_bad: Option<(usize, String)>,
}

impl Samples {
    pub(super) fn new(columns: Columns, arm: &Arm) -> Samples {
        let raw = Raw::new(arm.dof(), columns.temperature.is_some());
        Samples { columns, raw, total: 0, bad: 0, first_bad: None }
    }

    /// Takes a line; `field` gives the number in a column, where there is one.
    pub(super) fn take(&mut self, line: usize, names: &[String], field: impl Fn(usize) -> Option<f64>) {
        let field = |k: usize| field(k).filter(|v: &f64| v.is_finite());
        self.total += 1;
        match self.columns.sample(&field) {
            Some(values) => self.raw.push(line, &values),
            None => {
                self.bad += 1;
                self.first_bad.get_or_insert_with(|| (line, self.columns.culprit(&field, names)));
            }
        }
    }

    /// The log of what was taken.
    pub(super) fn finish(self, file: &str, arm: &Arm, findings: &mut Vec<Finding>) -> Result<Log, LogError> {
        let (bad, total) = (self.bad, self.total);
        if let Some((line, culprit)) = self.first_bad.filter(|_| bad > 0) {
            let finding = |message: String| Finding {
                file: file.to_string(),
                line: Some(line),
                quantity: culprit.clone(),
                message,
            };
            if bad as f64 > MOST_BAD_LINES * total as f64 {
                return Err(LogError(vec![finding(format!(
                    "{bad} of {total} lines hold no finite number in every needed column: record the log \
                        again or leave it out"
                ))]));
            }
            findings.push(finding(format!(
                "{bad} of {total} lines hold no finite number in every needed column (the first is this one) \
                    and were left out; short holes are filled by interpolation, long ones split the log"
            )));
        }
        check::into_log(self.raw, &self.columns.effort, file, arm, findings)
    }
}

/// What the effort columns hold.
pub(super) enum Effort {
    /// N·m or N.
    Torque,
    /// A, with N·m/A (N/A) by joint.
    Current(Vec<f64>),
}

pub(super) struct Columns {
    t: usize,
    q: Vec<usize>,
    effort_at: Vec<usize>,
    effort: Effort,
    temperature: Option<Vec<usize>>,
    /// dq, used for checks alone.
    dq: Option<Vec<usize>>,
}

impl Columns {
    pub(super) fn find(
        names: &[String],
        arm: &Arm,
        file: &str,
        findings: &mut Vec<Finding>,
    ) -> Result<Columns, LogError> {
        let n = arm.dof();
        let mut errors = Vec::new();
        let finding = |quantity: &str, message: String| Finding {
            file: file.to_string(),
            line: Some(1),
            quantity: quantity.to_string(),
            message,
        };
        let mut at: HashMap<&str, usize> = HashMap::new();
        for (index, name) in names.iter().enumerate() {
            if at.insert(name, index).is_some() {
                errors.push(finding(name, "the header names this column twice: remove one".into()));
            }
        }
        let group = |prefix: &str| -> (Vec<Option<usize>>, Vec<String>) {
            let found: Vec<Option<usize>> =
                (1..=n).map(|j| at.get(format!("{prefix}{j}").as_str()).copied()).collect();
            let missing =
                (1..=n).filter(|j| found[j - 1].is_none()).map(|j| format!("{prefix}{j}")).collect();
            (found, missing)
        };
        let all = |found: Vec<Option<usize>>| found.into_iter().collect::<Option<Vec<usize>>>();
        let t = at.get("t").copied();
        if t.is_none() {
            errors.push(finding("t", "the header has no column t (time in s)".into()));
        }
        let (q, q_missing) = group("q");
        if !q_missing.is_empty() {
            errors.push(finding("q", format!("the arm has {n} joints; missing: {}", q_missing.join(", "))));
        }
        let (tau, tau_missing) = group("tau");
        let (current, current_missing) = group("i");
        let (mut effort, mut effort_at) = (Effort::Torque, Vec::new());
        if let Some(tau) = all(tau) {
            effort_at = tau;
        } else if let Some(current) = all(current) {
            effort_at = current;
            let without: Vec<String> = (1..=n)
                .filter(|j| arm.joints[j - 1].torque_constant.is_none())
                .map(|j| j.to_string())
                .collect();
            if without.is_empty() {
                effort = Effort::Current(arm.joints.iter().filter_map(|j| j.torque_constant).collect());
            } else {
                errors.push(finding(
                    "i",
                    format!(
                        "the log holds currents, but the arm file gives no \
                    torque_constant (N·m/A at the joint) for joint {}: add it there, or log tau1 … \
                    tau{n}",
                        without.join(", ")
                    ),
                ));
            }
        } else {
            let missing =
                if tau_missing.len() <= current_missing.len() { tau_missing } else { current_missing };
            errors.push(finding(
                "tau",
                format!(
                    "a log needs tau1 … tau{n} [N·m] or i1 … i{n} [A] for each of \
                the {n} joints; missing: {}",
                    missing.join(", ")
                ),
            ));
        }
        if !errors.is_empty() {
            return Err(LogError(errors));
        }
        let (temperature, _) = group("temp");
        let (dq, _) = group("dq");
        let columns = Columns {
            t: t.unwrap_or(0),
            q: all(q).unwrap_or_default(),
            effort_at,
            effort,
            temperature: all(temperature),
            dq: all(dq),
        };
        let used: Vec<usize> = std::iter::once(columns.t)
            .chain(columns.q.iter().copied())
            .chain(columns.effort_at.iter().copied())
            .chain(columns.temperature.iter().flatten().copied())
            .chain(columns.dq.iter().flatten().copied())
            .collect();
        let out: Vec<&str> =
            (0..names.len()).filter(|k| !used.contains(k)).map(|k| names[k].as_str()).collect();
        if !out.is_empty() {
            findings.push(finding("columns", format!("kept out: {}", out.join(", "))));
        }
        Ok(columns)
    }

    /// t, q, effort, temperature, dq in a row; a temperature or dq that is no number does not spoil the
    /// sample.
    fn sample(&self, number: &impl Fn(usize) -> Option<f64>) -> Option<Vec<f64>> {
        let mut values = vec![number(self.t)?];
        for &k in self.q.iter().chain(&self.effort_at) {
            values.push(number(k)?);
        }
        for group in [&self.temperature, &self.dq] {
            for k in group.iter().flatten() {
                values.push(number(*k).unwrap_or(f64::NAN));
            }
        }
        Some(values)
    }

    /// The first needed column that holds no number.
    fn culprit(&self, number: &impl Fn(usize) -> Option<f64>, names: &[String]) -> String {
        std::iter::once(&self.t)
            .chain(&self.q)
            .chain(&self.effort_at)
            .find(|k| number(**k).is_none())
            .and_then(|k| names.get(*k).cloned())
            .unwrap_or_else(|| "line".into())
    }
}
