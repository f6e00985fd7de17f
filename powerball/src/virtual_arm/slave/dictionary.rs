//! The drive's object dictionary: exactly the objects of the maker's DCF, their types, rights, limits and defaults.

use crate::canopen::sdo::AbortCode;
use crate::canopen::{NodeId, Object};

/// Data types of CiA 301 that the drive uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// Signed, of so many bytes.
    Signed(u8),
    /// Unsigned, of so many bytes.
    Unsigned(u8),
    /// IEEE 754, four bytes.
    Real,
    /// Visible string.
    Text,
}

impl Type {
    /// Bytes of a value; `None` for strings.
    pub fn size(self) -> Option<usize> {
        match self {
            Type::Signed(size) | Type::Unsigned(size) => Some(usize::from(size)),
            Type::Real => Some(4),
            Type::Text => None,
        }
    }
}

/// Who may do what with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read.
    Ro,
    /// Read and write.
    Rw,
    /// Read and write; a process datum that the drive receives.
    Rww,
    /// Read and write; a process datum that the drive sends.
    Rwr,
    /// Write.
    Wo,
}

/// What an object holds. Numbers of all widths are `i64`; unsigned ones keep their value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number.
    Number(i64),
    /// A real number.
    Real(f32),
    /// A string.
    Text(String),
}

/// One object.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its address.
    pub object: Object,
    /// Its type.
    pub kind: Type,
    /// Who may do what.
    pub access: Access,
    /// Whether it may be mapped into a PDO.
    pub mappable: bool,
    /// Lowest and highest number that may be written.
    pub range: [i64; 2],
    /// What it holds.
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

const U8: Type = Type::Unsigned(1);
const U16: Type = Type::Unsigned(2);
const U32: Type = Type::Unsigned(4);
const I8: Type = Type::Signed(1);
const I16: Type = Type::Signed(2);
const I32: Type = Type::Signed(4);

