//! `powerball bus sdo`.

use super::super::output;
use super::{Failure, Where, node, number, printable};
use clap::{Args, Subcommand, ValueEnum};
use powerball_bus::canopen::client::Value;
use powerball_bus::canopen::{NodeId, Object};
use powerball_bus::driver::dictionary::{DataType, find};
use powerball_bus::driver::lwa4p::DICTIONARY;
use powerball_bus::transport::blocking;
use serde_json::json;

/// Read or write one object of a node.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball bus sdo read 3 0x6041\n  \
    powerball bus sdo read 3 0x1018:1 --json\n  powerball bus sdo write 3 0x200E 6\n\n\
    Numbers are decimal or 0x… The type is that of the drive's DCF; --type sets another.")]
pub(crate) struct Sdo {
    #[command(subcommand)]
    what: Direction,
}

#[derive(Debug, Subcommand)]
enum Direction {
    /// Read an object.
    #[command(after_help = "Example: powerball bus sdo read 3 0x1018:1")]
    Read(Read),
    /// Write an object.
    #[command(after_help = "Example: powerball bus sdo write 3 0x1017 100")]
    Write(Write),
}

#[derive(Args, Debug)]
struct Read {
    #[command(flatten)]
    address: Address,
    #[command(flatten)]
    place: Where,
}

#[derive(Args, Debug)]
struct Write {
    #[command(flatten)]
    address: Address,
    /// The value: a number, or a text where the object is one.
    #[arg(allow_negative_numbers = true)]
    value: String,
    #[command(flatten)]
    place: Where,
}

#[derive(Args, Clone, Debug)]
struct Address {
    /// The node, 1 to 127.
    #[arg(value_parser = node)]
    node: NodeId,
    /// Index, and sub-index where it is not 0: 0x1018:1.
    #[arg(value_name = "INDEX[:SUB]", value_parser = object)]
    object: Object,
    /// The object's type, where the DCF does not say it.
    #[arg(long = "type", value_enum)]
    kind: Option<Kind>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    U8,
    U16,
    U32,
    I8,
    I16,
    I32,
    F32,
    Text,
}

impl Address {
    fn data_type(&self) -> Option<DataType> {
        let given = self.kind.map(|kind| match kind {
            Kind::U8 => DataType::Unsigned8,
            Kind::U16 => DataType::Unsigned16,
            Kind::U32 => DataType::Unsigned32,
            Kind::I8 => DataType::Integer8,
            Kind::I16 => DataType::Integer16,
            Kind::I32 => DataType::Integer32,
            Kind::F32 => DataType::Real32,
            Kind::Text => DataType::VisibleString,
        });
        given.or_else(|| find(DICTIONARY, self.object).map(|entry| entry.data_type))
    }
}

/// `0x1018:1`, `6041`-like decimals too.
fn object(text: &str) -> Result<Object, String> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let index = number(index).and_then(|i| u16::try_from(i).ok());
    let sub = number(sub).and_then(|s| u8::try_from(s).ok());
    match (index, sub) {
        (Some(index), Some(sub)) => Ok(Object::new(index, sub)),
        _ => Err("an object is INDEX or INDEX:SUB, as 0x6041 or 0x1018:1".to_string()),
    }
}

impl Sdo {
    pub(crate) fn run(self) -> Result<(), Failure> {
        match self.what {
            Direction::Read(command) => command.run(),
            Direction::Write(command) => command.run(),
        }
    }
}

impl Read {
    fn run(self) -> Result<(), Failure> {
        let mut bus = self.place.open()?;
        let Address { node, object, .. } = self.address;
        let value = blocking::read(&mut *bus, node, object)?;
        show(&self.address, &value, &self.place);
        Ok(())
    }
}

