//! Messages of Protocol Buffers by the definition in their file: a `FileDescriptorSet`
//! (<https://mcap.dev/spec/registry#protobuf>).
//!
//! A value's name is its path: `pose.position.x`; the values of a list are counted from 1, or named by a list
//! of names next to them. A list of messages that each have a name, as `foxglove.JointStates` is, is named by
//! these: `joints.position.elbow` is `position.elbow`.

use super::schema::{MOST, NAMES};
use super::table::Row;
use prost_reflect::{
    DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, ReflectMessage, Value,
};
use std::collections::HashSet;

/// Messages within messages.
const DEEPEST: usize = 16;
/// Times and spans of time: seconds and nanoseconds.
const TIMES: [&str; 2] = ["google.protobuf.Timestamp", "google.protobuf.Duration"];
/// Names of the time of a message.
const STAMPS: [&str; 3] = ["stamp", "timestamp", "time"];

/// A type of messages.
#[derive(Debug)]
pub(super) struct Schema(MessageDescriptor);

impl Schema {
    /// Finds a type in the set of definitions; `None` if it is not there or holds no floating-point number.
    pub(super) fn parse(kind: &str, set: &[u8]) -> Option<Schema> {
        let message = DescriptorPool::decode(set).ok()?.get_message_by_name(kind)?;
        has_quantities(&message, &mut HashSet::new()).then_some(Schema(message))
    }

    /// Reads a message's numbers into a row; its time stamp, s, where it has one.
    pub(super) fn read(&self, message: &[u8], row: &mut Row<'_>) -> Result<Option<f64>, String> {
        let message = DynamicMessage::decode(self.0.clone(), message).map_err(|e| format!("is torn: {e}"))?;
        let mut walk = Walk { row, path: String::new(), stamp: None };
        walk.message(&message, "", 0);
        Ok(walk.stamp)
    }
}

fn has_quantities(message: &MessageDescriptor, seen: &mut HashSet<String>) -> bool {
    seen.insert(message.full_name().to_string())
        && message.fields().filter(|field| !field.is_map()).any(|field| match field.kind() {
            Kind::Double | Kind::Float => true,
            Kind::Message(of) if field.is_list() => name_of(&of).is_some() && has_quantities(&of, seen),
            Kind::Message(of) => has_quantities(&of, seen),
            _ => false,
        })
}

/// The field with the name of a message.
fn name_of(message: &MessageDescriptor) -> Option<FieldDescriptor> {
    let named = |field: &FieldDescriptor| NAMES.contains(&field.name()) && !field.is_list();
    message.fields().find(|field| named(field) && matches!(field.kind(), Kind::String))
}

/// A message while it is read.
struct Walk<'r, 't> {
    row: &'r mut Row<'t>,
    /// Path of the value that is read.
    path: String,
    stamp: Option<f64>,
}

impl Walk<'_, '_> {
    /// Reads the values of a message; `joint` stands behind their names.
    fn message(&mut self, message: &DynamicMessage, joint: &str, depth: usize) {
        if depth > DEEPEST {
            return;
        }
        let descriptor = message.descriptor();
        let names = names(message, &descriptor);
        for field in descriptor.fields() {
            // A number that was not sent is zero, unless its type says that it may be absent.
            if field.is_map() || (field.supports_presence() && !message.has_field(&field)) {
                continue;
            }
            let length = self.path.len();
            if length > 0 {
                self.path.push('.');
            }
            self.path.push_str(field.name());
            match &*message.get_field(&field) {
                Value::List(list) => self.list(list, &names, length, depth),
                value => self.value(value, field.name(), joint, depth),
            }
            self.path.truncate(length);
        }
    }

    /// `above` is how much of the path is the list's own message.
    fn list(&mut self, list: &[Value], names: &[String], above: usize, depth: usize) {
        if list.len() > MOST {
            return;
        }
        for (k, value) in list.iter().enumerate() {
            match (value, number(value)) {
                (_, Some(value)) => match names.get(k).filter(|_| names.len() == list.len()) {
                    Some(name) => self.row.put(&[&self.path, ".", name], value),
                    None => self.row.put(&[&self.path, &(k + 1).to_string()], value),
                },
                (Value::Message(own), None) => {
                    let Some(name) = name_of(&own.descriptor()) else { return };
                    let name = own.get_field(&name);
                    let Some(name) = name.as_str().filter(|name| !name.is_empty()) else { continue };
                    let list = self.path.split_off(above);
                    self.message(own, &format!(".{name}"), depth + 1);
                    self.path.push_str(&list);
                }
                _ => return,
            }
        }
    }

    fn value(&mut self, value: &Value, name: &str, joint: &str, depth: usize) {
        if let Some(value) = number(value) {
            self.row.put(&[&self.path, joint], value);
        }
        let Value::Message(own) = value else { return };
        let Some(time) = time(own) else { return self.message(own, joint, depth + 1) };
        // Its own, or that of a header.
        if STAMPS.contains(&name) && (depth == 0 || (depth == 1 && self.path.starts_with("header."))) {
            self.stamp = self.stamp.or(Some(time));
        } else {
            self.row.put(&[&self.path, joint], time);
        }
    }
}

/// The list of texts that names the values of arrays.
fn names(message: &DynamicMessage, descriptor: &MessageDescriptor) -> Vec<String> {
    let named = |field: &FieldDescriptor| NAMES.contains(&field.name()) && field.is_list();
    let Some(field) = descriptor.fields().find(named) else { return Vec::new() };
    let list = message.get_field(&field);
    let texts = list.as_list().unwrap_or_default().iter().filter_map(Value::as_str);
    texts.map(str::to_string).collect()
}

/// The seconds of a time.
fn time(message: &DynamicMessage) -> Option<f64> {
    if !TIMES.contains(&message.descriptor().full_name()) {
        return None;
    }
    let part = |name: &str| message.get_field_by_name(name).and_then(|value| number(&value));
    Some(part("seconds")? + 1e-9 * part("nanos")?)
}

fn number(value: &Value) -> Option<f64> {
    Some(match value {
        Value::Bool(value) => f64::from(u8::from(*value)),
        Value::I32(value) | Value::EnumNumber(value) => f64::from(*value),
        Value::I64(value) => *value as f64,
        Value::U32(value) => f64::from(*value),
        Value::U64(value) => *value as f64,
        Value::F32(value) => f64::from(*value),
        Value::F64(value) => *value,
        _ => return None,
    })
}