/// Objects of the drive profile and the maker's own: index, sub-index, type, access, mappable, default.
const APPLICATION: &[(u16, u8, Type, Access, bool, i64)] = {
    use Access::{Ro, Rw, Rwr, Rww, Wo};
    use Type::{Real, Text};
    &[
        (0x2000, 0, U32, Rw, false, 0),
        (0x2001, 0, U8, Ro, false, 4),
        (0x2001, 1, I32, Rwr, true, 0),
        (0x2001, 2, I32, Rwr, true, 0),
        (0x2001, 3, I32, Rwr, true, 0),
        (0x2001, 4, I32, Rwr, true, 0),
        (0x2002, 0, U8, Ro, false, 4),
        (0x2002, 1, Real, Rwr, true, 0),
        (0x2002, 2, Real, Rwr, true, 0),
        (0x2002, 3, Real, Rwr, true, 0),
        (0x2002, 4, Real, Rwr, true, 0),
        (0x2003, 0, Text, Ro, false, 0),
        (0x2004, 0, U8, Ro, false, 2),
        (0x2004, 1, U16, Rw, false, 0x8001),
        (0x2004, 2, Real, Rw, false, 0),
        (0x2007, 0, U8, Ro, false, 1),
        (0x2007, 1, Text, Ro, false, 0),
        (0x2008, 0, Text, Wo, false, 0),
        (0x2009, 0, U8, Ro, false, 0),
        (0x200A, 0, U8, Wo, false, 0),
        (0x200B, 0, U8, Ro, false, 3),
        (0x200B, 1, Real, Ro, false, 0),
        (0x200B, 2, Text, Ro, false, 0),
        (0x200B, 3, U16, Ro, false, 0),
        (0x200C, 0, U8, Rw, false, 0),
        (0x200D, 0, U8, Ro, false, 2),
        (0x200D, 1, Real, Ro, true, 0),
        (0x200D, 2, U32, Rw, false, 20_000),
        (0x200E, 0, U8, Rw, false, 6),
        (0x2010, 0, Real, Rw, false, 0),
        (0x2011, 0, Real, Rw, false, 0),
        (0x2012, 0, Real, Rw, false, 0),
        (0x2013, 0, Real, Rw, false, 0),
        (0x2020, 0, Real, Rw, false, 0),
        (0x2021, 0, Real, Rw, false, 0),
        (0x2022, 0, Real, Rw, false, 0),
        (0x2023, 0, Real, Rw, false, 0),
        (0x2024, 0, Real, Rw, false, 0),
        (0x2030, 0, Real, Rw, false, 0),
        (0x2031, 0, Real, Rw, false, 0),
        (0x2032, 0, Real, Rw, false, 0),
        (0x2033, 0, Real, Rw, false, 0),
        (0x2034, 0, Real, Rw, false, 0),
        (0x2041, 0, Real, Rw, false, 0),
        (0x2050, 0, U8, Ro, true, 0),
        (0x6040, 0, U16, Rww, true, 0),
        (0x6041, 0, U16, Ro, true, 0),
        (0x6042, 0, I16, Rww, true, 0),
        (0x6043, 0, I16, Ro, true, 0),
        (0x6044, 0, I16, Ro, true, 0),
        (0x6046, 0, U8, Ro, false, 2),
        (0x6046, 1, U32, Rww, true, 0),
        (0x6046, 2, U32, Rww, true, 0),
        (0x6048, 0, U8, Ro, false, 2),
        (0x6048, 1, U32, Rww, true, 0),
        (0x6048, 2, U16, Rww, true, 0),
        (0x6049, 0, U8, Ro, false, 2),
        (0x6049, 1, U32, Rww, true, 0),
        (0x6049, 2, U16, Rww, true, 0),
        (0x604C, 0, U8, Ro, false, 2),
        (0x604C, 1, I32, Rw, false, 1),
        (0x604C, 2, I32, Rw, false, 6000),
        (0x6060, 0, I8, Rw, true, 0),
        (0x6061, 0, I8, Ro, true, 0),
        (0x6062, 0, I32, Ro, true, 0),
        (0x6064, 0, I32, Ro, true, 0),
        (0x6065, 0, U32, Rw, false, 10_000),
        (0x606B, 0, I32, Ro, true, 0),
        (0x606C, 0, I32, Ro, true, 0),
        (0x6073, 0, U16, Rww, true, 0),
        (0x6075, 0, U32, Rw, false, 0),
        (0x6077, 0, I16, Ro, true, 0),
        (0x607A, 0, I32, Rww, true, 0),
        (0x607C, 0, I32, Rw, false, 0),
        (0x607D, 0, U8, Ro, false, 2),
        (0x607D, 1, I32, Rw, false, 0),
        (0x607D, 2, I32, Rw, false, 0),
        (0x6081, 0, U32, Rww, true, 0x2710),
        (0x6083, 0, U32, Rww, true, 100_000),
        (0x6086, 0, I16, Rw, false, 0),
        (0x6098, 0, I8, Ro, false, 0),
        (0x60B2, 0, I16, Rww, true, 0),
        (0x60C0, 0, I16, Rw, false, 0),
        (0x60C1, 0, U8, Ro, false, 1),
        (0x60C1, 1, I32, Rww, true, 0),
        (0x60C2, 0, U8, Ro, false, 2),
        (0x60C2, 1, U8, Rw, false, 8),
        (0x60C2, 2, I8, Rw, false, -3),
        (0x60C3, 0, U8, Ro, false, 2),
        (0x60C3, 1, U8, Rw, false, 0),
        (0x60C3, 2, U8, Rw, false, 1),
        (0x60C4, 0, U8, Ro, false, 6),
        (0x60C4, 1, U32, Ro, false, 1),
        (0x60C4, 2, U32, Rw, false, 0),
        (0x60C4, 3, U8, Rw, false, 0),
        (0x60C4, 4, U16, Rw, false, 0),
        (0x60C4, 5, U8, Wo, false, 1),
        (0x60C4, 6, U8, Wo, false, 0),
        (0x60F4, 0, I32, Ro, true, 0),
        (0x60FD, 0, U32, Ro, true, 0),
        (0x60FE, 0, U8, Ro, false, 2),
        (0x60FE, 1, U32, Rww, true, 0),
        (0x60FE, 2, U32, Rw, false, 0),
        (0x6502, 0, U32, Ro, false, 0x43),
    ]
};

