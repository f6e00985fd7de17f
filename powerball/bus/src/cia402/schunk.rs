//! SCHUNK's own objects (0x2000 …) that the master needs, from the drive's DCF.

use crate::canopen::Object;

/// Details of the last error: sub 1 a number (f32), sub 2 the firmware's file (string), sub 3 the line (u16).
pub const ERROR_DETAIL: Object = Object::new(0x200B, 1);
/// File of the last error, string.
pub const ERROR_FILE: Object = Object::new(0x200B, 2);
/// Line of the last error, u16.
pub const ERROR_LINE: Object = Object::new(0x200B, 3);
/// Temperature of the board, f32, °C.
pub const BOARD_TEMPERATURE: Object = Object::new(0x200D, 1);
/// Cycles without a fresh interpolation point before the drive stops quickly, u8; 0 never.
pub const SYNC_TIMEOUT_FACTOR: Object = Object::new(0x200E, 0);
/// Extended status, u8: see [`COMMUTATED`] and [`POSITION_VERIFIED`].
pub const EXTENDED_STATUS: Object = Object::new(0x2050, 0);
/// In the extended status: the commutation search is done.
pub const COMMUTATED: u8 = 1 << 0;
/// In the extended status: the pseudo-absolute position is verified.
pub const POSITION_VERIFIED: u8 = 1 << 1;
