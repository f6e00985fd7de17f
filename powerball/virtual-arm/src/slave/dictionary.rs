//! The drive's object dictionary with values: exactly the objects of the maker's DCF, their types, rights and
//! defaults.

use powerball_bus::canopen::sdo::AbortCode;
use powerball_bus::canopen::{NodeId, Object, objects};
use powerball_bus::driver::dictionary::DataType;
use powerball_bus::driver::lwa4p::DICTIONARY;

/// The value of an object. Numbers of all widths are `i64`; unsigned ones keep their value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number.
    Number(i64),
    /// A real number.
    Real(f64),
    /// A string.
    Text(String),
}

/// One object.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The entry's address.
    pub object: Object,
    /// The entry's type.
    pub kind: DataType,
    /// Whether it can be read.
    pub readable: bool,
    /// Whether it can be written.
    pub writable: bool,
    /// Whether it may be mapped into a PDO.
    pub mappable: bool,
    /// Lowest and highest number that may be written.
    pub range: [i64; 2],
    /// The present value.
    pub value: Value,
}

/// The dictionary of one drive.
#[derive(Clone, Debug)]
pub struct Dictionary {
    /// Sorted by address.
    entries: Vec<Entry>,
}

/// Who a drive says that it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// 0x1018:1.
    pub vendor: u32,
    /// 0x1018:2.
    pub product: u32,
    /// 0x1018:3.
    pub revision: u32,
    /// 0x1018:4.
    pub serial: u32,
}

/// Narrower ranges than their type's: index, sub-index, lowest, highest.
const RANGES: [(u16, u8, i64, i64); 8] = [
    (0x1003, 0, 0, 0),
    (0x1017, 0, 0, 32767),
    (0x1800, 5, 0, 32767),
    (0x200D, 2, 1000, 3_600_000),
    (0x60C0, 0, -1, 0),
    (0x60C2, 1, 1, 255),
    (0x60C2, 2, -128, 63),
    (0x60C4, 3, 0, 1),
];

impl Dictionary {
    /// The dictionary of a drive as it leaves the factory, for node `node`.
    pub fn new(node: NodeId, identity: Identity) -> Self {
        let entries = DICTIONARY.iter().map(|known| {
            let offset = if known.plus_node { i64::from(node.raw()) } else { 0 };
            Entry {
                object: known.object,
                kind: known.data_type,
                readable: known.readable,
                writable: known.writable,
                mappable: known.mappable,
                range: range(known.data_type),
                value: zero(known.data_type, known.default.unwrap_or(0) + offset),
            }
        });
        let mut made = Dictionary { entries: entries.collect() };
        // Servo drive of CiA 402.
        made.set(objects::DEVICE_TYPE, 0x0002_0192);
        let Identity { vendor, product, revision, serial } = identity;
        for (sub, value) in (1..).zip([vendor, product, revision, serial]) {
            made.set(Object::new(0x1018, sub), i64::from(value));
        }
        for (index, text) in
            [(0x1008, "PRL+ virtual"), (0x1009, "virtual"), (0x100A, "Schunk_0_63 virtual arm")]
        {
            made.set_text(Object::new(index, 0), text);
        }
        made.set_text(Object::new(0x200B, 2), "no error yet");
        for (index, sub, low, high) in RANGES {
            if let Some(entry) = made.entry_mut(Object::new(index, sub)) {
                entry.range = [low, high];
            }
        }
        made
    }

    /// Adds an i16 that may be written and mapped, as a profile may that knows more than the DCF.
    pub fn add_setpoint(&mut self, object: Object) {
        let kind = DataType::Integer16;
        let value = Value::Number(0);
        let entry =
            Entry { object, kind, readable: true, writable: true, mappable: true, range: range(kind), value };
        match self.entries.binary_search_by_key(&object, |e| e.object) {
            Ok(at) => self.entries[at] = entry,
            Err(at) => self.entries.insert(at, entry),
        }
    }

    /// The object at an address, or the abort code that says whether its index or its sub-index is unknown.
    ///
    /// # Errors
    /// [`AbortCode::NO_OBJECT`] and [`AbortCode::NO_SUB_INDEX`].
    pub fn entry(&self, object: Object) -> Result<&Entry, AbortCode> {
        self.place(object).map(|at| &self.entries[at])
    }

    fn entry_mut(&mut self, object: Object) -> Option<&mut Entry> {
        let at = self.place(object).ok()?;
        self.entries.get_mut(at)
    }

