//! The statusword 0x6041, the controlword 0x6040 that answers it, and the modes of operation.

use core::fmt;

/// States of a drive. An unknown pattern is a separate value: to treat it as a fault, or as any other state,
/// would be a guess.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Self-test, after power-up.
    NotReadyToSwitchOn,
    /// Power to the motor cannot be switched on.
    SwitchOnDisabled,
    /// Power may be switched on.
    ReadyToSwitchOn,
    /// Power is on, the motor without torque.
    SwitchedOn,
    /// The motor follows its set-points.
    OperationEnabled,
    /// The drive brakes, or has braked, after a quick stop.
    QuickStopActive,
    /// The drive reacts to a fault.
    FaultReactionActive,
    /// In fault, without torque.
    Fault,
    /// No pattern of the standard; the statusword's bits under mask 0x6F.
    Unknown(u16),
}

impl State {
    /// The standard's table: mask, value, state.
    const TABLE: [(u16, u16, State); 8] = [
        (0x4F, 0x00, State::NotReadyToSwitchOn),
        (0x4F, 0x40, State::SwitchOnDisabled),
        (0x6F, 0x21, State::ReadyToSwitchOn),
        (0x6F, 0x23, State::SwitchedOn),
        (0x6F, 0x27, State::OperationEnabled),
        (0x6F, 0x07, State::QuickStopActive),
        (0x4F, 0x0F, State::FaultReactionActive),
        (0x4F, 0x08, State::Fault),
    ];

    /// The bits that a drive shows in this state (those that the mask leaves free are zero).
    pub const fn pattern(self) -> u16 {
        match self {
            State::NotReadyToSwitchOn => 0x00,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStopActive => 0x07,
            State::FaultReactionActive => 0x0F,
            State::Fault => 0x08,
            State::Unknown(bits) => bits,
        }
    }

    /// Whether the motor may have torque.
    pub const fn has_torque(self) -> bool {
        !matches!(
            self,
            State::NotReadyToSwitchOn
                | State::SwitchOnDisabled
                | State::ReadyToSwitchOn
                | State::SwitchedOn
                | State::Fault
        )
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            State::NotReadyToSwitchOn => "not ready to switch on",
            State::SwitchOnDisabled => "switch on disabled",
            State::ReadyToSwitchOn => "ready to switch on",
            State::SwitchedOn => "switched on",
            State::OperationEnabled => "operation enabled",
            State::QuickStopActive => "quick stop active",
            State::FaultReactionActive => "fault reaction active",
            State::Fault => "fault",
            State::Unknown(bits) => return write!(f, "unknown state (bits 0x{bits:02X})"),
        })
    }
}

/// The statusword.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Statusword(pub u16);

impl Statusword {
    /// Motor voltage is there.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// A warning is present.
    pub const WARNING: u16 = 1 << 7;
    /// The drive obeys the bus.
    pub const REMOTE: u16 = 1 << 9;
    /// Target reached (or, with Halt, standstill).
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// A limit inside the drive is active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Set-point acknowledged (profile position), interpolation active (interpolated position), drive follows
    /// (cyclic modes).
    pub const MODE_12: u16 = 1 << 12;
    /// Following error (position modes).
    pub const MODE_13: u16 = 1 << 13;

    /// The state by the standard's masks.
    pub fn state(self) -> State {
        let found = State::TABLE.iter().find(|(mask, value, _)| self.0 & mask == *value);
        found.map_or(State::Unknown(self.0 & 0x6F), |(_, _, state)| *state)
    }

    /// Whether all of `bits` are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

impl fmt::Debug for Statusword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.0, self.state())
    }
}

// The controlword 0x6040.

/// Commands of the state machine, by the bits 7, 3, 2, 1, 0 that they need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// To ready to switch on.
    Shutdown,
    /// To switched on (also: disable operation).
    SwitchOn,
    /// To operation enabled.
    EnableOperation,
    /// To switch on disabled, at once: the motor loses its torque, the arm sags until the brake bites.
    DisableVoltage,
    /// Brake on the quick-stop ramp.
    QuickStop,
    /// Leave fault: acts on a rising edge of bit 7.
    FaultReset,
}

/// The controlword.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Controlword(pub u16);

impl Controlword {
    /// Bit 4: new set-point (profile position), enable interpolation (interpolated position), enable ramp
    /// (velocity).
    pub const MODE_4: u16 = 1 << 4;
    /// Bit 5: change set immediately (profile position), unlock ramp (velocity).
    pub const MODE_5: u16 = 1 << 5;
    /// Bit 6: relative (profile position), reference ramp (velocity).
    pub const MODE_6: u16 = 1 << 6;
    /// Bit 8: halt. On this arm it also closes the brakes.
    pub const HALT: u16 = 1 << 8;

