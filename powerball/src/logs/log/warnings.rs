//! Where the checks put what they find.

use super::Finding;

/// What a finding means for the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Severity {
    /// Its user should know.
    Warning,
    /// It cannot be used.
    Unusable,
}

/// Findings about one log, each with the line and the time of its sample.
pub(super) struct Warnings<'a> {
    pub file: &'a str,
    pub line: &'a [usize],
    pub t: &'a [f64],
    pub findings: &'a mut Vec<Finding>,
    pub errors: &'a mut Vec<Finding>,
}

impl Warnings<'_> {
    /// Adds a finding; `sample` is the one that it begins at, where it is not about the whole log.
    pub(super) fn add(
        &mut self,
        sample: Option<usize>,
        quantity: String,
        message: String,
        severity: Severity,
    ) {
        let when = sample.and_then(|k| self.t.get(k)).map_or(String::new(), |t| format!("at {t:.3} s: "));
        let finding = Finding {
            file: self.file.to_string(),
            line: sample.and_then(|k| self.line.get(k).copied()),
            quantity,
            message: format!("{when}{message}"),
        };
        match severity {
            Severity::Warning => self.findings.push(finding),
            Severity::Unusable => self.errors.push(finding),
        }
    }
}
