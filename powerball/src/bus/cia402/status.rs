//! The statusword 0x6041.

use core::fmt;

/// States of a drive. An unknown pattern is a value of its own: taking it for a fault, or for anything else,
/// would be a guess.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Self-test, after power-up.
    NotReadyToSwitchOn,
    /// No power to the motor may be had.
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
    fn quick_stop_is_told_from_operation_enabled() {
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