impl Write {
    fn run(self) -> Result<(), Failure> {
        let Address { node, object, .. } = self.address;
        let mut bus = self.place.open()?;
        // If the type is not known, the node's own answer gives the width.
        let kind = match self.address.data_type() {
            Some(kind) => kind,
            None => match blocking::read(&mut *bus, node, object)?.as_slice().len() {
                1 => DataType::Integer8,
                2 => DataType::Integer16,
                4 => DataType::Integer32,
                _ => DataType::VisibleString,
            },
        };
        let value = encode(&self.value, kind).map_err(|why| {
            Failure::Unusable(format!("\"{}\" is not a value for {object}: {why}", self.value))
        })?;
        blocking::write(&mut *bus, node, object, value)?;
        show(&self.address, &value, &self.place);
        Ok(())
    }
}

fn encode(text: &str, kind: DataType) -> Result<Value, String> {
    let Some(size) = kind.size() else {
        return Value::new(text.as_bytes()).ok_or_else(|| "the text is too long".to_string());
    };
    if kind == DataType::Real32 {
        let real: f32 = text.parse().map_err(|_| "a number is needed".to_string())?;
        return Ok(Value::number(i64::from(real.to_bits()), 4));
    }
    if kind == DataType::Real64 {
        let real: f64 = text.parse().map_err(|_| "a number is needed".to_string())?;
        return Ok(Value::number(real.to_bits() as i64, 8));
    }
    let value = number(text).ok_or("a whole number is needed, decimal or 0x…")?;
    let bits = 8 * size as u32;
    let wide = i128::from(value);
    // A signed object may be given as the bits that it shows in hexadecimal.
    let range = if kind.is_signed() { -(1i128 << (bits - 1))..1i128 << bits } else { 0..1i128 << bits };
    if range.contains(&wide) {
        Ok(Value::number(value, size))
    } else {
        Err(format!("it does not fit into {bits} bits"))
    }
}

fn show(address: &Address, value: &Value, place: &Where) {
    let bytes = value.as_slice();
    let kind = address.data_type();
    let entry = find(DICTIONARY, address.object);
    let meaning = match (kind, value.signed(), value.unsigned()) {
        (Some(DataType::Real32), _, Some(bits)) => json!(f32::from_bits(bits)),
        (Some(DataType::VisibleString | DataType::OctetString), ..) => json!(printable(bytes)),
        (Some(kind), Some(signed), _) if kind.is_signed() => json!(signed),
        (_, _, Some(unsigned)) => json!(unsigned),
        _ => json!(printable(bytes)),
    };
    let hex: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    if place.json {
        let result = json!({
            "node": address.node.raw(), "index": address.object.index, "sub": address.object.sub, "value": meaning,
            "bytes": hex, "name": entry.map(|e| e.name),
        });
        output::data(&result.to_string());
    } else {
        let text = meaning.as_str().map_or(meaning.to_string(), ToString::to_string);
        let name = entry.map_or(String::new(), |e| format!("  {}", e.name));
        let raw = value
            .unsigned()
            .map_or(String::new(), |raw| format!("  0x{raw:0width$X}", width = 2 * bytes.len()));
        output::print(&format!("{}{raw}  node {}, {}{name}", text, address.node, address.object));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_values_are_read_as_people_write_them() {
        assert_eq!(object("0x1018:1"), Ok(Object::new(0x1018, 1)));
        assert_eq!(object("0x6041"), Ok(Object::new(0x6041, 0)));
        for text in ["", "0x10000", "0x1018:", "0x1018:256", "position"] {
            assert!(object(text).is_err(), "{text}");
        }
        let bytes = |text, kind| encode(text, kind).map(|v| v.as_slice().to_vec());
        assert_eq!(bytes("-2", DataType::Integer16), Ok(vec![0xFE, 0xFF]));
        assert_eq!(bytes("0xFFFE", DataType::Integer16), Ok(vec![0xFE, 0xFF]));
        assert_eq!(bytes("1.5", DataType::Real32), Ok(1.5f32.to_le_bytes().to_vec()));
        assert!(bytes("256", DataType::Unsigned8).is_err() && bytes("-1", DataType::Unsigned8).is_err());
    }
}
