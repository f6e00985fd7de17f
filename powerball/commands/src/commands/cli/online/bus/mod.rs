//! `powerball bus`: show a CAN bus, and move the drives on it.

mod drive;
mod scan;
mod sdo;
mod state;
mod timing;

use super::Failure;
use super::virtual_arm::virtual_arm;
use clap::{Args, Subcommand};
use powerball_bus::canopen::{Micros, NodeId};
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::driver::{Driver, Profile};
use powerball_bus::transport::blocking::TransferError;
use powerball_bus::transport::{self, Bus, BusUrl, Event, Interrupt, Master, Memory};
use powerball_virtual_arm::VirtualArm;

/// For the built-in arm's drives to boot, µs.
const BOOT: Micros = 200_000;

/// Look at the drives on a bus, read and write their objects, enable, stop and move them.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball bus scan\n  powerball bus state --bus socketcan:can0\n  \
    powerball bus sdo read 3 0x6041 --bus udp:239.74.163.2:43113\n\n\
    --bus virtual, the default, is a fresh virtual arm for each command.")]
pub(crate) struct BusCommand {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Find the nodes and ask who they are.
    Scan(scan::Scan),
    /// Each drive's state, mode, position, velocity, current and errors.
    State(state::Show),
    /// Each drive's state as `state` shows it, repeatedly.
    Watch(state::Watch),
    /// Read or write an object of a node.
    Sdo(sdo::Sdo),
    /// Measure how even the cycle is and how soon the drives answer.
    Timing(timing::Timing),
    /// Configure and enable all drives, hold the arm, let go again.
    Enable(drive::Enable),
    /// Stop all drives, close their brakes, take their torque away.
    Stop(drive::Stop),
    /// Move one joint slowly.
    Move(drive::Move),
}

impl BusCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        match self.what {
            What::Scan(command) => command.run(),
            What::State(command) => command.run(),
            What::Watch(command) => command.run(),
            What::Sdo(command) => command.run(),
            What::Timing(command) => command.run(),
            What::Enable(command) => command.run(),
            What::Stop(command) => command.run(),
            What::Move(command) => command.run(),
        }
    }
}

/// The arguments of every command on a bus.
#[derive(Args, Clone, Debug)]
pub(crate) struct Where {
    /// The bus: virtual, socketcan:can0, slcan:/dev/ttyACM0 (500 kbit/s; others with ?bitrate=250000 behind
    /// it), udp:239.74.163.2:43113 (this machine alone) or udp:239.74.163.2:43113@eth0 (the network of that
    /// interface).
    #[arg(long, value_name = "URL", default_value = "virtual")]
    pub(crate) bus: BusUrl,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Options of a command that configures drives.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Consent {
    /// You accept what was not verified: drives whose device type (0x1000) or identity (0x1018) is another
    /// than the profile says, each with a warning; and the current mode, which this project has never seen on
    /// an arm.
    #[arg(long)]
    pub(crate) accept_unverified: bool,
}

impl Where {
    /// Opens the bus; the built-in arm's drives have booted.
    pub(crate) fn open(&self) -> Result<Box<dyn Bus>, Failure> {
        if self.bus != BusUrl::Virtual {
            if let BusUrl::Udp(_, Some(interface)) = &self.bus {
                tracing::warn!(
                    "anyone on the network of {interface} can read this bus and move the arm; docs/bus.md \
                        says how to restrict access"
                );
            }
            return transport::open(&self.bus).map_err(|e| Failure::Unusable(e.to_string()));
        }
        virtual_bus(virtual_arm([0.0; 6], 1, None, false)?)
    }

    /// A driver of the arm on an open bus.
    ///
    /// UDP multicast is a test bench: a program has no guaranteed time slices there, and a late SYNC harms no
    /// arm. The driver then tolerates late SYNCs that it would not tolerate on a real bus; it still counts
    /// them.
    pub(crate) fn driver(
        &self,
        bus: Box<dyn Bus>,
        consent: Consent,
    ) -> Result<Master<Box<dyn Bus>, 6>, Failure> {
        self.driver_of(LWA4P, bus, consent)
    }

