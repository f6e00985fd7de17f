//! The datagrams of python-can's `udp_multicast`: one MessagePack map for each frame. What is recorded of such a bus
//! (a capture of its network) is read by these as well.

use crate::bus::canopen::Frame;

/// A frame as the map that python-can writes, `timestamp` in s.
#[must_use]
pub fn encode(frame: &Frame, timestamp: f64) -> Vec<u8> {
    const FALSE: u8 = 0xC2;
    let mut out = vec![0x80 | 11];
    let key = |out: &mut Vec<u8>, name: &str| {
        out.push(0xA0 | name.len() as u8);
        out.extend(name.bytes());
    };
    key(&mut out, "timestamp");
    out.push(0xCB);
    out.extend(timestamp.to_be_bytes());
    key(&mut out, "arbitration_id");
    out.push(0xCD);
    out.extend(frame.raw_id().to_be_bytes());
    for name in ["is_extended_id", "is_remote_frame", "is_error_frame"] {
        key(&mut out, name);
        out.push(FALSE);
    }
    key(&mut out, "channel");
    out.push(0xC0);
    key(&mut out, "dlc");
    out.push(frame.bytes().len() as u8);
    key(&mut out, "data");
    out.extend([0xC4, frame.bytes().len() as u8]);
    out.extend(frame.bytes());
    for name in ["is_fd", "bitrate_switch", "error_state_indicator"] {
        key(&mut out, name);
        out.push(FALSE);
    }
    out
}

/// The frame in a datagram; `None` for what is no classic data frame with an 11-bit identifier.
#[must_use]
pub fn decode(bytes: &[u8]) -> Option<Frame> {
    let mut rest = bytes;
    let count = match next(&mut rest)? {
        Item::Map(count) => count,
        _ => return None,
    };
    let (mut id, mut data) = (None, None);
    for _ in 0..count {
        let Item::Bytes(name) = next(&mut rest)? else { return None };
        match (name, next(&mut rest)?) {
            (b"arbitration_id", Item::Integer(value)) => id = u16::try_from(value).ok(),
            (b"data", Item::Bytes(value)) => data = Some(value),
            (b"is_extended_id" | b"is_remote_frame" | b"is_error_frame" | b"is_fd", Item::Bool(true)) => {
                return None;
            }
            (_, Item::Map(_)) => return None,
            _ => {}
        }
    }
    Frame::from_raw(id?, data?)
}

/// What MessagePack writes, as far as a flat map needs it.
enum Item<'a> {
    Map(usize),
    Bytes(&'a [u8]),
    Integer(u64),
    Bool(bool),
    Other,
}

fn next<'a>(rest: &mut &'a [u8]) -> Option<Item<'a>> {
    let take = |rest: &mut &'a [u8], count: usize| -> Option<&'a [u8]> {
        let (head, tail) = rest.split_at_checked(count)?;
        *rest = tail;
        Some(head)
    };
    let number = |rest: &mut &'a [u8], count: usize| -> Option<u64> {
        Some(take(rest, count)?.iter().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    };
    let tag = *take(rest, 1)?.first()?;
    Some(match tag {
        0x00..=0x7F => Item::Integer(u64::from(tag)),
        0x80..=0x8F => Item::Map(usize::from(tag & 0x0F)),
        0xA0..=0xBF => Item::Bytes(take(rest, usize::from(tag & 0x1F))?),
        0xC2 | 0xC3 => Item::Bool(tag == 0xC3),
        // Bytes and strings, their length in one, two or four bytes.
        0xC4..=0xC6 | 0xD9..=0xDB => {
            let size = 1 << if tag < 0xD9 { tag - 0xC4 } else { tag - 0xD9 };
            let len = number(rest, size)?;
            Item::Bytes(take(rest, usize::try_from(len).ok()?)?)
        }
        0xCC..=0xCF => Item::Integer(number(rest, 1 << (tag - 0xCC))?),
        0xDE => Item::Map(number(rest, 2)? as usize),
        // Floats, negative numbers, nil: their length is all that matters.
        0xCA | 0xD2 => take(rest, 4).map(|_| Item::Other)?,
        0xCB | 0xD3 => take(rest, 8).map(|_| Item::Other)?,
        0xD0 => take(rest, 1).map(|_| Item::Other)?,
        0xD1 => take(rest, 2).map(|_| Item::Other)?,
        0xC0 | 0xE0..=0xFF => Item::Other,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by python-can 4.6 for 0x123 with the bytes 1, 2, 3.
    const PYTHON: &[u8] = b"\x8b\xa9timestamp\xcb\x41\xda\x48\x35\xf9\x40\x00\x00\xaearbitration_id\xcd\x01\x23\
        \xaeis_extended_id\xc2\xafis_remote_frame\xc2\xaeis_error_frame\xc2\xa7channel\xc0\xa3dlc\x03\xa4data\xc4\
        \x03\x01\x02\x03\xa5is_fd\xc2\xaebitrate_switch\xc2\xb5error_state_indicator\xc2";

    /// A datagram with bytes changed, lost and doubled: a frame or nothing, and a frame is one that can be sent on.
    #[test]
    fn mutated_datagrams_are_read_or_left() {
        let mut state = 1u64;
        let mut random = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let mut read = 0;
        for _ in 0..100_000 {
            let mut bytes = PYTHON.to_vec();
            for _ in 0..=random(4) {
                let at = random(bytes.len());
                match random(3) {
                    0 => bytes[at] = random(256) as u8,
                    1 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, random(256) as u8),
                }
            }
            if let Some(frame) = decode(&bytes) {
                read += 1;
                assert_eq!(decode(&encode(&frame, 0.0)), Some(frame));
            }
        }
        assert!(read > 1000, "{read}");
    }

    #[test]
    fn the_bytes_are_pythons() {
        let frame = Frame::from_raw(0x123, &[1, 2, 3]).unwrap();
        let timestamp = f64::from_be_bytes(PYTHON[12..20].try_into().unwrap());
        assert_eq!(encode(&frame, timestamp), PYTHON);
        assert_eq!(decode(PYTHON), Some(frame));
        assert_eq!(encode(&Frame::from_raw(0x123, &[0; 8]).unwrap(), 0.0).len(), 162);
    }

    #[test]
    fn what_is_torn_or_not_for_us_is_left_alone() {
        for len in 0..PYTHON.len() {
            assert_eq!(decode(&PYTHON[..len]), None);
        }
        let mut extended = PYTHON.to_vec();
        let at = PYTHON.windows(14).position(|w| w == b"is_extended_id").unwrap() + 14;
        extended[at] = 0xC3;
        assert_eq!(decode(&extended), None);
        assert_eq!(decode(b"\x81\xa3dlc\x03"), None);
    }
}
