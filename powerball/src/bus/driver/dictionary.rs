//! The drive's object dictionary as a constant table, made from its DCF.

use crate::bus::canopen::Object;

/// Data types of CiA 301 that the table needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// u8.
    Unsigned8,
    /// u16.
    Unsigned16,
    /// u32.
    Unsigned32,
    /// i8.
    Integer8,
    /// i16.
    Integer16,
    /// i32.
    Integer32,
    /// f32.
    Real32,
    /// Text.
    VisibleString,
    /// Bytes.
    OctetString,
}

impl DataType {
    /// Bytes of a number, or `None` for text and bytes.
    pub const fn size(self) -> Option<usize> {
        match self {
            DataType::Unsigned8 | DataType::Integer8 => Some(1),
            DataType::Unsigned16 | DataType::Integer16 => Some(2),
            DataType::Unsigned32 | DataType::Integer32 | DataType::Real32 => Some(4),
            DataType::VisibleString | DataType::OctetString => None,
        }
    }

    /// Whether the number has a sign.
    pub const fn is_signed(self) -> bool {
        matches!(self, DataType::Integer8 | DataType::Integer16 | DataType::Integer32)
    }
}

/// One variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Where.
    pub object: Object,
    /// What.
    pub data_type: DataType,
    /// Whether it can be read.
    pub readable: bool,
    /// Whether it can be written.
    pub writable: bool,
    /// Whether it can be in a PDO.
    pub mappable: bool,
    /// Value after power-up, less the node's number where `plus_node` says so.
    pub default: Option<i64>,
    /// Whether the node's number is added to the default.
    pub plus_node: bool,
    /// Its name.
    pub name: &'static str,
}

/// What may be done with a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Only read.
    ReadOnly,
    /// Only written.
    WriteOnly,
    /// Both.
    ReadWrite,
}

impl Entry {
    /// A variable that cannot be mapped and whose value after power-up is not known.
    pub const fn new(index: u16, sub: u8, data_type: DataType, access: Access, name: &'static str) -> Entry {
        Entry {
            object: Object::new(index, sub),
            data_type,
            readable: !matches!(access, Access::WriteOnly),
            writable: !matches!(access, Access::ReadOnly),
            mappable: false,
            default: None,
            plus_node: false,
            name,
        }
    }

    /// The same, which can be in a PDO.
    pub const fn mapped(self) -> Entry {
        Entry { mappable: true, ..self }
    }

    /// The same with its value after power-up.
    pub const fn default(self, value: i64) -> Entry {
        Entry { default: Some(value), ..self }
    }

    /// The same with its value after power-up, to which the node's number is added.
    pub const fn default_plus_node(self, value: i64) -> Entry {
        Entry { default: Some(value), plus_node: true, ..self }
    }
}

/// The entry of `object` in a table that is sorted by object.
pub fn find(table: &'static [Entry], object: Object) -> Option<&'static Entry> {
    table.binary_search_by_key(&object, |entry| entry.object).ok().and_then(|at| table.get(at))
}