    /// The word of a command, with no bit of a mode.
    pub const fn command(command: Command) -> Controlword {
        Controlword(match command {
            Command::Shutdown => 0x06,
            Command::SwitchOn => 0x07,
            Command::EnableOperation => 0x0F,
            Command::DisableVoltage => 0x00,
            Command::QuickStop => 0x02,
            Command::FaultReset => 0x80,
        })
    }

    /// This controlword with `bits` set as well.
    #[must_use]
    pub const fn with(self, bits: u16) -> Controlword {
        Controlword(self.0 | bits)
    }

    /// Whether all of `bits` are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The command that a drive reads in these bits, with the word that it had before (for the edge of bit
    /// 7). While bit 7 stays high without an edge, the other bits decide, as in the standard.
    pub const fn decode(self, before: Controlword) -> Command {
        if self.has(0x80) && !before.has(0x80) {
            return Command::FaultReset;
        }
        match self.0 & 0x0F {
            0x0F => Command::EnableOperation,
            0x07 => Command::SwitchOn,
            bits if bits & 0x07 == 0x06 => Command::Shutdown,
            bits if bits & 0x02 == 0 => Command::DisableVoltage,
            // Bit 1 set and bit 2 clear: all others are taken.
            _ => Command::QuickStop,
        }
    }
}

impl fmt::Debug for Controlword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.0)
    }
}

// Modes of operation: 0x6060, shown in 0x6061, offered in 0x6502.

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
    fn each_statusword_has_at_most_one_state_of_the_table() {
        for word in 0..=u16::MAX {
            let fits = State::TABLE.iter().filter(|(mask, value, _)| word & mask == *value).count();
            assert!(fits <= 1, "0x{word:04X}");
            assert_eq!(fits == 0, matches!(Statusword(word).state(), State::Unknown(_)));
        }
    }

    #[test]
    fn patterns_decode_to_their_states() {
        for (_, _, state) in State::TABLE {
            assert_eq!(Statusword(state.pattern()).state(), state);
        }
    }

    /// Words that drives of other makers send: 0x0231, 0x0233, 0x0237 (Lely's slave), 0x1237 with
    /// interpolation active.
    #[test]
    fn words_seen_on_buses() {
        let state = |word| Statusword(word).state();
        assert_eq!(state(0x0250), State::SwitchOnDisabled);
        assert_eq!(state(0x0231), State::ReadyToSwitchOn);
        assert_eq!(state(0x0233), State::SwitchedOn);
        assert_eq!(state(0x1237), State::OperationEnabled);
        assert_eq!(state(0x0217), State::QuickStopActive);
        assert_eq!(state(0x0218), State::Fault);
    }

    /// A peer tested quick stop with the mask of operation enabled, so that it could never be seen.
    #[test]
    fn quick_stop_is_distinguished_from_operation_enabled() {
        assert_eq!(Statusword(0x0007).state(), State::QuickStopActive);
        assert_eq!(Statusword(0x0027).state(), State::OperationEnabled);
    }

    #[test]
    fn an_unknown_pattern_is_neither_fault_nor_anything_else() {
        assert_eq!(Statusword(0x0001).state(), State::Unknown(0x01));
        assert_eq!(Statusword(0xFFFF).state(), State::Unknown(0x6F));
        assert_eq!(Statusword(0x006F).state(), State::Unknown(0x6F));
    }
}

#[cfg(test)]
mod control_tests {
    use super::*;

    const ALL: [Command; 6] = [
        Command::Shutdown,
        Command::SwitchOn,
        Command::EnableOperation,
        Command::DisableVoltage,
        Command::QuickStop,
        Command::FaultReset,
    ];

    #[test]
    fn a_drive_reads_what_the_master_writes_whatever_the_modes_bits() {
        for command in ALL {
            for bits in [0, Controlword::MODE_4, Controlword::HALT, 0x0170] {
                let word = Controlword::command(command).with(bits);
                assert_eq!(word.decode(Controlword::default()), command, "{word:?}");
            }
        }
    }

    #[test]
    fn fault_reset_needs_an_edge() {
        let reset = Controlword::command(Command::FaultReset);
        assert_eq!(reset.decode(reset), Command::DisableVoltage);
    }
}

#[cfg(test)]
mod mode_tests {
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
