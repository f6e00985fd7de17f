//! Recordings as MCAP, which rosbag2 plays and Foxglove and rerun open: joint states in ROS's message, all
//! else as JSON.

use super::cdr::CdrWriter;
use ::mcap::records::MessageHeader;
use ::mcap::write::NoSeek;
use ::mcap::{Compression, McapError, WriteOptions, Writer};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Read, Write};

/// `sensor_msgs/JointState` with the types that it consists of, as ROS 2 writes definitions into bags.
const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
    float64[] effort\n\
    ================================================================================\n\
    MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================================================================================\n\
    MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// A channel of a file that is being written.
#[derive(Clone, Copy, Debug)]
pub struct Channel(u16);

/// Writes a file, message by message, in chunks compressed with Zstandard, with checksums, an index and
/// statistics.
pub struct McapWriter<W: Write> {
    inner: Writer<NoSeek<W>>,
    messages: u32,
}

impl<W: Write> fmt::Debug for McapWriter<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("McapWriter").field("messages", &self.messages).finish_non_exhaustive()
    }
}

/// One message of `sensor_msgs/JointState`: each list empty or one value a name.
#[derive(Clone, Copy, Debug, Default)]
pub struct JointState<'a> {
    /// rad or m.
    pub position: &'a [f64],
    /// rad/s or m/s.
    pub velocity: &'a [f64],
    /// N·m or N.
    pub effort: &'a [f64],
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// What the file system says, here and below.
    pub fn new(out: W) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library("powerball")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            // A pipe will do: a chunk is complete before it is written.
            .disable_seeking(true);
        let inner = options.create(NoSeek::new(out)).map_err(failed)?;
        Ok(McapWriter { inner, messages: 0 })
    }

    /// A topic of joint states.
    ///
    /// # Errors
    /// Those of [`McapWriter::new`].
    pub fn joint_states(&mut self, topic: &str) -> io::Result<Channel> {
        self.channel(topic, "sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE, "cdr")
    }

    /// A topic of JSON objects whose members are numbers.
    ///
    /// # Errors
    /// Those of [`McapWriter::new`].
    pub fn numbers(&mut self, topic: &str, kind: &str, members: &[&str]) -> io::Result<Channel> {
        let number = |name: &&str| (name.to_string(), serde_json::json!({ "type": "number" }));
        let properties: Map<String, Value> = members.iter().map(number).collect();
        let schema = serde_json::json!({ "type": "object", "properties": properties });
        self.channel(topic, kind, "jsonschema", &schema.to_string(), "json")
    }

    fn channel(
        &mut self,
        topic: &str,
        kind: &str,
        language: &str,
        definition: &str,
        encoding: &str,
    ) -> io::Result<Channel> {
        let schema = self.inner.add_schema(kind, language, definition.as_bytes()).map_err(failed)?;
        let channel = self.inner.add_channel(schema, topic, encoding, &BTreeMap::new());
        channel.map(Channel).map_err(failed)
    }

    /// A message of joint states at a time, s.
    ///
    /// # Errors
    /// Those of [`McapWriter::new`].
    pub fn state(
        &mut self,
        channel: Channel,
        t: f64,
        names: &[String],
        state: &JointState<'_>,
    ) -> io::Result<()> {
        let mut message = CdrWriter::header(t);
        message.strings(names);
        [state.position, state.velocity, state.effort].iter().for_each(|values| message.numbers(values));
        self.message(channel, t, &message.done())
    }

    /// A message of numbers at a time, s.
    ///
    /// # Errors
    /// Those of [`McapWriter::new`].
    pub fn object<'n>(
        &mut self,
        channel: Channel,
        t: f64,
        members: impl IntoIterator<Item = (&'n str, f64)>,
    ) -> io::Result<()> {
        let object: Map<String, Value> =
            members.into_iter().map(|(name, v)| (name.to_string(), v.into())).collect();
        self.message(channel, t, Value::Object(object).to_string().as_bytes())
    }

    fn message(&mut self, Channel(channel_id): Channel, t: f64, data: &[u8]) -> io::Result<()> {
        let nanoseconds = (1e9 * t).round().max(0.0) as u64;
        self.messages = self.messages.wrapping_add(1);
        let (sequence, log_time, publish_time) = (self.messages, nanoseconds, nanoseconds);
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        self.inner.write_to_known_channel(&header, data).map_err(failed)
    }

    /// Ends the file: its last chunk, its index and its statistics.
    ///
    /// # Errors
    /// Those of [`McapWriter::new`].
    pub fn finish(mut self) -> io::Result<W> {
        self.inner.finish().map_err(failed)?;
        let mut out = self.inner.into_inner().into_inner();
        out.flush()?;
        Ok(out)
    }
}

fn failed(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// The result of writing lines of CSV as MCAP.
pub(crate) struct Written {
    pub(crate) rows: usize,
    /// The joints' names in the file.
    pub(crate) joints: Vec<String>,
    pub(crate) velocities: bool,
}

/// CSV lines of numbers as MCAP: `q`, `dq` and `tau` of joints 1 to n are `/joint_states`, other columns
/// `/log`. Lines that are torn or hold anything else are left out. A time that begins
/// below 0 is moved there. The joints have the names given, `joint1` and so on where they are not as many.
pub(crate) fn from_csv(csv: impl Read, joints: &[String], out: impl Write) -> io::Result<Written> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(csv);
    let names: Vec<String> = reader.headers()?.iter().map(str::to_string).collect();
    let at = |name: &str| names.iter().position(|own| own == name);
    let time = at("t").ok_or_else(|| io::Error::other("the lines have no column t"))?;
    let by_joint = |stem: &str| -> Vec<usize> { (1..).map_while(|j| at(&format!("{stem}{j}"))).collect() };
    let [q, dq, tau] = ["q", "dq", "tau"].map(by_joint);
    let dof = q.len().max(tau.len());
    let joints: Vec<String> = match joints.len() == dof {
        true => joints.to_vec(),
        false => (1..=dof).map(|j| format!("joint{j}")).collect(),
    };
    let whole = |at: Vec<usize>| if at.len() == joints.len() { at } else { Vec::new() };
    let [q, dq, tau] = [q, dq, tau].map(whole);
    let used = |k: &usize| *k == time || [&q, &dq, &tau].iter().any(|group| group.contains(k));
    let others: Vec<usize> = (0..names.len()).filter(|k| !used(k)).collect();
    let mut writer = McapWriter::new(out)?;
    let states = writer.joint_states("/joint_states")?;
    let rest: Vec<&str> = others.iter().map(|k| names[*k].as_str()).collect();
    let log = if rest.is_empty() { None } else { Some(writer.numbers("/log", "Log", &rest)?) };
    let mut rows = 0;
    for record in reader.records() {
        let Ok(record) = record else { continue };
        let values: Vec<f64> = record.iter().filter_map(|cell| cell.parse().ok()).collect();
        if values.len() != names.len() || record.len() != names.len() {
            continue;
        }
        let of = |group: &[usize]| group.iter().map(|k| values[*k]).collect::<Vec<f64>>();
        let (position, velocity, effort) = (of(&q), of(&dq), of(&tau));
        let state = JointState { position: &position, velocity: &velocity, effort: &effort };
        writer.state(states, values[time], &joints, &state)?;
        if let Some(log) = log {
            writer.object(log, values[time], others.iter().map(|k| (names[*k].as_str(), values[*k])))?;
        }
        rows += 1;
    }
    writer.finish()?;
    Ok(Written { rows, velocities: !dq.is_empty(), joints })
}
