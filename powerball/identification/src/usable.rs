//! Conditions under which a result should not be used: a command prints them first and exits with code 3.
//!
//! A condition that only makes a result less exact is a warning. docs/exit_codes.md lists all conditions with
//! their sentences.

use super::conventions::Conventions;
use dyngen::Arm;
use powerball_controller::JointNumber;
use powerball_logs::log::{Doubt, Log, ServoLog};

/// The data that the conditions of a usable result need.
#[derive(Clone, Debug, Default)]
pub struct Findings<'a> {
    /// The result of the check of the columns.
    pub columns: Option<&'a Conventions>,
    /// Doubts from the logs and the arm file themselves, if the columns were not checked.
    pub doubts: Vec<String>,
    /// Joints that hardly move in the logs to fit.
    pub resting: Vec<JointNumber>,
    /// Joints that are predicted no better than by the mean of their torque.
    pub useless: Vec<JointNumber>,
    /// Whether a number of the result is not finite.
    pub not_finite: bool,
    /// The share of poses at which B(q) is not positive definite.
    pub indefinite: f64,
}

/// At more poses than this share no controller can divide by B(q).
const INDEFINITE: f64 = 0.5;

impl Findings<'_> {
    /// The reasons not to use the result, each a sentence without its full stop; empty where there is none.
    #[must_use]
    pub fn reasons(&self) -> Vec<String> {
        let mut reasons: Vec<String> = Vec::new();
        if let Some(wrong) = self.columns.filter(|columns| columns.differ()).map(Conventions::wrong) {
            reasons.push(format!(
                "the columns or the arm file are not what they are declared to be: {}",
                wrong.trim_end_matches('.')
            ));
        }
        reasons.extend(self.doubts.iter().cloned());
        if self.not_finite {
            reasons.push(
                "the fit has no finite solution: see the logs' largest numbers (powerball log)".to_string(),
            );
        }
        if !self.resting.is_empty() {
            reasons.push(format!(
                "joint {} does not move in the logs to fit: its friction is not known, and the parameters \
                    that its torque would show are set to 0 in the other joints; record paths on which it \
                    swings (powerball excite)",
                list(&self.resting)
            ));
        }
        if !self.useless.is_empty() {
            reasons.push(format!(
                "the torque of joint {} is predicted no better than by its mean",
                list(&self.useless)
            ));
        }
        if self.indefinite > INDEFINITE {
            reasons.push(format!(
                "the mass matrix B(q) of these values is not positive definite at {:.0} % of the poses: no \
                 real arm has them, and forward dynamics with them is useless; consistent.json has the \
                 nearest possible values",
                100.0 * self.indefinite
            ));
        }
        reasons
    }
}

/// Reasons in the logs and the arm themselves not to use them, each once: a sentence without its full stop.
pub(crate) fn doubts<'l>(arm: &Arm, logs: impl IntoIterator<Item = &'l Log>) -> Vec<String> {
    each_once(arm, logs.into_iter().flat_map(|log| &log.doubts))
}

/// The reasons that logs of position servos and their arm give themselves against being used, each once.
pub fn servo_doubts<'l>(arm: &Arm, logs: impl IntoIterator<Item = &'l ServoLog>) -> Vec<String> {
    each_once(arm, logs.into_iter().flat_map(|log| &log.doubts))
}

fn each_once<'l>(arm: &Arm, doubts: impl Iterator<Item = &'l Doubt>) -> Vec<String> {
    let mut all = arm.doubts();
    for doubt in doubts {
        let sentence = doubt.sentence.trim_end_matches('.').to_string();
        if !all.contains(&sentence) {
            all.push(sentence);
        }
    }
    all
}

fn list(joints: &[JointNumber]) -> String {
    joints.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_one_sentence_and_none_is_none() {
        assert!(Findings::default().reasons().is_empty());
        assert!(Findings { indefinite: 0.4, ..Findings::default() }.reasons().is_empty());
        let joint = |j: usize| vec![JointNumber::from_index(j)];
        let cases = [
            (
                Findings { resting: joint(3), ..Findings::default() },
                "joint 4 does not move in the logs to fit",
            ),
            (
                Findings { useless: joint(1), ..Findings::default() },
                "joint 2 is predicted no better than by its mean",
            ),
            (
                Findings { doubts: vec!["time runs 2 times too fast".into()], ..Findings::default() },
                "time runs",
            ),
            (Findings { not_finite: true, ..Findings::default() }, "no finite solution"),
            (
                Findings { indefinite: 1.0, ..Findings::default() },
                "not positive definite at 100 % of the poses",
            ),
        ];
        for (findings, part) in cases {
            let reasons = findings.reasons();
            assert!(
                matches!(reasons.as_slice(), [one] if one.contains(part) && !one.ends_with('.')),
                "{reasons:?}"
            );
        }
    }
}
