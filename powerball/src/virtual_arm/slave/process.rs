//! The drive's process data: communication and mapping objects with the device's own rules.
//!
//! As on the real drive a PDO is changed in pre-operational only, after its COB-ID was made invalid; its
//! mapping only while it maps nothing.

use super::dictionary::Dictionary;
use crate::bus::canopen::pdo::{Entry, INVALID, Mapping};
use crate::bus::canopen::sdo::AbortCode;
use crate::bus::canopen::{Frame, Object};

/// Receive PDOs of the drive.
pub(super) const RECEIVE: u16 = 2;
/// Transmit PDOs of the drive.
pub(super) const TRANSMIT: u16 = 4;

/// Whether an object describes a PDO, and may be written as the rules say.
///
/// # Errors
/// Where a rule forbids it.
pub(super) fn check(
    dictionary: &Dictionary,
    object: Object,
    value: i64,
    pre_operational: bool,
) -> Result<(), AbortCode> {
    let (parameter, receive) = match object.index {
        0x1400..=0x1403 | 0x1600..=0x1603 => (0x1400 + (object.index & 3), true),
        0x1800..=0x1803 | 0x1A00..=0x1A03 => (0x1800 + (object.index & 3), false),
        _ => return Ok(()),
    };
    if !pre_operational {
        return Err(AbortCode::DEVICE_STATE);
    }
    let cob = dictionary.get(Object::new(parameter, 1)) as u32;
    let valid = cob & INVALID == 0;
    if object.index == parameter {
        return match object.sub {
            // The identifier may only change while the PDO is or becomes invalid.
            1 if valid && value as u32 & INVALID == 0 && value as u32 != cob => Err(AbortCode::VALUE),
            1 if value & 0x2000_0000 != 0 => Err(AbortCode::VALUE),
            2 if (241..=251).contains(&value) => Err(AbortCode::VALUE),
            _ => Ok(()),
        };
    }
    let count = dictionary.get(Object::new(object.index, 0));
    if valid {
        return Err(AbortCode::DEVICE_STATE);
    }
    match object.sub {
        0 => mapping_of(dictionary, object.index, value).map(|_| ()),
        _ if count != 0 => Err(AbortCode::DEVICE_STATE),
        _ => mappable(dictionary, Entry::from_u32(value as u32), receive),
    }
}

fn mappable(dictionary: &Dictionary, entry: Entry, receive: bool) -> Result<(), AbortCode> {
    let target = dictionary.entry(entry.object)?;
    let direction = if receive { target.writable } else { target.readable };
    let size = target.kind.size().is_some_and(|size| 8 * size == usize::from(entry.bits));
    if target.mappable && direction && size { Ok(()) } else { Err(AbortCode::NOT_MAPPABLE) }
}

fn mapping_of(dictionary: &Dictionary, index: u16, count: i64) -> Result<Mapping, AbortCode> {
    let entries: Vec<Entry> = (1..=count.clamp(0, 9) as u8)
        .map(|sub| Entry::from_u32(dictionary.get(Object::new(index, sub)) as u32))
        .collect();
    if entries.len() > 8 {
        return Err(AbortCode::VALUE);
    }
    Mapping::new(&entries).map_err(|_| AbortCode::PDO_LENGTH)
}

/// One PDO as it is set up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdo {
    /// Its identifier.
    pub(super) id: u16,
    /// Its transmission type.
    pub(super) kind: u8,
    /// Its objects.
    pub(super) mapping: Mapping,
}

/// The valid PDOs of a drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Pdos {
    pub(super) receive: Vec<Pdo>,
    pub(super) transmit: Vec<Pdo>,
}

impl Pdos {
    /// Reads them from the dictionary.
    pub(super) fn read(dictionary: &Dictionary) -> Self {
        let all = |base: u16, count: u16| {
            (0..count)
                .filter_map(|k| {
                    let cob = dictionary.get(Object::new(base + k, 1)) as u32;
                    let mapping = base + 0x200 + k;
                    let count = dictionary.get(Object::new(mapping, 0));
                    let mapping = mapping_of(dictionary, mapping, count).ok()?;
                    let kind = dictionary.get(Object::new(base + k, 2)) as u8;
                    let used = cob & INVALID == 0 && !mapping.is_empty();
                    used.then_some(Pdo { id: (cob & 0x7FF) as u16, kind, mapping })
                })
                .collect()
        };
        Pdos { receive: all(0x1400, RECEIVE), transmit: all(0x1800, TRANSMIT) }
    }
}

impl Pdo {
    /// The frame with the dictionary's present values.
    pub(super) fn frame(&self, dictionary: &Dictionary) -> Option<Frame> {
        let (bytes, len) = self.mapping.pack(|object| match dictionary.entry(object).map(|e| &e.value) {
            Ok(super::dictionary::Value::Number(number)) => *number,
            Ok(super::dictionary::Value::Real(number)) => i64::from(number.to_bits()),
            _ => 0,
        });
        Frame::from_raw(self.id, &bytes[..len])
    }

    /// Whether it goes out with this SYNC, the `count`-th since the drive went operational.
    pub(super) fn due(&self, count: u64) -> bool {
        (1..=240).contains(&self.kind) && count.is_multiple_of(u64::from(self.kind))
    }
}