    /// Like [`Self::driver`], with another profile.
    pub(crate) fn driver_of(
        &self,
        mut profile: Profile<6>,
        bus: Box<dyn Bus>,
        consent: Consent,
    ) -> Result<Master<Box<dyn Bus>, 6>, Failure> {
        if matches!(self.bus, BusUrl::Udp(..)) {
            let reactions = &mut profile.reactions;
            (reactions.late_limit, reactions.skipped_limit, reactions.missing_cycles) = (u8::MAX, 20, 20);
            // A process that catches up answers two SYNCs in one cycle; two nodes with one id do so always.
            reactions.duplicate_cycles = 40;
        }
        #[cfg(target_os = "linux")]
        if self.bus != BusUrl::Virtual
            && let Err(why) = transport::realtime::claim()
        {
            tracing::warn!("{why}; SYNCs may be late");
        }
        let signals = |e| Failure::Unusable(format!("cannot listen to signals: {e}"));
        let interrupt = Interrupt::install().map_err(signals)?;
        let mut driver = Driver::new(profile).map_err(refused)?;
        if consent.accept_unverified {
            driver.accept_other_nodes();
        }
        let master = Master::new(driver, bus).with_interrupt(interrupt);
        #[cfg(unix)]
        if let Some(watchdog) = self.watchdog() {
            return Ok(master.with_watchdog(watchdog));
        }
        Ok(master)
    }

    /// This program once more, with the same priority, to stop the arm where this process dies. A serial
    /// adapter cannot be opened twice.
    #[cfg(unix)]
    fn watchdog(&self) -> Option<transport::Watchdog> {
        if matches!(self.bus, BusUrl::Virtual | BusUrl::Slcan(..)) {
            return None;
        }
        let started = std::env::current_exe().and_then(|program| {
            let mut command = std::process::Command::new(program);
            command.args(["bus", "stop", "--watchdog", "--bus", &self.bus.to_string()]);
            transport::Watchdog::start(command)
        });
        let failed = |e| {
            tracing::warn!(
                "no watchdog: {e}; if this program is killed, only the drives' own monitoring stops the arm"
            );
        };
        started.map_err(failed).ok()
    }
}

/// A virtual arm on a bus in memory; its drives have booted.
pub(crate) fn virtual_bus(arm: VirtualArm) -> Result<Box<dyn Bus>, Failure> {
    let mut memory = Memory::new(arm, LWA4P.bitrate);
    wait(&mut memory, BOOT)?;
    Ok(Box::new(memory))
}

/// A driver of the arm on the bus.
pub(crate) fn master(place: &Where, consent: Consent) -> Result<Master<Box<dyn Bus>, 6>, Failure> {
    place.driver(place.open()?, consent)
}

/// Lets time pass on the bus.
fn wait(bus: &mut dyn Bus, time: Micros) -> Result<Vec<(Micros, Event)>, Failure> {
    let until = bus.now() + time;
    let mut heard = Vec::new();
    while let Some(event) = bus.receive(until).map_err(refused)? {
        heard.push(event);
    }
    Ok(heard)
}

fn refused(e: impl std::fmt::Display) -> Failure {
    Failure::Refused(e.to_string())
}

impl From<TransferError> for Failure {
    fn from(e: TransferError) -> Self {
        refused(e)
    }
}

/// A text that a device sent, as it may be shown: what could steer a terminal is left out.
fn printable(bytes: &[u8]) -> String {
    // Marks of the direction of writing can make a name look like another.
    let steers = |c: char| matches!(c, '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2060}'..='\u{206F}' | '\u{FEFF}');
    String::from_utf8_lossy(bytes).chars().filter(|c| !c.is_control() && !steers(*c)).collect()
}

/// A node's number on the command line.
fn node(text: &str) -> Result<NodeId, String> {
    number(text)
        .and_then(|n| u8::try_from(n).ok())
        .and_then(NodeId::new)
        .ok_or_else(|| "a node is a number from 1 to 127".to_string())
}

/// Decimal or 0x… hexadecimal, with a sign where it has one.
fn number(text: &str) -> Option<i64> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let value = match digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        Some(hex) => i64::from_str_radix(hex, 16).ok()?,
        None => digits.parse().ok()?,
    };
    Some(sign * value)
}
