//! The drive's object dictionary as a constant table, made from its DCF.

use crate::canopen::Object;

/// Data types of CiA 301.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// u8.
    Unsigned8,
    /// u16.
    Unsigned16,
    /// u32.
    Unsigned32,
    /// Unsigned, three bytes.
    Unsigned24,
    /// Unsigned, five bytes.
    Unsigned40,
    /// Unsigned, six bytes; also times.
    Unsigned48,
    /// Unsigned, seven bytes.
    Unsigned56,
    /// u64.
    Unsigned64,
    /// i8.
    Integer8,
    /// i16.
    Integer16,
    /// i32.
    Integer32,
    /// Signed, three bytes.
    Integer24,
    /// Signed, five bytes.
    Integer40,
    /// Signed, six bytes.
    Integer48,
    /// Signed, seven bytes.
    Integer56,
    /// i64.
    Integer64,
    /// f32.
    Real32,
    /// f64.
    Real64,
    /// Text.
    VisibleString,
    /// Bytes.
    OctetString,
    /// Text of two bytes a letter.
    UnicodeString,
    /// Bytes in a form of the maker's own, such as a program.
    Domain,
}

impl DataType {
    /// Bytes of a number, or `None` for text and bytes.
    pub const fn size(self) -> Option<usize> {
        match self {
            DataType::Unsigned8 | DataType::Integer8 => Some(1),
            DataType::Unsigned16 | DataType::Integer16 => Some(2),
            DataType::Unsigned24 | DataType::Integer24 => Some(3),
            DataType::Unsigned32 | DataType::Integer32 | DataType::Real32 => Some(4),
            DataType::Unsigned40 | DataType::Integer40 => Some(5),
            DataType::Unsigned48 | DataType::Integer48 => Some(6),
            DataType::Unsigned56 | DataType::Integer56 => Some(7),
            DataType::Unsigned64 | DataType::Integer64 | DataType::Real64 => Some(8),
            DataType::VisibleString | DataType::OctetString | DataType::UnicodeString | DataType::Domain => {
                None
            }
        }
    }

    /// Whether the number has a sign.
    pub const fn is_signed(self) -> bool {
        matches!(
            self,
            DataType::Integer8
                | DataType::Integer16
                | DataType::Integer24
                | DataType::Integer32
                | DataType::Integer40
                | DataType::Integer48
                | DataType::Integer56
                | DataType::Integer64
        )
    }
}

/// One variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Where.
    pub object: Object,
    /// Data type of the object.
    pub data_type: DataType,
    /// Whether it can be read.
    pub readable: bool,
    /// Whether it can be written.
    pub writable: bool,
    /// Whether it can be in a PDO.
    pub mappable: bool,
    /// Value after power-up of a whole number, less the node's number where `plus_node` says so. An
    /// [`DataType::Unsigned64`] above `i64::MAX` is here with the same bits.
    pub default: Option<i64>,
    /// Whether the node's number is added to the default.
    pub plus_node: bool,
    /// The object's name.
    pub name: &'static str,
}

/// Access rights of a variable.
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

    /// Marks this entry as one that can be mapped to a PDO.
    pub const fn mapped(self) -> Entry {
        Entry { mappable: true, ..self }
    }

    /// Sets the value of this entry after power-up.
    pub const fn default(self, value: i64) -> Entry {
        Entry { default: Some(value), ..self }
    }

    /// Sets the value of this entry after power-up, to which the node's number is added.
    pub const fn default_plus_node(self, value: i64) -> Entry {
        Entry { default: Some(value), plus_node: true, ..self }
    }
}

/// The entry of `object` in a table that is sorted by object.
pub fn find(table: &'static [Entry], object: Object) -> Option<&'static Entry> {
    table.binary_search_by_key(&object, |entry| entry.object).ok().and_then(|at| table.get(at))
}