    fn place(&self, object: Object) -> Result<usize, AbortCode> {
        self.entries.binary_search_by_key(&object, |e| e.object).map_err(|near| {
            let same = |at: usize| self.entries.get(at).is_some_and(|e| e.object.index == object.index);
            if same(near) || near > 0 && same(near - 1) {
                AbortCode::NO_SUB_INDEX
            } else {
                AbortCode::NO_OBJECT
            }
        })
    }

    /// A number, 0 where the object holds none.
    pub fn get(&self, object: Object) -> i64 {
        match self.entry(object).map(|e| &e.value) {
            Ok(Value::Number(value)) => *value,
            _ => 0,
        }
    }

    /// Sets a number without asking for rights, cut to the object's range.
    pub fn set(&mut self, object: Object, number: i64) {
        if let Some(entry) = self.entry_mut(object) {
            entry.value = Value::Number(number.clamp(entry.range[0], entry.range[1]));
        }
    }

    /// Sets a real number without asking for rights.
    pub fn set_real(&mut self, object: Object, number: f32) {
        if let Some(entry) = self.entry_mut(object) {
            entry.value = Value::Real(f64::from(number));
        }
    }

    /// Sets a string without asking for rights.
    pub fn set_text(&mut self, object: Object, text: &str) {
        if let Some(entry) = self.entry_mut(object) {
            entry.value = Value::Text(text.to_string());
        }
    }

    /// The bytes of an object as an SDO reads them.
    ///
    /// # Errors
    /// Where there is no such object, or it may not be read.
    pub fn read(&self, object: Object) -> Result<Vec<u8>, AbortCode> {
        let entry = self.entry(object)?;
        if !entry.readable {
            return Err(AbortCode::WRITE_ONLY);
        }
        Ok(match &entry.value {
            Value::Number(number) => number.to_le_bytes()[..entry.kind.size().unwrap_or(0)].to_vec(),
            Value::Real(number) if entry.kind == DataType::Real32 => (*number as f32).to_le_bytes().to_vec(),
            Value::Real(number) => number.to_le_bytes().to_vec(),
            Value::Text(text) => text.as_bytes().to_vec(),
        })
    }

    /// Whether an SDO may write these bytes, and what they mean.
    ///
    /// # Errors
    /// Where there is no such object, it may not be written, or length or value are wrong.
    pub fn check(&self, object: Object, bytes: &[u8]) -> Result<Value, AbortCode> {
        let entry = self.entry(object)?;
        if !entry.writable {
            return Err(AbortCode::READ_ONLY);
        }
        let Some(size) = entry.kind.size() else {
            return Ok(Value::Text(String::from_utf8_lossy(bytes).into_owned()));
        };
        match bytes.len() {
            len if len > size => return Err(AbortCode::TOO_LONG),
            len if len < size => return Err(AbortCode::TOO_SHORT),
            _ => {}
        }
        let raw = bytes.iter().rev().fold(0u64, |sum, byte| sum << 8 | u64::from(*byte));
        let unused = 64 - 8 * size as u32;
        let number = match entry.kind {
            DataType::Real32 => return Ok(Value::Real(f64::from(f32::from_bits(raw as u32)))),
            DataType::Real64 => return Ok(Value::Real(f64::from_bits(raw))),
            kind if kind.is_signed() => ((raw << unused) as i64) >> unused,
            _ => raw as i64,
        };
        let in_range = (entry.range[0]..=entry.range[1]).contains(&number);
        if in_range { Ok(Value::Number(number)) } else { Err(AbortCode::VALUE) }
    }

    /// Stores what [`check`](Self::check) allowed.
    pub fn store(&mut self, object: Object, value: Value) {
        if let Some(entry) = self.entry_mut(object) {
            entry.value = value;
        }
    }

    /// All objects, sorted by address.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }
}

/// All that a type can hold.
fn range(kind: DataType) -> [i64; 2] {
    match kind.size() {
        // 64 bits without a sign are kept as those of an i64.
        Some(8) | None => [i64::MIN, i64::MAX],
        Some(size) if kind.is_signed() => [-(1i64 << (8 * size - 1)), (1i64 << (8 * size - 1)) - 1],
        Some(size) => [0, (1i64 << (8 * size)) - 1],
    }
}

/// A value of a type.
fn zero(kind: DataType, number: i64) -> Value {
    match kind {
        DataType::Real32 | DataType::Real64 => Value::Real(number as f64),
        _ if kind.size().is_none() => Value::Text(String::new()),
        _ => Value::Number(number),
    }
}
