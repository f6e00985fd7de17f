//! The virtual arm on the bus: one CiA 402 slave a joint over one simulated plant.
//!
//! | module | content |
//! |---|---|
//! | `dictionary` | the drive's objects, exactly those of the maker's DCF |
//! | `server` | SDO |
//! | `process` | PDOs and the device's rules for changing them; the demanded position of a joint |
//! | `drive` | set-points, state machine, modes, brake, commutation search |
//! | `node` | network management, heartbeats, emergencies; ties the others together |
//! | `hand` | a hand that pulls the links along a path |
//! | `arm` | all nodes with the plant and its sensors, as the other end of a bus |

mod arm;
mod dictionary;
mod drive;
mod hand;
mod node;
mod process;
mod server;
#[cfg(test)]
mod tests;

pub use arm::{CurrentMode, Module, Setup, VirtualArm, serve};
pub use dictionary::{Dictionary, Entry, Identity, Value};
pub use hand::{Hand, HandLog, HandSample};
pub use node::Node;
use powerball_bus::cia402::Mode;

/// Radians in a milli-degree, the drives' unit of angles.
const DEGREE: f64 = std::f64::consts::PI / 180_000.0;

/// The values of a drive's sensors at one instant, at the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sample {
    /// rad.
    position: f64,
    /// rad/s.
    velocity: f64,
    /// N·m, from the current.
    torque: f64,
}

/// A fault that can be injected at a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The node neither hears nor speaks; its drive continues with the last command. `false` ends it.
    Silent(bool),
    /// The node restarts.
    Reboot,
    /// The drive faults with this error code and register.
    Emergency {
        /// Code of the emergency message.
        code: u16,
        /// Error register.
        register: u8,
    },
    /// The motor supply goes (`false`), with the emergency 0x3222 and a commutation to be searched again, or
    /// returns.
    Supply(bool),
    /// The drive takes a mode's number and does not change to it.
    RefuseMode(Option<Mode>),
    /// The statusword is this, whatever the drive does.
    Statusword(Option<u16>),
    /// The brake closes and stays closed, whatever the drive commands. `false` ends it.
    BrakeStuck(bool),
    /// Heartbeats stop while everything else continues.
    NoHeartbeat(bool),
}
