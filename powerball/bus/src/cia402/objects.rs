//! The objects of the drive profile (0x6000 …) that this arm has.

use crate::canopen::Object;

const fn o(index: u16, sub: u8) -> Object {
    Object::new(index, sub)
}

/// Controlword, u16.
pub const CONTROLWORD: Object = o(0x6040, 0);
/// Statusword, u16.
pub const STATUSWORD: Object = o(0x6041, 0);
/// Target velocity of mode VL, i16, in units of the dimension factor 0x604C.
pub const VL_TARGET_VELOCITY: Object = o(0x6042, 0);
/// Numerator of the dimension factor, i32.
pub const VL_FACTOR_NUMERATOR: Object = o(0x604C, 1);
/// Denominator of the dimension factor, i32.
pub const VL_FACTOR_DENOMINATOR: Object = o(0x604C, 2);
/// Mode of operation, i8.
pub const MODE: Object = o(0x6060, 0);
/// Mode of operation that the drive is in, i8.
pub const MODE_DISPLAY: Object = o(0x6061, 0);
/// Position demand, i32, mdeg.
pub const POSITION_DEMAND: Object = o(0x6062, 0);
/// Actual position, i32, mdeg.
pub const POSITION: Object = o(0x6064, 0);
/// Following error window, u32, mdeg.
pub const FOLLOWING_ERROR_WINDOW: Object = o(0x6065, 0);
/// Time beyond the window after which a following error is one, u16, ms.
pub const FOLLOWING_ERROR_TIME: Object = o(0x6066, 0);
/// Velocity demand, i32, mdeg/s.
pub const VELOCITY_DEMAND: Object = o(0x606B, 0);
/// Actual velocity, i32, mdeg/s.
pub const VELOCITY: Object = o(0x606C, 0);
/// Maximum current, u16, per mille of the rated current.
pub const MAX_CURRENT: Object = o(0x6073, 0);
/// Rated current, u32, mA.
pub const RATED_CURRENT: Object = o(0x6075, 0);
/// Actual torque (here: current), i16, per mille of rated.
pub const TORQUE: Object = o(0x6077, 0);
/// Target position of profile position, i32, mdeg.
pub const TARGET_POSITION: Object = o(0x607A, 0);
/// Lower software position limit, i32, mdeg.
pub const POSITION_LIMIT_MIN: Object = o(0x607D, 1);
/// Upper software position limit, i32, mdeg.
pub const POSITION_LIMIT_MAX: Object = o(0x607D, 2);
/// Profile velocity, u32, mdeg/s.
pub const PROFILE_VELOCITY: Object = o(0x6081, 0);
/// Profile acceleration, u32, mdeg/s².
pub const PROFILE_ACCELERATION: Object = o(0x6083, 0);
/// Torque offset (feed-forward), i16, per mille of rated.
pub const TORQUE_OFFSET: Object = o(0x60B2, 0);
/// Interpolation sub-mode, i16; 0 is linear.
pub const INTERPOLATION_SUB_MODE: Object = o(0x60C0, 0);
/// Interpolation set-point, i32, mdeg.
pub const INTERPOLATION_SETPOINT: Object = o(0x60C1, 1);
/// Interpolation period, u8, in units of 10^(sub 2) s.
pub const INTERPOLATION_PERIOD: Object = o(0x60C2, 1);
/// Power of ten of the interpolation period, i8.
pub const INTERPOLATION_PERIOD_EXPONENT: Object = o(0x60C2, 2);
/// Following error, i32, mdeg.
pub const FOLLOWING_ERROR: Object = o(0x60F4, 0);
/// Physical outputs, u32; on this arm bit 0: 1 closes the brake, 0 releases it.
pub const OUTPUTS: Object = o(0x60FE, 1);
/// Supported drive modes, u32.
pub const SUPPORTED_MODES: Object = o(0x6502, 0);
