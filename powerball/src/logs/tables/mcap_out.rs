//! Recordings as MCAP, which Foxglove and rerun open: joint states in ROS's message, all else as JSON.
//!
//! Records stand one after the other, without chunks and index, so that a file can be read up to where its
//! writer died.

use super::cdr::CdrWriter;
use super::mcap::{CHANNEL, DATA_END, FOOTER, MAGIC, MESSAGE, SCHEMA};
use serde_json::{Map, Value};
use std::io::{self, Read, Write};

/// The first record of a file.
const HEADER: u8 = 0x01;
/// `sensor_msgs/JointState` with what it is made of, as ROS 2 writes definitions into bags.
const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
    float64[] effort\n\
    ================================================================================\n\
    MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================================================================================\n\
    MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// A channel of a file that is being written.
#[derive(Clone, Copy, Debug)]
pub struct Channel(u16);

/// Writes a file, message by message.
#[derive(Debug)]
pub struct McapWriter<W: Write> {
    out: W,
    channels: u16,
    messages: u32,
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
    pub fn new(mut out: W) -> io::Result<Self> {
        out.write_all(MAGIC)?;
        let mut writer = McapWriter { out, channels: 0, messages: 0 };
        writer.record(HEADER, &[text("ros2"), text("powerball")].concat())?;
        Ok(writer)
    }

    /// A topic of joint states.
    ///
    /// # Errors
    /// As [`McapWriter::new`].
    pub fn joint_states(&mut self, topic: &str) -> io::Result<Channel> {
        self.channel(topic, "sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE, "cdr")
    }

    /// A topic of JSON objects whose members are numbers.
    ///
    /// # Errors
    /// As [`McapWriter::new`].
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
        self.channels += 1;
        let id = self.channels.to_le_bytes();
        self.record(SCHEMA, &[id.to_vec(), text(kind), text(language), text(definition)].concat())?;
        let nothing = 0u32.to_le_bytes().to_vec();
        self.record(CHANNEL, &[id.to_vec(), id.to_vec(), text(topic), text(encoding), nothing].concat())?;
        Ok(Channel(self.channels))
    }

    /// A message of joint states at a time, s.
    ///
    /// # Errors
    /// As [`McapWriter::new`].
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
    /// As [`McapWriter::new`].
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

    fn message(&mut self, Channel(id): Channel, t: f64, data: &[u8]) -> io::Result<()> {
        let nanoseconds = ((1e9 * t).round().max(0.0) as u64).to_le_bytes();
        self.messages += 1;
        let head = [&id.to_le_bytes()[..], &self.messages.to_le_bytes(), &nanoseconds, &nanoseconds].concat();
        self.record(MESSAGE, &[&head, data].concat())
    }

    fn record(&mut self, number: u8, body: &[u8]) -> io::Result<()> {
        self.out.write_all(&[number])?;
        self.out.write_all(&(body.len() as u64).to_le_bytes())?;
        self.out.write_all(body)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// As [`McapWriter::new`].
    pub fn finish(mut self) -> io::Result<W> {
        // Without checksums, and without a summary.
        self.record(DATA_END, &[0; 4])?;
        self.record(FOOTER, &[0; 20])?;
        self.out.write_all(MAGIC)?;
        self.out.flush()?;
        Ok(self.out)
    }
}

fn text(value: &str) -> Vec<u8> {
    [&(value.len() as u32).to_le_bytes()[..], value.as_bytes()].concat()
}

/// CSV lines of numbers as MCAP: `q`, `dq` and `tau` of joints 1 to n are `/joint_states`, other columns
/// `/log`; the number of lines. Lines that are torn or hold anything else are left out. A time that begins
/// below 0 is moved there.
pub(crate) fn from_csv(csv: impl Read, out: impl Write) -> io::Result<usize> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(csv);
    let names: Vec<String> = reader.headers()?.iter().map(str::to_string).collect();
    let at = |name: &str| names.iter().position(|own| own == name);
    let time = at("t").ok_or_else(|| io::Error::other("the lines have no column t"))?;
    let by_joint = |stem: &str| -> Vec<usize> { (1..).map_while(|j| at(&format!("{stem}{j}"))).collect() };
    let [q, dq, tau] = ["q", "dq", "tau"].map(by_joint);
    let joints: Vec<String> = (1..=q.len().max(tau.len())).map(|j| format!("joint{j}")).collect();
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
    Ok(rows)
}