/// Default mappings, as the device has them without a DCF: receive PDOs, then transmit PDOs.
const DEFAULT_MAPPINGS: [(u16, &[u32]); 6] = [
    (0x1600, &[0x6040_0010, 0x60C1_0120]),
    (0x1601, &[]),
    (0x1A00, &[0x6041_0010, 0x6077_0010, 0x6064_0020]),
    (0x1A01, &[0x606B_0020, 0x606C_0020]),
    (0x1A02, &[]),
    (0x1A03, &[]),
];

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
        let mut made = Dictionary { entries: Vec::with_capacity(256) };
        made.communication(u32::from(node.raw()), identity);
        for (index, sub, kind, access, mappable, default) in APPLICATION {
            made.add(Object::new(*index, *sub), *kind, *access, *mappable, *default);
        }
        for (index, text) in
            [(0x1008, "PRL+ virtual"), (0x1009, "virtual"), (0x100A, "Schunk_0_63 virtual arm")]
        {
            made.add(Object::new(index, 0), Type::Text, Access::Ro, false, 0);
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

    /// The communication objects 0x1000 to 0x1FFF.
    fn communication(&mut self, node: u32, identity: Identity) {
        use Access::{Ro, Rw};
        let mut add = |index, sub, kind, access, default: u32| {
            self.add(Object::new(index, sub), kind, access, false, i64::from(default));
        };
        // Device type: CiA 402, servo drive.
        add(0x1000, 0, U32, Ro, 0x0002_0192);
        add(0x1001, 0, U8, Ro, 0);
        add(0x1002, 0, U32, Ro, 0);
        add(0x1003, 0, U8, Rw, 0);
        add(0x1003, 1, U32, Ro, 0);
        add(0x1003, 2, U32, Ro, 0);
        add(0x1005, 0, U32, Rw, 0x80);
        add(0x100C, 0, U16, Rw, 0);
        add(0x100D, 0, U8, Rw, 0);
        add(0x1014, 0, U32, Rw, 0x80 + node);
        add(0x1016, 0, U8, Ro, 3);
        (1..=3).for_each(|sub| add(0x1016, sub, U32, Rw, 0));
        add(0x1017, 0, U16, Rw, 0);
        add(0x1018, 0, U8, Ro, 4);
        let Identity { vendor, product, revision, serial } = identity;
        (1..)
            .zip([vendor, product, revision, serial])
            .for_each(|(sub, value)| add(0x1018, sub, U32, Ro, value));
        add(0x1200, 0, U8, Ro, 2);
        add(0x1200, 1, U32, Ro, 0x600 + node);
        add(0x1200, 2, U32, Ro, 0x580 + node);
        for k in 0..2 {
            add(0x1400 + k, 0, U8, Ro, 2);
            add(0x1400 + k, 1, U32, Rw, 0x200 + 0x100 * u32::from(k) + node);
            add(0x1400 + k, 2, U8, Rw, 255);
        }
        for k in 0..4 {
            add(0x1800 + k, 0, U8, Ro, 5);
            add(0x1800 + k, 1, U32, Rw, 0x180 + 0x100 * u32::from(k) + node);
            add(0x1800 + k, 2, U8, Rw, if k == 3 { 254 } else { 1 });
            add(0x1800 + k, 5, U16, Rw, 0);
        }
        for (index, mapped) in DEFAULT_MAPPINGS {
            add(index, 0, U8, Rw, mapped.len() as u32);
            let padded = mapped.iter().copied().chain(std::iter::repeat(0));
            (1..=8).zip(padded).for_each(|(sub, entry)| add(index, sub, U32, Rw, entry));
        }
    }

    /// Adds an object, as a profile may that knows more than the DCF.
    pub fn add(&mut self, object: Object, kind: Type, access: Access, mappable: bool, default: i64) {
        let range = match kind {
            Type::Signed(size) => [-(1i64 << (8 * size - 1)), (1i64 << (8 * size - 1)) - 1],
            Type::Unsigned(size) => [0, (1i64 << (8 * size)) - 1],
            Type::Real | Type::Text => [i64::MIN, i64::MAX],
        };
        let value = match kind {
            Type::Real => Value::Real(default as f32),
            Type::Text => Value::Text(String::new()),
            _ => Value::Number(default),
        };
        let entry = Entry { object, kind, access, mappable, range, value };
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
            entry.value = Value::Real(number);
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
        if entry.access == Access::Wo {
            return Err(AbortCode::WRITE_ONLY);
        }
        Ok(match &entry.value {
            Value::Number(number) => number.to_le_bytes()[..entry.kind.size().unwrap_or(0)].to_vec(),
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
        if entry.access == Access::Ro {
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
        let raw = bytes.iter().rev().fold(0u32, |sum, byte| sum << 8 | u32::from(*byte));
        let number = match entry.kind {
            Type::Real => return Ok(Value::Real(f32::from_bits(raw))),
            Type::Signed(size) => i64::from(crate::canopen::pdo::sign_extend(raw, 8 * size)),
            _ => i64::from(raw),
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
