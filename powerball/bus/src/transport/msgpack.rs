//! The datagrams of python-can's `udp_multicast`: one MessagePack map for each frame. The same functions read
//! a recording of such a bus (a capture of its network).

use crate::canopen::Frame;
use serde::{Deserialize, Serialize};

/// The fields of a frame that python-can writes, in its order.
#[derive(Serialize)]
struct Sent<'a> {
    timestamp: f64,
    arbitration_id: u16,
    is_extended_id: bool,
    is_remote_frame: bool,
    is_error_frame: bool,
    channel: Option<()>,
    dlc: u8,
    #[serde(serialize_with = "as_bytes")]
    data: &'a [u8],
    is_fd: bool,
    bitrate_switch: bool,
    error_state_indicator: bool,
}

fn as_bytes<S: serde::Serializer>(data: &[u8], to: S) -> Result<S::Ok, S::Error> {
    to.serialize_bytes(data)
}

/// The fields that are needed to make a frame.
#[derive(Deserialize)]
struct Heard<'a> {
    arbitration_id: u16,
    #[serde(borrow)]
    data: &'a [u8],
    #[serde(default)]
    is_extended_id: bool,
    #[serde(default)]
    is_remote_frame: bool,
    #[serde(default)]
    is_error_frame: bool,
    #[serde(default)]
    is_fd: bool,
}

/// A frame as the map that python-can writes, `timestamp` in s.
#[must_use]
pub fn encode(frame: &Frame, timestamp: f64) -> Vec<u8> {
    let bytes = frame.bytes();
    let sent = Sent {
        timestamp,
        arbitration_id: frame.raw_id(),
        is_extended_id: false,
        is_remote_frame: false,
        is_error_frame: false,
        channel: None,
        dlc: bytes.len() as u8,
        data: bytes,
        is_fd: false,
        bitrate_switch: false,
        error_state_indicator: false,
    };
    // A Vec takes every write, and the map has a known length.
    rmp_serde::to_vec_named(&sent).unwrap_or_default()
}

/// The frame in a datagram; `None` for what is not a classic data frame with an 11-bit identifier.
#[must_use]
pub fn decode(bytes: &[u8]) -> Option<Frame> {
    let heard: Heard<'_> = rmp_serde::from_slice(bytes).ok()?;
    let other = [heard.is_extended_id, heard.is_remote_frame, heard.is_error_frame, heard.is_fd];
    if other.contains(&true) {
        return None;
    }
    Frame::from_raw(heard.arbitration_id, heard.data)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by python-can 4.6 for 0x123 with the bytes 1, 2, 3.
    const PYTHON: &[u8] = b"\x8b\xa9timestamp\xcb\x41\xda\x48\x35\xf9\x40\x00\x00\xaearbitration_id\xcd\x01\x23\
        \xaeis_extended_id\xc2\xafis_remote_frame\xc2\xaeis_error_frame\xc2\xa7channel\xc0\xa3dlc\x03\xa4data\xc4\
        \x03\x01\x02\x03\xa5is_fd\xc2\xaebitrate_switch\xc2\xb5error_state_indicator\xc2";

    /// A datagram with bytes changed, lost and doubled: a frame or nothing, and a frame is one that can be
    /// sent on.
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
