//! Addresses in an object dictionary, and the communication objects that a master needs.

use core::fmt;

/// An entry of an object dictionary: index and sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Object {
    /// 0x0000 … 0xFFFF.
    pub index: u16,
    /// 0 for a plain variable.
    pub sub: u8,
}

impl Object {
    /// Entry `index`:`sub`.
    pub const fn new(index: u16, sub: u8) -> Object {
        Object { index, sub }
    }
}

/// `0x6041:0`.
impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}:{}", self.index, self.sub)
    }
}

const fn o(index: u16, sub: u8) -> Object {
    Object::new(index, sub)
}

/// Device type, u32.
pub const DEVICE_TYPE: Object = o(0x1000, 0);
/// Error register, u8.
pub const ERROR_REGISTER: Object = o(0x1001, 0);
/// Manufacturer status register, u32; SCHUNK: lowest byte its error code, next byte the class.
pub const MANUFACTURER_STATUS: Object = o(0x1002, 0);
/// Number of past errors; writing 0 clears them.
pub const ERROR_HISTORY: Object = o(0x1003, 0);
/// COB-ID of SYNC, u32.
pub const SYNC_COB_ID: Object = o(0x1005, 0);
/// Device name, string.
pub const DEVICE_NAME: Object = o(0x1008, 0);
/// Hardware version, string.
pub const HARDWARE_VERSION: Object = o(0x1009, 0);
/// Software version, string.
pub const SOFTWARE_VERSION: Object = o(0x100A, 0);
/// First heartbeat that the node consumes, u32: (node << 16) + ms.
pub const CONSUMER_HEARTBEAT: Object = o(0x1016, 1);
/// Period of the node's own heartbeat, u16, ms.
pub const PRODUCER_HEARTBEAT: Object = o(0x1017, 0);
/// Vendor, u32; subs 2, 3, 4 are product, revision, serial number.
pub const VENDOR_ID: Object = o(0x1018, 1);
/// Product code, u32.
pub const PRODUCT_CODE: Object = o(0x1018, 2);
/// Revision, u32.
pub const REVISION: Object = o(0x1018, 3);
/// Serial number, u32.
pub const SERIAL_NUMBER: Object = o(0x1018, 4);

/// Parameters of receive PDO `number` (1 …): sub 1 COB-ID, sub 2 transmission type.
pub const fn rpdo_parameter(number: u8, sub: u8) -> Object {
    o(0x1400 + number as u16 - 1, sub)
}

/// Mapping of receive PDO `number` (1 …): sub 0 count, subs 1 … 8 entries.
pub const fn rpdo_mapping(number: u8, sub: u8) -> Object {
    o(0x1600 + number as u16 - 1, sub)
}

/// Parameters of transmit PDO `number` (1 …): sub 1 COB-ID, sub 2 transmission type.
pub const fn tpdo_parameter(number: u8, sub: u8) -> Object {
    o(0x1800 + number as u16 - 1, sub)
}

/// Mapping of transmit PDO `number` (1 …): sub 0 count, subs 1 … 8 entries.
pub const fn tpdo_mapping(number: u8, sub: u8) -> Object {
    o(0x1A00 + number as u16 - 1, sub)
}
