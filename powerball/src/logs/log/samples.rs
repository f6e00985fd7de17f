//! The samples of a log while it is read, by whatever reader.

use super::check;
use super::columns::{Asked, Columns};
use super::raw::{Effort, Raw};
use super::{Finding, Log, LogError};
use crate::logs::tables::Rows;

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
}

impl<'a> Samples<'a> {
    pub(super) fn new(asked: Asked<'a>, called: &'static str, findings: &'a mut Vec<Finding>) -> Samples<'a> {
        Samples { asked, findings, called, names: Vec::new(), found: None, total: 0, bad: 0, first_bad: None }
    }

    /// The log of what was taken; `torn` where the last line is.
    pub(super) fn finish(mut self, torn: bool) -> Result<Log, LogError> {
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
        let Some((columns, raw)) = self.found else {
            return Err(LogError::of_file(file, "samples", "there are none"));
        };
        let log = check::into_log(raw, &columns.effort, file, self.asked.arm, self.findings)?;
        Ok(log.shifted(match columns.effort {
            Effort::Torque => &self.asked.map.tau,
            Effort::Current(_) => &self.asked.map.i,
        }))
    }
}

impl Rows for Samples<'_> {
    fn begin(&mut self, names: &[String]) -> Result<(), LogError> {
        let columns = Columns::find(names, self.asked, self.findings)?;
        let raw = Raw::new(self.asked.arm.dof(), columns.temperature.is_some(), columns.motor.is_some());
        self.found = Some((columns, raw));
        self.names = names.to_vec();
        Ok(())
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
            Some(values) => raw.push(line, &values),
            None => {
                self.bad += 1;
                let names = &self.names;
                self.first_bad.get_or_insert_with(|| (line, columns.culprit(&field, names)));
            }
        }
    }
}
