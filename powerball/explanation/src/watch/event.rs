//! The events of a watch: one for each change.

use crate::effects::words::{Words, number};
use dyngen::Arm;
use dyngen::arm::JointKind;
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
    /// The joints that changed (friction, a sensor's zero, a delay), else those on which the change shows.
    pub joints: Vec<JointNumber>,
    /// The event's size in SI units, as `parameters` of explained.json.
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
    /// The mean capital of the bets over the level of the alarm; at rest, the largest torque beyond the
    /// model's over its joint's limit.
    pub capital: f64,
    /// χ² that the name explains.
    pub explains: f64,
    /// The share of the error beyond the usual that stays with the name.
    pub left: f64,
    /// Other names that explain as much or nearly so.
    pub rivals: Vec<String>,
}

impl Event {
    /// A line for people; `arm` says which joints slide.
    #[must_use]
    pub fn sentence(&self, arm: &Arm) -> String {
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
        let first = self.joints.first().and_then(|joint| arm.joints.get(joint.index()));
        let slides = first.is_some_and(|joint| joint.kind == JointKind::Prismatic);
        for (name, value) in &self.value {
            let _ = write!(text, ", {} {}", name.replace('_', " "), shown(name, value, slides));
        }
        if !self.evidence.rivals.is_empty() {
            let _ = write!(text, "; or {}", self.evidence.rivals.join(" or "));
        }
        text
    }
}

/// A size with its unit; that of a position is by whether its joint slides.
fn shown(name: &str, value: &Value, slides: bool) -> String {
    let (factor, unit) = match name {
        "mass" => (1.0, "kg"),
        "com" => (1.0, "m"),
        "force" => (1.0, "N"),
        "delay" | "end_time" => (1.0, "s"),
        "offset" => (1.0, Words { slides, relative_std: &[] }.position()),
        "change" => (100.0, "%"),
        _ => (1.0, ""),
    };
    let one = |value: &Value| match value {
        Value::Number(whole) if whole.is_u64() => whole.to_string(),
        Value::Number(x) => x.as_f64().map_or_else(String::new, |x| number(factor * x)),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let gap = if unit.is_empty() { "" } else { " " };
    match value {
        Value::Array(list) => format!("({}){gap}{unit}", list.iter().map(one).collect::<Vec<_>>().join(", ")),
        single => format!("{}{gap}{unit}", one(single)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn sizes_have_units_and_links_are_whole() {
        for (name, value, text) in [
            ("mass", json!(0.503), "0.503 kg"),
            ("offset", json!(0.02), "0.0200 rad"),
            ("force", json!([1.0, -2.5, 0.0]), "(1.00, −2.50, 0) N"),
            ("link", json!(6), "6"),
            ("change", json!([-0.2, 0.1]), "(−20.0, 10.0) %"),
            ("friction", json!("warmer"), "warmer"),
        ] {
            assert_eq!(shown(name, &value, false), text);
        }
        assert_eq!(shown("offset", &json!(0.02), true), "0.0200 m");
    }
}
