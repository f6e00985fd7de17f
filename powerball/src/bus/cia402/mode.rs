//! Modes of operation: 0x6060, shown in 0x6061, offered in 0x6502.

use core::fmt;

/// A mode of operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// 0.
    None,
    /// 1, profile position.
    ProfilePosition,
    /// 2, velocity ("VL", frequency converters').
    Velocity,
    /// 3, profile velocity.
    ProfileVelocity,
    /// 4, profile torque.
    ProfileTorque,
    /// 6, homing.
    Homing,
    /// 7, interpolated position.
    InterpolatedPosition,
    /// 8, cyclic synchronous position.
    CyclicPosition,
    /// 9, cyclic synchronous velocity.
    CyclicVelocity,
    /// 10, cyclic synchronous torque.
    CyclicTorque,
    /// Any other number: the vendor's, where negative.
    Other(i8),
}

impl Mode {
    /// The mode's number in 0x6060 and 0x6061.
    pub const fn code(self) -> i8 {
        match self {
            Mode::None => 0,
            Mode::ProfilePosition => 1,
            Mode::Velocity => 2,
            Mode::ProfileVelocity => 3,
            Mode::ProfileTorque => 4,
            Mode::Homing => 6,
            Mode::InterpolatedPosition => 7,
            Mode::CyclicPosition => 8,
            Mode::CyclicVelocity => 9,
            Mode::CyclicTorque => 10,
            Mode::Other(code) => code,
        }
    }

    /// The mode of a number.
    pub const fn from_code(code: i8) -> Mode {
        match code {
            0 => Mode::None,
            1 => Mode::ProfilePosition,
            2 => Mode::Velocity,
            3 => Mode::ProfileVelocity,
            4 => Mode::ProfileTorque,
            6 => Mode::Homing,
            7 => Mode::InterpolatedPosition,
            8 => Mode::CyclicPosition,
            9 => Mode::CyclicVelocity,
            10 => Mode::CyclicTorque,
            other => Mode::Other(other),
        }
    }

    /// Whether the supported drive modes 0x6502 contain this mode (bit n − 1 for mode n). A vendor's mode
    /// (negative) has no bit of the standard: `None`.
    pub const fn is_in(self, supported: u32) -> Option<bool> {
        let code = self.code();
        if code >= 1 && code <= 16 { Some(supported >> (code - 1) & 1 == 1) } else { None }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Mode::None => "no mode",
            Mode::ProfilePosition => "profile position",
            Mode::Velocity => "velocity",
            Mode::ProfileVelocity => "profile velocity",
            Mode::ProfileTorque => "profile torque",
            Mode::Homing => "homing",
            Mode::InterpolatedPosition => "interpolated position",
            Mode::CyclicPosition => "cyclic synchronous position",
            Mode::CyclicVelocity => "cyclic synchronous velocity",
            Mode::CyclicTorque => "cyclic synchronous torque",
            Mode::Other(code) => return write!(f, "mode {code}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_modes_are_inverse() {
        for code in i8::MIN..=i8::MAX {
            assert_eq!(Mode::from_code(code).code(), code);
        }
    }

    /// The DCF's 0x43: profile position, velocity and interpolated position, and nothing else.
    #[test]
    fn the_arms_modes() {
        let offered: Vec<i8> = (1..=16).filter(|&n| Mode::from_code(n).is_in(0x43) == Some(true)).collect();
        assert_eq!(offered, [1, 2, 7]);
        assert_eq!(Mode::Other(-1).is_in(0x43), None);
    }
}
