//! Definitions of ROS messages, as bags carry them, and the numbers of messages that they describe.
//!
//! A definition is the text of a `.msg` file and of all types that it uses, one after the other
//! (<https://mcap.dev/spec/registry#ros2msg>; ROS 1 writes the same into its bags). A value's name is its
//! path: `pose.position.x`; the values of an array are counted from 1, or named by a list of names next to
//! them.

use super::cdr::Cdr;
use super::table::Row;
use std::collections::HashMap;

/// Values of one array beyond this are not joints.
pub(super) const MOST: usize = 64;
/// Messages within messages.
const DEEPEST: usize = 16;
/// A message with more parts than these is not one of joints.
const MOST_PARTS: usize = 1 << 20;
/// Lists of texts that name the values of arrays.
pub(super) const NAMES: [&str; 4] = ["name", "names", "joint_name", "joint_names"];

/// A type of messages with all that it is made of; the first is the type itself.
#[derive(Debug)]
pub(super) struct Schema(Vec<Vec<Field>>);

#[derive(Debug)]
struct Field {
    name: String,
    of: Of,
    count: Count,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Of {
    /// A number: its size, and how its bits are read.
    Number(usize, Bits),
    Text,
    WideText,
    /// Seconds and nanoseconds.
    Time,
    Header,
    /// Another message, by its place among the types.
    Message(usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bits {
    Unsigned,
    Signed,
    Float,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Count {
    One,
    Fixed(usize),
    List,
}

impl Schema {
    /// Reads the definition of a type; `None` if it is not understood.
    pub(super) fn parse(kind: &str, text: &str) -> Option<Schema> {
        // Name by name, in the order of the text; the first part has none of its own.
        let mut parts: Vec<(String, Vec<&str>)> = vec![(plain(kind), Vec::new())];
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            match line.strip_prefix("MSG:") {
                Some(name) => parts.push((plain(name.trim()), Vec::new())),
                None if line.is_empty() || line.starts_with("===") => {}
                None => parts.last_mut()?.1.push(line),
            }
        }
        let places: HashMap<String, usize> =
            parts.iter().enumerate().map(|(k, (name, _))| (name.clone(), k)).collect();
        let message = |(name, lines): &(String, Vec<&str>)| {
            let package = name.split('/').next().unwrap_or_default();
            lines.iter().filter_map(|line| field(line, package, &places)).collect::<Option<Vec<Field>>>()
        };
        let schema = Schema(parts.iter().map(message).collect::<Option<_>>()?);
        (!schema.0[0].is_empty()).then_some(schema)
    }

    /// Whether its messages hold measured quantities: numbers with a point, not only in a list of messages.
    pub(super) fn has_quantities(&self) -> bool {
        let (mut seen, mut open) = (vec![false; self.0.len()], vec![0]);
        while let Some(message) = open.pop() {
            if std::mem::replace(&mut seen[message], true) {
                continue;
            }
            for field in &self.0[message] {
                match (field.of, field.count) {
                    (Of::Number(_, Bits::Float), _) => return true,
                    (Of::Message(of), Count::One) => open.push(of),
                    _ => {}
                }
            }
        }
        false
    }

    /// Reads a message's numbers into a row; its time stamp, s, where it has one.
    pub(super) fn read(&self, message: &mut Cdr<'_>, row: &mut Row<'_>) -> Result<Option<f64>, String> {
        let mut walk = Walk { schema: self, row, path: String::new(), stamp: None, parts: 0 };
        walk.message(0, message, true, 0)?;
        Ok(walk.stamp)
    }
}

/// `sensor_msgs/msg/JointState` without the part in the middle.
fn plain(kind: &str) -> String {
    kind.replace("/msg/", "/")
}

/// A field; none where the line has no field but a constant, or within where its type is not known.
fn field(line: &str, package: &str, places: &HashMap<String, usize>) -> Option<Option<Field>> {
    let (kind, rest) = line.split_once(char::is_whitespace)?;
    let name = rest.split_whitespace().next()?;
    // Constants are not in messages; a default value is written without the sign.
    if name.contains('=') || rest.split_whitespace().nth(1).is_some_and(|next| next.starts_with('=')) {
        return None;
    }
    let (kind, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((kind, size)) => match size.trim_end_matches(']') {
            "" => (kind, Count::List),
            most if most.starts_with("<=") => (kind, Count::List),
            size => match size.parse() {
                Ok(size) => (kind, Count::Fixed(size)),
                Err(_) => return Some(None),
            },
        },
    };
    // Texts may be bounded.
    let kind = kind.split("<=").next().unwrap_or(kind);
    let of = match kind {
        "bool" | "byte" | "char" | "uint8" => Of::Number(1, Bits::Unsigned),
        "int8" => Of::Number(1, Bits::Signed),
        "uint16" => Of::Number(2, Bits::Unsigned),
        "int16" => Of::Number(2, Bits::Signed),
        "uint32" => Of::Number(4, Bits::Unsigned),
        "int32" => Of::Number(4, Bits::Signed),
        "uint64" => Of::Number(8, Bits::Unsigned),
        "int64" => Of::Number(8, Bits::Signed),
        "float32" => Of::Number(4, Bits::Float),
        "float64" => Of::Number(8, Bits::Float),
        "string" => Of::Text,
        "wstring" => Of::WideText,
        "time" | "duration" => Of::Time,
        "Header" => Of::Header,
        other => match plain(other).as_str() {
            "std_msgs/Header" => Of::Header,
            "builtin_interfaces/Time" | "builtin_interfaces/Duration" => Of::Time,
            other => {
                let full = if other.contains('/') { other.into() } else { format!("{package}/{other}") };
                match places.get(&full) {
                    Some(place) => Of::Message(*place),
                    None => return Some(None),
                }
            }
        },
    };
    Some(Some(Field { name: name.to_string(), of, count }))
}

/// A message while it is read.
struct Walk<'a, 'r, 't> {
    schema: &'a Schema,
    row: &'r mut Row<'t>,
    /// Path of the value that is read.
    path: String,
    stamp: Option<f64>,
    /// Messages within it so far.
    parts: usize,
}

impl Walk<'_, '_, '_> {
    /// Reads a message; its values are of use where `kept`.
    fn message(&mut self, of: usize, bytes: &mut Cdr<'_>, kept: bool, depth: usize) -> Result<(), String> {
        self.parts += 1;
        if depth > DEEPEST || self.parts > MOST_PARTS {
            return Err("has more parts than a message of joints".into());
        }
        let schema = self.schema;
        let end = bytes.begin_message()?;
        if schema.0[of].is_empty() {
            bytes.pass_empty()?;
        }
        let mut names: Vec<String> = Vec::new();
        for field in &schema.0[of] {
            let length = self.path.len();
            if !self.path.is_empty() {
                self.path.push('.');
            }
            self.path.push_str(&field.name);
            self.field(field, bytes, &mut names, kept, depth)?;
            self.path.truncate(length);
        }
        bytes.end_message(end)
    }

    fn field(
        &mut self,
        field: &Field,
        bytes: &mut Cdr<'_>,
        names: &mut Vec<String>,
        kept: bool,
        depth: usize,
    ) -> Result<(), String> {
        let structured = !matches!(field.of, Of::Number(..));
        if structured && field.count != Count::One {
            bytes.begin_list()?;
        }
        let count = match field.count {
            Count::One => 1,
            Count::Fixed(count) => count,
            Count::List => bytes.count()?,
        };
        let single = field.count == Count::One;
        match field.of {
            Of::Number(size, _) if !kept || (!single && count > MOST) => bytes.skip(count, size)?,
            Of::Number(size, bits) => {
                for k in 0..count {
                    let value = bytes.number(size, bits)?;
                    match names.get(k).filter(|_| !single && names.len() == count) {
                        Some(name) => self.row.put(&[&self.path, ".", name], value),
                        None if single => self.row.put(&[&self.path], value),
                        None => self.row.put(&[&self.path, &(k + 1).to_string()], value),
                    }
                }
            }
            Of::Text => {
                let texts = (0..count).map(|_| bytes.string()).collect::<Result<Vec<_>, _>>()?;
                if !single && NAMES.contains(&field.name.as_str()) {
                    *names = texts.iter().map(ToString::to_string).collect();
                }
            }
            Of::WideText => return Err("holds wide texts, which are not read".into()),
            Of::Time | Of::Header => {
                for _ in 0..count {
                    let header = field.of == Of::Header;
                    let time = if header { bytes.header()? } else { bytes.time()? };
                    let stamp = header || ["stamp", "timestamp"].contains(&field.name.as_str());
                    match (single && kept, stamp) {
                        (true, true) if depth == 0 => self.stamp = self.stamp.or(Some(time)),
                        (true, false) => self.row.put(&[&self.path], time),
                        _ => {}
                    }
                }
            }
            // Lists of messages, such as the transforms of a tree, are no signals.
            Of::Message(of) => {
                for _ in 0..count {
                    self.message(of, bytes, kept && single, depth + 1)?;
                }
            }
        }
        Ok(())
    }
}
