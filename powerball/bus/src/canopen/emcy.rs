//! Emergency messages, the standard's codes and SCHUNK's own in words.

use super::{Cob, Frame, NodeId};
use core::fmt;

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Emcy {
    /// Error code (CiA 301, CiA 402); 0 says that the error is gone.
    pub code: u16,
    /// The error register 0x1001.
    pub register: u8,
    /// Five bytes of the vendor's.
    pub vendor: [u8; 5],
}

impl Emcy {
    /// The message of `node` as a frame.
    pub const fn frame(self, node: NodeId) -> Frame {
        let [low, high] = self.code.to_le_bytes();
        let [a, b, c, d, e] = self.vendor;
        Frame::fixed(Cob::Emcy(node).id(), [low, high, self.register, a, b, c, d, e])
    }

    /// Node and message in `frame`; `None` if it is not an emergency, or does not have eight bytes.
    pub fn decode(frame: &Frame) -> Option<(NodeId, Emcy)> {
        match (Cob::of(frame)?, frame.bytes()) {
            (Cob::Emcy(node), &[low, high, register, a, b, c, d, e]) => {
                let code = u16::from_le_bytes([low, high]);
                Some((node, Emcy { code, register, vendor: [a, b, c, d, e] }))
            }
            _ => None,
        }
    }

    /// Whether this says that the error is gone.
    pub const fn is_reset(self) -> bool {
        self.code == 0
    }
}

impl fmt::Display for Emcy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "EMCY 0x{:04X} ({}), register 0x{:02X}", self.code, text(self.code), self.register)
    }
}

/// The meaning of a code of CiA 301 or CiA 402, the more specific first. This arm sends 0x3222 most often:
/// its supply voltage sags.
pub const fn text(code: u16) -> &'static str {
    match code {
        0x0000 => "error gone",
        0x2220..=0x2222 => "continuous over-current in the device",
        0x2310..=0x2312 => "continuous over-current at the output",
        0x2320 | 0x2340 => "short circuit or earth leakage at the output",
        0x2350..=0x2352 => "load level fault (I²t)",
        0x3110..=0x311F => "mains over-voltage",
        0x3120..=0x312F => "mains under-voltage",
        0x3210..=0x3212 => "DC-link over-voltage",
        0x3220 | 0x3221 => "DC-link under-voltage",
        0x3222 => "DC-link voltage low: the motor supply sags or is off",
        0x4110 | 0x4120 => "ambient temperature out of range",
        0x4210 => "device too hot",
        0x4220 => "device too cold",
        0x4310 => "drive too hot",
        0x5400..=0x54FF => "power section hardware",
        0x5530 => "data storage (EEPROM)",
        0x6010 => "software reset (watchdog)",
        0x6320 => "parameter error",
        0x7110..=0x711F => "brake chopper",
        0x7121 => "motor blocked",
        0x7122 => "motor or commutation fault",
        0x7120..=0x712F => "motor fault",
        0x7300..=0x73FF => "sensor fault",
        0x7500..=0x75FF => "communication (internal)",
        0x8100 => "communication",
        0x8110 => "CAN overrun: messages lost",
        0x8120 => "CAN error passive",
        0x8130 => "heartbeat or life guard lost",
        0x8140 => "recovered from bus-off",
        0x8150 => "CAN identifier collision",
        0x8200 => "protocol",
        0x8210 => "PDO not processed: wrong length",
        0x8220 => "PDO longer than mapped",
        0x8240 => "SYNC of unexpected length",
        0x8250 => "RPDO timeout",
        0x8611 => "following error too large",
        0x8612 => "reference limit",
        0x9000..=0x90FF => "external error",
        0xFF00..=0xFFFF => "device specific",
        other => match other >> 12 {
            0x1 => "generic error",
            0x2 => "current",
            0x3 => "voltage",
            0x4 => "temperature",
            0x5 => "device hardware",
            0x6 => "device software",
            0x7 => "additional modules",
            0x8 => "monitoring",
            0x9 => "external error",
            _ => "unknown code",
        },
    }
}

