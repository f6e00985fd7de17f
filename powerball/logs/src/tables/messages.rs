//! Messages of a bag as rows of tables, one table a topic.

use super::cdr::Cdr;
use super::memory::Memory;
#[cfg(feature = "protobuf")]
use super::protobuf;
use super::schema::{Bits, MOST, NAMES, Schema};
use super::table::{Row, Table};
use super::text;
use serde_json::Value;

/// How the messages of a topic are read.
#[derive(Debug)]
enum Reader {
    JointState,
    DynamicJointState,
    /// Messages that are read by the definition in the file.
    Defined(Schema),
    #[cfg(feature = "protobuf")]
    Protobuf(protobuf::Schema),
    /// Protobuf in a build without it.
    #[cfg(not(feature = "protobuf"))]
    NotBuilt,
    Json,
    /// Counted, not read.
    Other,
}

/// The topics of a bag with their messages.
#[derive(Debug)]
pub(super) struct Topics {
    topics: Vec<Topic>,
    /// The names of the topics that are read, where not all are.
    only: Option<Vec<String>>,
    /// Whether each message is compressed, by Zstandard.
    pub(super) compressed: bool,
    memory: Memory,
}

#[derive(Debug)]
struct Topic {
    /// Publishers of one topic may have numbers of their own.
    ids: Vec<i64>,
    reader: Reader,
    ros1: bool,
    table: Table,
    /// The approximate number of messages; 0 if it is unknown.
    expected: usize,
}

/// What a file states about the type of messages: its name, the language of its definition, and the
/// definition.
pub(super) type Type<'a> = (&'a str, &'a str, &'a [u8]);

impl Reader {
    fn of((kind, language, definition): Type<'_>, encoding: &str) -> Reader {
        let by_definition = || {
            let text =
                std::str::from_utf8(definition).ok().filter(|_| matches!(language, "ros2msg" | "ros1msg"));
            Schema::parse(kind, text?).filter(Schema::has_quantities)
        };
        match (kind.replace("/msg/", "/").as_str(), encoding) {
            ("sensor_msgs/JointState", "cdr" | "ros1") => Reader::JointState,
            ("control_msgs/DynamicJointState", "cdr" | "ros1") => Reader::DynamicJointState,
            (_, "cdr" | "ros1") => by_definition().map_or(Reader::Other, Reader::Defined),
            #[cfg(feature = "protobuf")]
            (_, "protobuf") => {
                protobuf::Schema::parse(kind, definition).map_or(Reader::Other, Reader::Protobuf)
            }
            #[cfg(not(feature = "protobuf"))]
            (_, "protobuf") => Reader::NotBuilt,
            (_, "json") => Reader::Json,
            _ => Reader::Other,
        }
    }
}

impl Topics {
    /// Topics of which those with some names are read, the others counted.
    pub(super) fn of(only: Option<&[String]>) -> Topics {
        let only = only.map(<[String]>::to_vec);
        Topics { topics: Vec::new(), only, compressed: false, memory: Memory::of_a_log() }
    }

    /// Makes a topic known: `encoding` is how the bytes of its messages are made.
    pub(super) fn add(&mut self, id: i64, name: &str, of: Type<'_>, encoding: &str) {
        if self.knows(id) {
            return;
        }
        let (kind, ros1) = (of.0, encoding == "ros1");
        let shown = if kind.is_empty() { encoding } else { kind };
        let same = |t: &&mut Topic| t.table.name == name && t.table.kind == shown && t.ros1 == ros1;
        if let Some(topic) = self.topics.iter_mut().find(same) {
            topic.ids.push(id);
            return;
        }
        let left_aside = self.only.as_ref().is_some_and(|only| !only.iter().any(|own| own == name));
        let reader = if left_aside { Reader::Other } else { Reader::of(of, encoding) };
        self.topics.push(Topic { ids: vec![id], reader, ros1, table: Table::new(name, shown), expected: 0 });
    }

    /// Begins another file of the same recording: its numbers of topics are its own.
    pub(super) fn next_file(&mut self) {
        self.topics.iter_mut().for_each(|topic| topic.ids.clear());
    }

