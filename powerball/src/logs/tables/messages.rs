//! Messages of a bag as rows of tables, one table a topic.

use super::cdr::Cdr;
use super::table::Table;
use serde_json::Value;

/// Values of one array of a JSON message beyond this are no joints.
const MOST: usize = 64;

/// How the messages of a topic are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    JointState,
    DynamicJointState,
    Json,
    /// Counted, not read.
    Other,
}

/// The topics of a bag with their messages.
#[derive(Debug, Default)]
pub(super) struct Topics {
    topics: Vec<Topic>,
    /// The names of the topics that are read, where not all are.
    only: Option<Vec<String>>,
}

#[derive(Debug)]
struct Topic {
    /// Publishers of one topic may have numbers of their own.
    ids: Vec<i64>,
    kind: Kind,
    ros1: bool,
    table: Table,
}

/// What a file says of the type of messages: its name, the language of its definition, and the definition.
pub(super) type Type<'a> = (&'a str, &'a str, &'a [u8]);

impl Topics {
    /// Topics of which those with some names are read, the others counted.
    pub(super) fn of(only: Option<&[String]>) -> Topics {
        Topics { topics: Vec::new(), only: only.map(<[String]>::to_vec) }
    }

    /// Makes a topic known: `kind` is the type of its messages, `encoding` how their bytes are made.
    pub(super) fn add(&mut self, id: i64, name: &str, (kind, _, _): Type<'_>, encoding: &str) {
        if self.knows(id) {
            return;
        }
        let left_aside = self.only.as_ref().is_some_and(|only| !only.iter().any(|own| own == name));
        let read = match (kind.replace("/msg/", "/").as_str(), encoding) {
            _ if left_aside => Kind::Other,
            ("sensor_msgs/JointState", "cdr" | "ros1") => Kind::JointState,
            ("control_msgs/DynamicJointState", "cdr" | "ros1") => Kind::DynamicJointState,
            (_, "json") => Kind::Json,
            _ => Kind::Other,
        };
        let shown = if kind.is_empty() { encoding } else { kind };
        let ros1 = encoding == "ros1";
        let same = |t: &&mut Topic| t.table.name == name && t.table.kind == shown && t.ros1 == ros1;
        match self.topics.iter_mut().find(same) {
            Some(topic) => topic.ids.push(id),
            None => {
                self.topics.push(Topic { ids: vec![id], kind: read, ros1, table: Table::new(name, shown) })
            }
        }
    }

    /// Whether a topic was made known.
    pub(super) fn knows(&self, id: i64) -> bool {
        self.topics.iter().any(|t| t.ids.contains(&id))
    }

    /// Whether the messages of a topic are read: the bytes of others need not be fetched.
    pub(super) fn reads(&self, id: i64) -> bool {
        self.topics.iter().any(|t| t.ids.contains(&id) && t.kind != Kind::Other)
    }

    /// Takes a message in; `received` in nanoseconds.
    pub(super) fn take(&mut self, id: i64, received: i64, message: &[u8]) {
        let Some(topic) = self.topics.iter_mut().find(|t| t.ids.contains(&id)) else { return };
        let cdr = || if topic.ros1 { Ok(Cdr::ros1(message)) } else { Cdr::ros2(message) };
        let values = match topic.kind {
            Kind::JointState => cdr().and_then(joint_state),
            Kind::DynamicJointState => cdr().and_then(dynamic_joint_state),
            Kind::Json => json(message),
            Kind::Other => Ok((None, Vec::new())),
        };
        let received = 1e-9 * received as f64;
        match values {
            Ok((stamp, values)) => topic.table.push(received, stamp, &values),
            Err(reason) => {
                // It keeps its number.
                topic.table.push(received, None, &[]);
                topic.table.unreadable.get_or_insert((0, reason)).0 += 1;
            }
        }
    }

    /// One table a topic.
    pub(super) fn tables(self) -> Vec<Table> {
        let filled = |Topic { mut table, .. }| {
            table.fill();
            table
        };
        self.topics.into_iter().map(filled).collect()
    }
}

type Values = (Option<f64>, Vec<(String, f64)>);

/// `sensor_msgs/JointState`: position, velocity and effort, each empty or one a name.
fn joint_state(mut message: Cdr<'_>) -> Result<Values, String> {
    let stamp = Some(message.header()?);
    let names = message.strings()?;
    let mut values = Vec::new();
    for quantity in ["position", "velocity", "effort"] {
        let numbers = message.numbers()?;
        if !numbers.is_empty() && numbers.len() != names.len() {
            return Err(format!("has {} values of {quantity} for {} joints", numbers.len(), names.len()));
        }
        let named = |(name, value): (&String, f64)| (format!("{quantity}.{name}"), value);
        values.extend(names.iter().zip(numbers).map(named));
    }
    Ok((stamp, values))
}

/// `control_msgs/DynamicJointState`: by joint, values with a name each.
fn dynamic_joint_state(mut message: Cdr<'_>) -> Result<Values, String> {
    let stamp = Some(message.header()?);
    let joints = message.strings()?;
    let interfaces = message.list(|m| Ok((m.strings()?, m.numbers()?)))?;
    let mut values = Vec::new();
    for (joint, (names, numbers)) in joints.iter().zip(interfaces) {
        values.extend(names.iter().zip(numbers).map(|(name, value)| (format!("{name}.{joint}"), value)));
    }
    Ok((stamp, values))
}

/// A JSON object: its numbers, by their path. The elements of an array are counted from 1: `q` of three
/// values is `q1`, `q2`, `q3`. A `name` array beside arrays of as many values names them, as in a JointState.
fn json(message: &[u8]) -> Result<Values, String> {
    let message: Value = serde_json::from_slice(message).map_err(|e| format!("is no JSON: {e}"))?;
    let Value::Object(fields) = &message else { return Err("is no JSON object".into()) };
    let stamp = message.pointer("/header/stamp").or(message.get("timestamp"));
    let nanoseconds = |s: &Value| s.get("nanosec").or(s.get("nsec")).and_then(Value::as_f64);
    let stamp = stamp.and_then(|s| Some(s.get("sec")?.as_f64()? + 1e-9 * nanoseconds(s)?));
    let names: Option<Vec<&str>> =
        message.get("name").and_then(Value::as_array).and_then(|n| n.iter().map(Value::as_str).collect());
    let mut values = Vec::new();
    for (key, value) in fields.iter().filter(|(key, _)| *key != "header" && *key != "timestamp") {
        match (&names, value) {
            (Some(names), Value::Array(of)) if of.len() == names.len() => {
                let named =
                    names.iter().zip(of).filter_map(|(n, v)| Some((format!("{key}.{n}"), v.as_f64()?)));
                values.extend(named);
            }
            _ => flatten(key, value, &mut values),
        }
    }
    if stamp.is_none() {
        values.extend(message.get("timestamp").and_then(Value::as_f64).map(|t| ("timestamp".into(), t)));
    }
    Ok((stamp, values))
}

fn flatten(path: &str, value: &Value, values: &mut Vec<(String, f64)>) {
    match value {
        Value::Number(number) => values.extend(number.as_f64().map(|v| (path.to_string(), v))),
        Value::Bool(value) => values.push((path.to_string(), f64::from(u8::from(*value)))),
        Value::Array(list) if list.len() <= MOST => {
            list.iter().enumerate().for_each(|(k, v)| flatten(&format!("{path}{}", k + 1), v, values));
        }
        Value::Object(fields) => {
            fields.iter().for_each(|(key, v)| flatten(&format!("{path}.{key}"), v, values));
        }
        _ => {}
    }
}
