//! A log's quantities found by the names of its columns.

use super::raw::Effort;
use super::{Finding, LogError};
use dyngen::Arm;
use std::collections::HashMap;

/// Where a log's quantities stand among its columns.
pub(super) struct Columns {
    t: usize,
    q: Vec<usize>,
    effort_at: Vec<usize>,
    pub(super) effort: Effort,
    pub(super) temperature: Option<Vec<usize>>,
    /// dq, used for checks alone.
    dq: Option<Vec<usize>>,
}

impl Columns {
    /// Finds them by their names; columns that are not needed are named in `findings`.
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
    pub(super) fn sample(&self, number: &impl Fn(usize) -> Option<f64>) -> Option<Vec<f64>> {
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
    pub(super) fn culprit(&self, number: &impl Fn(usize) -> Option<f64>, names: &[String]) -> String {
        std::iter::once(&self.t)
            .chain(&self.q)
            .chain(&self.effort_at)
            .find(|k| number(**k).is_none())
            .and_then(|k| names.get(*k).cloned())
            .unwrap_or_else(|| "line".into())
    }
}
