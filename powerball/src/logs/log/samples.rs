//! The samples of a log while it is read, by whatever reader.

use super::check;
use super::columns::Columns;
use super::raw::Raw;
use super::{Finding, Log, LogError};
use dyngen::Arm;

/// More samples without a number than this share make a log unusable.
const MOST_BAD_LINES: f64 = 0.2;

/// The samples of a log while it is read, and how many of its lines are none.
pub(super) struct Samples {
    columns: Columns,
    /// What a sample is called: "line" or "sample".
    called: &'static str,
    raw: Raw,
    pub(super) total: usize,
    pub(super) bad: usize,
    first_bad: Option<(usize, String)>,
}

impl Samples {
    pub(super) fn new(columns: Columns, arm: &Arm, called: &'static str) -> Samples {
        let raw = Raw::new(arm.dof(), columns.temperature.is_some());
        Samples { columns, called, raw, total: 0, bad: 0, first_bad: None }
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
            findings.push(finding(format!(
                "{bad} of {total} {called}s hold no finite number in every needed column (the first is this \
                    one) and were left out; short holes are filled by interpolation, long ones split the log"
            )));
        }
        check::into_log(self.raw, &self.columns.effort, file, arm, findings)
    }
}
