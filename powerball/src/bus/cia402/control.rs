//! The controlword 0x6040.

use core::fmt;

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

    /// With `bits` set.
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

#[cfg(test)]
mod tests {
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
