//! What an explanation of position servos gives.

use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_identification::servo::{ServoArm, rms};
use powerball_identification::usable;
use powerball_logs::log::ServoLog;
use serde::Serialize;

/// As JSON it is `explained.json` of an arm on position servos.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedServos {
    /// Why this result should not be used; empty where it can be.
    pub unusable: Vec<String>,
    /// The arm's name.
    pub arm: String,
    /// Position errors of the base.
    pub before: Both,
    /// With what was named.
    pub after: Both,
    /// Position error of the logged goal with its best delay on the validation logs, rms by joint, rad;
    /// `None` where the drive was always switched off.
    pub goal_error: Vec<Option<f64>>,
    /// What was named, in the order in which it was.
    pub effects: Vec<ServoEffect>,
    /// Each log, those to fit first.
    pub logs: Vec<LogResult>,
    /// How well each joint is predicted.
    pub verdict: Vec<ServoVerdict>,
    /// What is to be reported about the logs and the arm file.
    pub warnings: Vec<String>,
}

/// Something of the logs to fit and of those for validation.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Both {
    /// The logs to fit.
    pub fit: Positions,
    /// The validation logs.
    pub validate: Positions,
}

impl Both {
    /// Adds a joint.
    pub(super) fn add(&mut self, fit: &[Vec<f64>], validate: &[Vec<f64>]) {
        self.fit.position_error.push(rms(fit));
        self.validate.position_error.push(rms(validate));
    }
}

/// How far simulated positions are from measured ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Positions {
    /// rms by joint, rad.
    pub position_error: Vec<f64>,
}

/// What a model of a joint lacks.
#[derive(Clone, Debug, Serialize)]
pub struct ServoEffect {
    /// Its name.
    pub effect: &'static str,
    /// The joints that have it.
    pub joints: Vec<JointNumber>,
    /// The effect's parameters, in SI units.
    pub parameters: serde_json::Map<String, serde_json::Value>,
    /// Position error without it, rms by joint, rad: on the validation logs, or on the logs that have it.
    pub rms_before: Vec<f64>,
    /// With it.
    pub rms_after: Vec<f64>,
    /// The probability of this change of the error by chance.
    pub p_value: f64,
    /// 1 less the probability of chance: that the error changes, and not how often such a name is right.
    pub probability: f64,
    /// The logs that have it, where it is in some only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub logs: Vec<String>,
    /// The share of the squared error that stays.
    pub leftover: f64,
    /// Other names, and why they are not given.
    pub rivals: Vec<ServoRival>,
}

/// A name that was not given.
#[derive(Clone, Debug, Serialize)]
pub struct ServoRival {
    /// The name.
    pub effect: String,
    /// Why not.
    pub why_not: String,
}

/// A log next to the others.
#[derive(Clone, Debug, Serialize)]
pub struct LogResult {
    /// The file.
    pub log: String,
    /// Whether it is as the others are: it has nothing alone, named or not, and its `error_ratio` is at most
    /// [`Rule::unlike`].
    pub like_the_others: bool,
    /// The log's position error before anything was named, over the median one of the fitted logs; of the
    /// joint where it is largest.
    pub error_ratio: Option<f64>,
    /// What it has alone.
    pub differs: Vec<Differs>,
}

/// What a log has alone.
#[derive(Clone, Debug, Serialize)]
pub struct Differs {
    /// Its name.
    pub effect: &'static str,
    /// The joints that show it.
    pub joints: Vec<JointNumber>,
    /// From when, s.
    pub start_time: f64,
    /// Until when, s.
    pub end_time: f64,
    /// The share of the log's squared error that it explains.
    pub share: f64,
}

/// How well a joint is predicted on the validation logs.
#[derive(Clone, Debug, Serialize)]
pub struct ServoVerdict {
    /// The joint.
    pub joint: JointNumber,
    /// "predicted", "improved", "not predicted", or "not judged" where no validation log has the drive
    /// switched on.
    pub state: &'static str,
    /// The position error over that of the goal with its best delay; `None` where it is not judged.
    pub left: Option<f64>,
    /// What to do; empty where little is left.
    pub advice: String,
}

impl ExplainedServos {
    /// Nothing yet.
    pub(super) fn of(arm: &ServoArm, logs: &[ServoLog], validate: &[ServoLog]) -> ExplainedServos {
        let log = |log: &ServoLog| LogResult {
            log: log.file.clone(),
            like_the_others: true,
            error_ratio: None,
            differs: Vec::new(),
        };
        ExplainedServos {
            unusable: usable::servo_doubts(arm.body.arm(), logs.iter().chain(validate)),
            arm: arm.body.arm().name.clone(),
            before: Both::default(),
            after: Both::default(),
            goal_error: Vec::new(),
            effects: Vec::new(),
            logs: logs.iter().chain(validate).map(log).collect(),
            verdict: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// What follows from all joints.
    pub(super) fn conclude(&mut self, rule: &Rule) {
        for log in &mut self.logs {
            let is_usual = log.error_ratio.is_none_or(|ratio| ratio <= rule.unlike);
            log.like_the_others &= log.differs.is_empty() && is_usual;
        }
        for j in 0..self.goal_error.len() {
            let joint = JointNumber::from_index(j);
            let (before, after) =
                (self.before.validate.position_error[j], self.after.validate.position_error[j]);
            let left = self.goal_error[j].map(|goal_error| after / goal_error.max(f64::MIN_POSITIVE));
            let state = match left {
                None => "not judged",
                Some(left) if left <= rule.little => "predicted",
                Some(left) if after < before && left < 1.0 => "improved",
                Some(_) => "not predicted",
            };
            let advice = match state {
                "predicted" => String::new(),
                "not judged" => "give validation logs with the drive switched on".into(),
                _ => {
                    "record steps, a fast path and one where the drive is switched off, with two loads that \
                    are known"
                        .into()
                }
            };
            self.verdict.push(ServoVerdict { joint, state, left, advice });
            if left.is_some_and(|left| left >= 1.0) {
                self.unusable.push(format!(
                    "the position of joint {joint} is predicted no better than by its goal with a delay"
                ));
            }
        }
    }
}
