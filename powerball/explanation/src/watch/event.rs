//! What a watch says: one event for each change.

use powerball_controller::JointNumber;
use serde::Serialize;
use serde_json::{Map, Value};
use std::fmt::Write as _;

/// A change after which the model no longer holds, or a passing one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// When the alarm rose: the last sample that had been seen by then, s in the log's own t.
    pub time: f64,
    /// An effect's name, or "unknown".
    pub what: String,
    /// The joints on which it shows.
    pub joints: Vec<JointNumber>,
    /// Its size in SI units, as `parameters` of explained.json.
    pub value: Map<String, Value>,
    /// When it began, s in the log's own t.
    pub since: f64,
    /// Why.
    pub evidence: Evidence,
}

/// Why an event is one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// The log.
    pub log: String,
    /// Whether an earlier event ends here.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub ends: bool,
    /// The joint on which the alarm rose.
    pub alarm_joint: JointNumber,
    /// The mean capital of the bets over the level of the alarm.
    pub capital: f64,
    /// χ² that the name explains.
    pub explains: f64,
    /// The share of what the model errs more than usual that stays with the name.
    pub left: f64,
    /// Other names that explain as much or nearly so.
    pub rivals: Vec<String>,
}

impl Event {
    /// A line for people.
    #[must_use]
    pub fn sentence(&self) -> String {
        let joints: Vec<String> = self.joints.iter().map(ToString::to_string).collect();
        let plural = if joints.len() == 1 { "" } else { "s" };
        let verb = if self.evidence.ends { " ends" } else { "" };
        let mut text = format!(
            "{} {:.2} s: {}{verb} on joint{plural} {} since {:.2} s",
            self.evidence.log,
            self.time,
            self.what,
            joints.join(", "),
            self.since
        );
        for (name, value) in &self.value {
            let _ = write!(text, ", {name} {}", shown(value));
        }
        if !self.evidence.rivals.is_empty() {
            let _ = write!(text, "; or {}", self.evidence.rivals.join(" or "));
        }
        text
    }
}

fn shown(value: &Value) -> String {
    match value {
        Value::Number(number) => number.as_f64().map_or_else(String::new, |x| format!("{x:.4}")),
        Value::Array(list) => format!("({})", list.iter().map(shown).collect::<Vec<_>>().join(", ")),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