    /// Whether a topic was made known.
    pub(super) fn knows(&self, id: i64) -> bool {
        self.topics.iter().any(|t| t.ids.contains(&id))
    }

    /// Whether the messages of a topic are read: the bytes of others need not be fetched.
    #[cfg(feature = "mcap")]
    pub(super) fn reads(&self, id: i64) -> bool {
        self.topics.iter().any(|t| t.ids.contains(&id) && !matches!(t.reader, Reader::Other))
    }

    /// Says about how many messages of a topic follow.
    #[cfg(feature = "mcap")]
    pub(super) fn expect(&mut self, id: i64, messages: usize) {
        if let Some(topic) = self.topics.iter_mut().find(|t| t.ids.contains(&id)) {
            topic.expected += messages;
        }
    }

    /// Whether messages of other topics need not be counted.
    #[cfg(feature = "mcap")]
    pub(super) fn counts_no_others(&self) -> bool {
        self.only.is_some()
    }

    /// The numbers of the topics that are read.
    #[cfg(feature = "rosbag")]
    pub(super) fn ids_read(&self) -> impl Iterator<Item = i64> {
        let read = self.topics.iter().filter(|t| !matches!(t.reader, Reader::Other));
        read.flat_map(|t| t.ids.iter().copied())
    }

    /// Takes a message in; `received` in nanoseconds.
    pub(super) fn take(&mut self, id: i64, received: i64, message: &[u8]) {
        let Some(topic) = self.topics.iter_mut().find(|t| t.ids.contains(&id)) else { return };
        let before = topic.table.numbers();
        if self.memory.is_spent() {
            return;
        }
        let mut row = topic.table.begin_row(1e-9 * received as f64, topic.expected);
        let unpacked = match self.compressed && !matches!(topic.reader, Reader::Other) {
            true => match zstd::decode_all(message) {
                Ok(unpacked) => Some(unpacked),
                Err(e) => return row.end(Err(format!("cannot be unpacked: {e}"))),
            },
            false => None,
        };
        let message = unpacked.as_deref().unwrap_or(message);
        let ros1 = topic.ros1;
        let cdr = || if ros1 { Ok(Cdr::ros1(message)) } else { Cdr::ros2(message) };
        let done = match &topic.reader {
            Reader::JointState => cdr().and_then(|message| joint_state(message, &mut row)),
            Reader::DynamicJointState => cdr().and_then(|message| dynamic_joint_state(message, &mut row)),
            Reader::Defined(schema) => cdr().and_then(|mut message| schema.read(&mut message, &mut row)),
            #[cfg(feature = "protobuf")]
            Reader::Protobuf(schema) => schema.read(message, &mut row),
            #[cfg(not(feature = "protobuf"))]
            Reader::NotBuilt => Err(super::NOT_READ.into()),
            Reader::Json => json(message, &mut row),
            Reader::Other => Ok(None),
        };
        row.end(done);
        // A missing part is reported when the tables are requested.
        let _ = self.memory.claim_numbers(topic.table.numbers().saturating_sub(before));
    }

    /// Claims memory for the bytes of a chunk next to the tables.
    ///
    /// # Errors
    /// The reason why there is not enough.
    #[cfg(any(feature = "mcap", feature = "bag1"))]
    pub(super) fn holds(&self, bytes: u64) -> Result<(), String> {
        self.memory.holds(bytes)
    }

    /// The tables, one for each topic.
    ///
    /// # Errors
    /// If there was not enough memory for one of them.
    pub(super) fn tables(self) -> std::io::Result<Vec<Table>> {
        self.memory.done()?;
        let filled = |Topic { mut table, .. }| {
            table.fill();
            table
        };
        Ok(self.topics.into_iter().map(filled).collect())
    }
}

/// The time stamp of a message, s, where it has one; else why it cannot be read.
type Stamp = Result<Option<f64>, String>;

/// `sensor_msgs/JointState`: position, velocity and effort, each empty or one a name.
fn joint_state(mut message: Cdr<'_>, row: &mut Row<'_>) -> Stamp {
    let end = message.begin_message()?;
    let stamp = Some(message.header()?);
    let names = message.strings()?;
    for quantity in ["position", "velocity", "effort"] {
        let count = message.count()?;
        if count != 0 && count != names.len() {
            return Err(format!("has {count} values of {quantity} for {} joints", names.len()));
        }
        for name in names.iter().take(count) {
            row.put(&[quantity, ".", name], message.number(8, Bits::Float)?);
        }
    }
    message.end_message(end)?;
    Ok(stamp)
}