/// Class of a SCHUNK code: second byte of the manufacturer status register 0x1002.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VendorClass {
    /// 0x88: an error; the module stopped.
    Error,
    /// 0x89: a warning.
    Warning,
    /// 0x8A: an information.
    Info,
    /// Anything else.
    Unknown(u8),
}

/// SCHUNK's code and its class in the manufacturer status register 0x1002.
pub const fn vendor_status(register: u32) -> (u8, VendorClass) {
    let [code, class, ..] = register.to_le_bytes();
    let class = match class {
        0x88 => VendorClass::Error,
        0x89 => VendorClass::Warning,
        0x8A => VendorClass::Info,
        other => VendorClass::Unknown(other),
    };
    (code, class)
}

/// The meaning of SCHUNK's own code (0x70 … 0xED in errors), or `None` if it was never published.
///
/// The list of names is public in MobileRobots/libPowerballArm, `schunkErrors.h`; the words are ours.
pub const fn vendor_text(code: u8) -> Option<&'static str> {
    Some(match code {
        0x00 => "no error",
        0x70 => "module too cold",
        0x71 => "module too hot",
        0x72 => "logic voltage too low",
        0x73 => "logic voltage too high",
        0x74 => "motor voltage too low",
        0x75 => "motor voltage too high",
        0x76 => "cable break",
        0x77 => "motor voltage short circuit",
        0x78 => "motor too hot",
        0x79 => "brake voltage",
        0x7A => "life sign lost",
        0x7B => "custom defined error",
        0x80 => "power stage too hot",
        0x81 => "brake resistor too hot",
        0x82 => "overshoot",
        0x83 => "wrong hardware version",
        0x84 => "wrong software version",
        0xB0 => "program aborted",
        0xB1 => "program run-time error",
        0xB2 => "program invalid",
        0xB3 => "program conflict",
        0xC8 => "wrong ramp type",
        0xD1 => "wrong direction",
        0xD2 => "configuration memory",
        0xD3 => "program memory",
        0xD4 => "invalid phrase",
        0xD5 => "below the lower software limit",
        0xD6 => "above the upper software limit",
        0xD7 => "pressure",
        0xD8 => "service needed",
        0xD9 => "fast stop",
        0xDA => "following error (tow)",
        0xDB => "fieldbus chip",
        0xDC => "fragmentation: packets lost",
        0xDD => "commutation failed",
        0xDE => "current too high",
        0xDF => "I²t: overload",
        0xE0 => "initialisation failed",
        0xE1 => "internal error",
        0xE2 => "lower hardware limit",
        0xE3 => "upper hardware limit",
        0xE4 => "too fast",
        0xE5 => "position system",
        0xE6 => "analog input",
        0xE7 => "flash memory",
        0xE8 => "limiter active",
        0xE9 => "stop command timed out",
        0xEA => "unexpected stop",
        0xEB => "resolver check failed",
        0xEC => "arithmetic error",
        0xED => "left the master",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_survives_the_wire() {
        let node = NodeId::clamped(4);
        let emcy = Emcy { code: 0x3222, register: 0x05, vendor: [1, 2, 3, 4, 5] };
        let frame = emcy.frame(node);
        assert_eq!(frame.to_string(), "084#2232050102030405");
        assert_eq!(Emcy::decode(&frame), Some((node, emcy)));
        assert_eq!(Emcy::decode(&frame.truncated(7)), None);
    }

    #[test]
    fn sync_is_no_emergency() {
        assert_eq!(Emcy::decode(&super::super::cob::SYNC), None);
    }

    #[test]
    fn vendor_codes_are_in_words() {
        assert_eq!(vendor_status(0x0000_88DD), (0xDD, VendorClass::Error));
        assert_eq!(vendor_text(0xDD), Some("commutation failed"));
        assert_eq!(vendor_text(0x99), None);
        assert!(text(0x3222).contains("DC-link"));
    }
}
