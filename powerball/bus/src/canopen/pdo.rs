//! Process data: mapping entries, packing and unpacking.

use super::Object;
use core::fmt;

/// One mapped object with its size: the u32 of the mapping objects 0x1600 … and 0x1A00 ….
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Entry {
    /// The mapped object.
    pub object: Object,
    /// The object's size in bits: 8, 16, 24 or 32 on this arm (granularity 8).
    pub bits: u8,
}

impl Entry {
    /// `object` of `bits` bits.
    pub const fn new(object: Object, bits: u8) -> Entry {
        Entry { object, bits }
    }

    /// The entry as the mapping object stores it: index, sub-index and number of bits, from the top.
    pub const fn to_u32(self) -> u32 {
        (self.object.index as u32) << 16 | (self.object.sub as u32) << 8 | self.bits as u32
    }

    /// An entry from a mapping object's value.
    pub const fn from_u32(raw: u32) -> Entry {
        Entry { object: Object::new((raw >> 16) as u16, (raw >> 8) as u8), bits: raw as u8 }
    }

    const fn bytes(self) -> usize {
        self.bits as usize / 8
    }
}

/// The reason why a mapping is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MappingError {
    /// More than eight objects.
    TooMany,
    /// More than eight bytes.
    TooLong,
    /// An object of other than 8, 16, 24 or 32 bits.
    Size(Entry),
}

impl fmt::Display for MappingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MappingError::TooMany => f.write_str("a PDO of this drive maps at most eight objects"),
            MappingError::TooLong => f.write_str("a PDO holds at most eight bytes"),
            MappingError::Size(entry) => {
                write!(f, "{} is mapped with {} bits; 8, 16, 24 or 32 can be", entry.object, entry.bits)
            }
        }
    }
}

impl core::error::Error for MappingError {}

/// The objects in one PDO, in order. Empty where the PDO is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapping {
    entries: [Entry; 8],
    count: u8,
}

const NOTHING: Entry = Entry::new(Object::new(0, 0), 0);

impl Mapping {
    /// No object.
    pub const EMPTY: Mapping = Mapping { entries: [NOTHING; 8], count: 0 };

    /// A mapping of `entries`.
    ///
    /// # Errors
    /// Where they do not fit into a PDO of eight objects and eight bytes.
    pub const fn new(entries: &[Entry]) -> Result<Mapping, MappingError> {
        let mut mapping = Mapping::EMPTY;
        if entries.len() > 8 {
            return Err(MappingError::TooMany);
        }
        let mut i = 0;
        while i < entries.len() {
            if !matches!(entries[i].bits, 8 | 16 | 24 | 32) {
                return Err(MappingError::Size(entries[i]));
            }
            mapping.entries[i] = entries[i];
            mapping.count += 1;
            i += 1;
        }
        if mapping.len() > 8 { Err(MappingError::TooLong) } else { Ok(mapping) }
    }

    /// A mapping of `entries`, for constant tables. It is empty if they do not fit, and the driver refuses a
    /// profile whose mapping lacks an object that it needs.
    pub const fn of(entries: &[Entry]) -> Mapping {
        match Mapping::new(entries) {
            Ok(mapping) => mapping,
            Err(_) => Mapping::EMPTY,
        }
    }

    /// The mapped objects.
    pub fn entries(&self) -> &[Entry] {
        self.entries.get(..usize::from(self.count)).unwrap_or(&[])
    }

    /// Bytes of a frame with this mapping.
    pub const fn len(&self) -> usize {
        let (mut sum, mut i) = (0, 0);
        // Those that are not used have no bytes.
        while i < self.entries.len() {
            sum += self.entries[i].bytes();
            i += 1;
        }
        sum
    }

    /// Whether nothing is mapped.
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Whether `object` is mapped.
    pub fn contains(&self, object: Object) -> bool {
        self.entries().iter().any(|entry| entry.object == object)
    }

    /// Bytes of a frame, each object's value taken from `value` and cut to its size (two's complement, little
    /// endian). The length is [`Mapping::len`].
    pub fn pack(&self, mut value: impl FnMut(Object) -> i64) -> ([u8; 8], usize) {
        let (mut bytes, mut at) = ([0; 8], 0);
        for entry in self.entries() {
            let source = value(entry.object).to_le_bytes();
            for (target, byte) in bytes.iter_mut().skip(at).zip(source).take(entry.bytes()) {
                *target = byte;
            }
            at += entry.bytes();
        }
        (bytes, at.min(8))
    }

    /// Each object with its raw value (not sign extended: the caller that mapped it knows its type; see
    /// [`sign_extend`]). `None` if `bytes` does not have exactly the mapped length.
    pub fn unpack<'a>(&'a self, bytes: &'a [u8]) -> Option<impl Iterator<Item = (Entry, u32)> + 'a> {
        if bytes.len() != self.len() {
            return None;
        }
        let mut rest = bytes;
        Some(self.entries().iter().map(move |entry| {
            let (own, behind) = rest.split_at_checked(entry.bytes()).unwrap_or((rest, &[]));
            rest = behind;
            (*entry, own.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)))
        }))
    }
}

/// `raw` of `bits` bits as a signed number.
pub const fn sign_extend(raw: u32, bits: u8) -> i32 {
    if bits == 0 || bits >= 32 {
        return raw as i32;
    }
    let shift = 32 - bits as u32;
    (raw << shift) as i32 >> shift
}

/// In a PDO's COB-ID object: this PDO is not used.
pub const INVALID: u32 = 0x8000_0000;

/// Transmission type: with every SYNC.
pub const EVERY_SYNC: u8 = 1;

#[cfg(test)]
mod tests {
    use super::*;

    const STATUSWORD: Entry = Entry::new(Object::new(0x6041, 0), 16);
    const TORQUE: Entry = Entry::new(Object::new(0x6077, 0), 16);
    const POSITION: Entry = Entry::new(Object::new(0x6064, 0), 32);

    #[test]
    fn entries_are_the_dcfs_numbers() {
        assert_eq!(POSITION.to_u32(), 0x6064_0020);
        assert_eq!(Entry::from_u32(0x60C1_0120), Entry::new(Object::new(0x60C1, 1), 32));
    }

    #[test]
    fn packing_and_unpacking_are_inverse_with_signs() {
        let mapping = Mapping::new(&[STATUSWORD, TORQUE, POSITION]).unwrap();
        let (bytes, len) = mapping.pack(|object| match object.index {
            0x6041 => 0x1237,
            0x6077 => -5,
            _ => -170_000,
        });
        assert_eq!((len, mapping.len()), (8, 8));
        let values: Vec<_> =
            mapping.unpack(&bytes[..len]).unwrap().map(|(e, raw)| sign_extend(raw, e.bits)).collect();
        assert_eq!(values, [0x1237, -5, -170_000]);
    }

    #[test]
    fn a_frame_of_another_length_is_not_unpacked() {
        let mapping = Mapping::new(&[STATUSWORD]).unwrap();
        assert!(mapping.unpack(&[1]).is_none());
        assert!(mapping.unpack(&[1, 2, 3]).is_none());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert_eq!(Mapping::new(&[POSITION, POSITION, TORQUE]), Err(MappingError::TooLong));
        assert_eq!(Mapping::new(&[Entry::new(Object::new(1, 0), 8); 9]), Err(MappingError::TooMany));
        let bit = Entry::new(Object::new(1, 0), 1);
        assert_eq!(Mapping::new(&[bit]), Err(MappingError::Size(bit)));
    }
}