/// `control_msgs/DynamicJointState`: by joint, values with a name each.
fn dynamic_joint_state(mut message: Cdr<'_>, row: &mut Row<'_>) -> Stamp {
    let end = message.begin_message()?;
    let stamp = Some(message.header()?);
    let joints = message.strings()?;
    message.begin_list()?;
    let interfaces = message.list(|m| {
        let end = m.begin_message()?;
        let names = m.strings()?;
        let numbers = m.list(|m| m.number(8, Bits::Float))?;
        m.end_message(end)?;
        Ok((names, numbers))
    })?;
    for (joint, (names, numbers)) in joints.iter().zip(interfaces) {
        names.iter().zip(numbers).for_each(|(name, value)| row.put(&[name, ".", joint], value));
    }
    message.end_message(end)?;
    Ok(stamp)
}

/// A JSON object: its numbers, by their path. The elements of an array are counted from 1: `q` of three
/// values is `q1`, `q2`, `q3`. A `name` array next to arrays of as many values names them, as in a
/// JointState, and objects of an array that each have a name are named by these, as in
/// `foxglove.JointStates`.
fn json(message: &[u8], row: &mut Row<'_>) -> Stamp {
    let message: Value = serde_json::from_slice(message).map_err(|e| format!("is no JSON: {e}"))?;
    let Value::Object(fields) = &message else { return Err("is not a JSON object".into()) };
    let stamp = message.pointer("/header/stamp").or(message.get("timestamp"));
    let nanoseconds = |s: &Value| s.get("nanosec").or(s.get("nsec")).and_then(Value::as_f64);
    let parts = |s: &Value| Some(s.get("sec")?.as_f64()? + 1e-9 * nanoseconds(s)?);
    let stamp = stamp.and_then(|s| s.as_str().map_or_else(|| parts(s), text::number));
    let names = NAMES.iter().find_map(|name| message.get(name)).and_then(Value::as_array);
    let names: Option<Vec<&str>> = names.and_then(|n| n.iter().map(Value::as_str).collect());
    for (key, value) in fields.iter().filter(|(key, _)| *key != "header" && *key != "timestamp") {
        match (&names, value) {
            (Some(names), Value::Array(of)) if of.len() == names.len() => {
                let named = names.iter().zip(of).filter_map(|(n, v)| Some((n, v.as_f64()?)));
                named.for_each(|(name, value)| row.put(&[key, ".", name], value));
            }
            _ => flatten(key, value, row),
        }
    }
    if stamp.is_none() {
        let time = message.get("timestamp").and_then(Value::as_f64);
        time.into_iter().for_each(|t| row.put(&["timestamp"], t));
    }
    Ok(stamp)
}

/// The name that an object has.
fn name_of(object: &Value) -> Option<&str> {
    NAMES.iter().find_map(|name| object.get(name)?.as_str())
}

fn flatten(path: &str, value: &Value, row: &mut Row<'_>) {
    match value {
        Value::Number(number) => number.as_f64().into_iter().for_each(|v| row.put(&[path], v)),
        Value::Bool(value) => row.put(&[path], f64::from(u8::from(*value))),
        Value::Array(list) if list.len() > MOST => {}
        Value::Array(list) if list.iter().all(|own| name_of(own).is_some()) => {
            let above = path.rsplit_once('.').map_or(String::new(), |(above, _)| format!("{above}."));
            for (own, name) in list.iter().filter_map(|own| Some((own.as_object()?, name_of(own)?))) {
                own.iter().for_each(|(key, v)| flatten(&format!("{above}{key}.{name}"), v, row));
            }
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(k, v)| flatten(&format!("{path}{}", k + 1), v, row));
        }
        Value::Object(fields) => {
            fields.iter().for_each(|(key, v)| flatten(&format!("{path}.{key}"), v, row));
        }
        _ => {}
    }
}
