//! Why the arm was stopped, or may not start: typed, with the node and what was seen.
//!
//! [`Rejection`] says why a set-point is not sent.

use super::demand::ControlMode;
use crate::canopen::client::SdoError;
use crate::canopen::emcy::{Emcy, vendor_text};
use crate::canopen::objects::{DEVICE_TYPE, PRODUCT_CODE, REVISION, VENDOR_ID};
use crate::canopen::pdo::MappingError;
use crate::canopen::{NodeId, Object};
use crate::cia402::{Mode, State, Statusword};
use core::fmt;
use powerball_controller::JointNumber;

/// A frame that was received from another master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foreign {
    /// SYNC.
    Sync,
    /// A command of network management.
    Nmt,
    /// Set-points for a node of the arm.
    Setpoints(NodeId),
    /// A heartbeat with the master's own node id.
    Heartbeat(NodeId),
}

impl fmt::Display for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Foreign::Sync => f.write_str("SYNC"),
            Foreign::Nmt => f.write_str("network management commands"),
            Foreign::Setpoints(node) => write!(f, "set-points for node {node}"),
            Foreign::Heartbeat(node) => write!(f, "the heartbeat of node {node}, which is this master's"),
        }
    }
}

/// The reason for a missing transition, as the statusword gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Hindrance {
    /// The node sends no process data.
    Silent,
    /// Bit 4 is clear: no motor voltage (supply off, emergency stop, STO).
    NoVoltage,
    /// Bit 9 is clear: the drive does not obey the bus.
    NotRemote,
    /// Bit 11 is set: a limit inside the drive.
    InternalLimit,
    /// Bit 7 is set: a warning.
    Warning,
    /// Bit 13 is set in a position mode: the drive's own following error.
    FollowingError,
    /// Bit 12 fell while interpolating: the drive no longer follows its points.
    NotInterpolating,
    /// The drive went to another state than the one on the way.
    Elsewhere,
    /// The statusword gives no reason.
    Untold,
}

impl Hindrance {
    /// The first reason that `status` gives; `None` where no data came.
    pub(super) fn of(status: Option<Statusword>, on_the_way: bool) -> Hindrance {
        let Some(status) = status else { return Hindrance::Silent };
        if !on_the_way {
            Hindrance::Elsewhere
        } else if !status.has(Statusword::VOLTAGE_ENABLED) {
            Hindrance::NoVoltage
        } else if !status.has(Statusword::REMOTE) {
            Hindrance::NotRemote
        } else if status.has(Statusword::INTERNAL_LIMIT) {
            Hindrance::InternalLimit
        } else if status.has(Statusword::WARNING) {
            Hindrance::Warning
        } else {
            Hindrance::Untold
        }
    }
}

impl fmt::Display for Hindrance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Hindrance::Silent => "the node sends no process data",
            Hindrance::NoVoltage => "motor voltage is missing (supply, emergency stop or STO)",
            Hindrance::NotRemote => "the drive does not obey the bus",
            Hindrance::InternalLimit => "a limit inside the drive is active",
            Hindrance::Warning => "the drive warns",
            Hindrance::FollowingError => "the drive reports a following error",
            Hindrance::NotInterpolating => "the drive no longer follows its interpolation points",
            Hindrance::Elsewhere => "the drive went to another state",
            Hindrance::Untold => "the statusword gives no reason",
        })
    }
}

/// Why the arm was stopped, or could not be made ready. The first one is latched until it is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// Another master is on the bus: the kind of frame that was received from it.
    OtherMaster(Foreign),
    /// Process data of a node comes twice: two nodes have its id.
    TwoNodes(NodeId),
    /// The program was asked to end, by a signal.
    Interrupted,
    /// No heartbeat of a node in three of its periods.
    HeartbeatLost(NodeId),
    /// No process data of a node for too many cycles.
    DataMissing(NodeId),
    /// A node restarted.
    Rebooted(NodeId),
    /// A node reports an emergency.
    Emergency(NodeId, Emcy),
    /// A drive is in fault, or reacts to one.
    DriveFault(NodeId, Statusword),
    /// A drive left the state that it was in.
    StateLost(NodeId, Statusword),
    /// A drive shows a state that the standard does not know.
    UnknownState(NodeId, Statusword),
    /// A drive shows another mode than requested.
    WrongMode(NodeId, Mode),
    /// A node left NMT operational.
    NotOperational(NodeId),
    /// Too many SYNCs were late, or left out: the caller polls too seldom.
    Late,
    /// The caller stopped giving set-points.
    Starved,
    /// Set-points were rejected again and again.
    Setpoints(Rejection),
    /// A drive with torque shows that it cannot use it; its statusword.
    Hindered(NodeId, Hindrance, Statusword),
    /// A joint is not where it was commanded to be: following error beyond the drive's delay, and its limit,
    /// rad.
    FollowingError(NodeId, f64, f64),
    /// A joint does not have the commanded velocity: error and limit, rad/s.
    VelocityError(NodeId, f64, f64),
    /// A joint stands still at this distance from the target of its profile, rad.
    Stuck(NodeId, f64),
    /// A measured position jumped: by how much, and what its greatest velocity explains, rad.
    PositionJump(NodeId, f64, f64),
    /// A joint was measured beyond its limits: its position, and the limit with its tolerance, rad.
    PositionLimit(NodeId, f64, f64),
    /// A joint's current stays at its limit: current and limit, A.
    TorqueLimit(NodeId, f64, f64),
    /// In velocity mode a joint moved this part of the commanded travel, less than half or more than twice:
    /// the dimension factor 0x604C differs from that of the profile, or the joint is blocked.
    WrongVelocityScale(NodeId, f64),
    /// A joint moves faster than it may: its velocity and the greatest one, rad/s.
    Overspeed(JointNumber, f64, f64),
    /// Current mode: velocities of a joint that no joint can have, one after the other; the last one, rad/s.
    ImplausibleVelocity(NodeId, JointNumber, f64),
    /// Current mode: a joint's position differs from its integrated velocity by this much, rad: one of the
    /// two is wrong.
    PositionAgainstVelocity(NodeId, JointNumber, f64),
    /// Current mode: a joint's current is not the commanded one: measured and commanded, A.
    CurrentError(NodeId, JointNumber, f64, f64),
    /// Current mode: this much of a joint's torque does not act as in the model, and what may be, N·m.
    TorqueError(NodeId, JointNumber, f64, f64),
    /// Current mode: a joint is this far from where it should be, and how far it may be, rad.
    OffPath(NodeId, JointNumber, f64, f64),
    /// The CAN controller is off the bus.
    BusOff,
    /// The transport's queue is full.
    TransmitQueueFull,
    /// A node did not boot.
    NoBoot(NodeId),
    /// A node is not who it should be: object, expected, found.
    WrongIdentity(NodeId, Object, u32, u32),
    /// A drive does not offer the mode; its 0x6502.
    ModeNotOffered(NodeId, Mode, u32),
    /// An SDO transfer failed.
    Sdo(NodeId, Object, SdoError),
    /// A drive cannot be made to watch the master (0x1016, 0x200E): it may not be enabled.
    NoWatch(NodeId, Object, SdoError),
    /// An object reads back otherwise than written: written, read.
    NotTaken(NodeId, Object, u32, u32),
    /// An object of a drive has an invalid value: the object and the value.
    Implausible(NodeId, Object, u32),
    /// A transition did not happen: where the drive is, where it should be, why.
    Transition(NodeId, State, State, Hindrance),
    /// The commutation search did not end.
    NoCommutation(NodeId),
}

impl Cause {
    /// The node that it is about.
    pub fn node(&self) -> Option<NodeId> {
        Some(match *self {
            Cause::HeartbeatLost(node)
            | Cause::DataMissing(node)
            | Cause::Rebooted(node)
            | Cause::Emergency(node, _)
            | Cause::DriveFault(node, _)
            | Cause::StateLost(node, _)
            | Cause::UnknownState(node, _)
            | Cause::WrongMode(node, _)
            | Cause::NotOperational(node)
            | Cause::TwoNodes(node)
            | Cause::Hindered(node, ..)
            | Cause::FollowingError(node, ..)
            | Cause::VelocityError(node, ..)
            | Cause::Stuck(node, _)
            | Cause::PositionJump(node, ..)
            | Cause::PositionLimit(node, ..)
            | Cause::TorqueLimit(node, ..)
            | Cause::WrongVelocityScale(node, _)
            | Cause::ImplausibleVelocity(node, ..)
            | Cause::PositionAgainstVelocity(node, ..)
            | Cause::CurrentError(node, ..)
            | Cause::TorqueError(node, ..)
            | Cause::OffPath(node, ..)
            | Cause::NoBoot(node)
            | Cause::WrongIdentity(node, ..)
            | Cause::ModeNotOffered(node, ..)
            | Cause::Sdo(node, ..)
            | Cause::NoWatch(node, ..)
            | Cause::NotTaken(node, ..)
            | Cause::Implausible(node, ..)
            | Cause::Transition(node, ..)
            | Cause::NoCommutation(node) => node,
            _ => return None,
        })
    }

    /// Whether the nodes' configuration can no longer be trusted, so that the driver must start again after
    /// it was acknowledged.
    pub fn needs_restart(&self) -> bool {
        matches!(
            self,
            Cause::HeartbeatLost(_)
                | Cause::OtherMaster(_)
                | Cause::TwoNodes(_)
                | Cause::Rebooted(_)
                | Cause::NotOperational(_)
                | Cause::WrongMode(..)
                | Cause::BusOff
                | Cause::NoBoot(_)
                | Cause::WrongIdentity(..)
                | Cause::ModeNotOffered(..)
                | Cause::Sdo(..)
                | Cause::NoWatch(..)
                | Cause::NotTaken(..)
                | Cause::Implausible(..)
        )
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(node) = self.node() {
            write!(f, "node {node}: ")?;
        }
        match self {
            Cause::OtherMaster(what) => {
                write!(
                    f,
                    "another master is on the bus and sends {what}: stop it, or do not use this arm now"
                )
            }
            Cause::TwoNodes(_) => f.write_str("its process data comes twice: two nodes have this id"),
            Cause::Interrupted => f.write_str("the program was asked to end"),
            Cause::HeartbeatLost(_) => f.write_str("heartbeat lost"),
            Cause::DataMissing(_) => f.write_str("process data missing"),
            Cause::Rebooted(_) => f.write_str("restarted: it must be configured again"),
            Cause::Emergency(_, emcy) => emcy.fmt(f),
            Cause::DriveFault(_, status) => write!(f, "drive fault, statusword {status:?}"),
            Cause::StateLost(_, status) => write!(f, "the drive left its state, statusword {status:?}"),
            Cause::UnknownState(_, status) => write!(f, "statusword {status:?}"),
            Cause::WrongMode(_, mode) => write!(f, "the drive is in another mode than requested: {mode}"),
            Cause::NotOperational(_) => f.write_str("left NMT operational"),
            Cause::Late => {
                f.write_str("too many SYNCs late or left out: the driver is not polled often enough")
            }
            Cause::Starved => f.write_str("no new set-points"),
            Cause::Setpoints(rejection) => write!(f, "set-points rejected again and again: {rejection}"),
            Cause::Hindered(_, why, status) => write!(f, "{why}, statusword {status:?}"),
            Cause::FollowingError(_, error, limit) => {
                write!(
                    f,
                    "following error {error:.4} rad, above the limit {limit:.4}: is the joint blocked, or \
                        its brake closed?"
                )
            }
            Cause::VelocityError(_, error, limit) => {
                write!(
                    f,
                    "velocity error {error:.3} rad/s, above the limit {limit:.3}: is the joint blocked?"
                )
            }
            Cause::Stuck(_, left) => {
                write!(f, "stands still {left:.4} rad from its target: is it blocked, or its brake closed?")
            }
            Cause::PositionJump(_, step, most) => {
                write!(
                    f,
                    "the measured position jumped by {step:.4} rad, more than the possible {most:.4}: check \
                        the encoder"
                )
            }
            Cause::PositionLimit(_, q, limit) => {
                write!(f, "measured at {q:.4} rad, beyond the limit {limit:.4} rad")
            }
            Cause::TorqueLimit(_, current, limit) => {
                write!(
                    f,
                    "its current stays at {current:.2} A, the limit is {limit:.2} A: the joint is blocked \
                        or overloaded"
                )
            }
            Cause::WrongVelocityScale(_, part) => {
                write!(
                    f,
                    "went {part:.2} of the travel that the commanded velocities give: check the scale of \
                        0x604C, or free the joint"
                )
            }
            Cause::Overspeed(joint, velocity, limit) => {
                write!(f, "joint {joint} moves at {velocity:.3} rad/s, above the limit {limit:.3}")
            }
            Cause::ImplausibleVelocity(_, joint, velocity) => {
                write!(f, "joint {joint} reports {velocity:.3} rad/s, which is impossible: check the encoder")
            }
            Cause::PositionAgainstVelocity(_, joint, slip) => {
                write!(
                    f,
                    "joint {joint}: position and integrated velocity differ by {slip:.4} rad: one of them is \
                        wrong, check the encoder and the scales"
                )
            }
            Cause::CurrentError(_, joint, measured, asked) => {
                write!(f, "joint {joint}: {measured:.2} A are measured, {asked:.2} A were commanded")
            }
            Cause::TorqueError(_, joint, left, limit) => {
                write!(
                    f,
                    "joint {joint}: {left:.1} N·m of its torque do not act as the model predicts, above the \
                        limit {limit:.1}: is it blocked or pushed, its encoder stuck, or its drive without \
                        power?"
                )
            }
            Cause::OffPath(_, joint, far, limit) => {
                write!(
                    f,
                    "joint {joint} is {far:.4} rad from where it should be, above the limit {limit:.4}: is \
                        it blocked or pushed, its encoder stuck, or the model that of another arm?"
                )
            }
            Cause::BusOff => f.write_str("CAN controller off the bus"),
            Cause::TransmitQueueFull => f.write_str("transmit queue full"),
            Cause::NoBoot(_) => f.write_str("no boot-up message: is it powered, and the bit rate right?"),
            Cause::WrongIdentity(_, object, expected, found) => {
                let what = match *object {
                    DEVICE_TYPE => {
                        let profile = found & 0xFFFF;
                        write!(f, "device type 0x{found:08X} ({object}), which is ")?;
                        return write!(f, "CiA {profile} where CiA {expected} is expected");
                    }
                    VENDOR_ID => "vendor",
                    PRODUCT_CODE => "product",
                    REVISION => "revision",
                    _ => "serial number",
                };
                write!(f, "{what} 0x{found:08X} ({object}) where 0x{expected:08X} is expected")
            }
            Cause::ModeNotOffered(_, mode, offered) => {
                write!(f, "{mode} is not among the drive's modes (0x6502 reads 0x{offered:X})")
            }
            Cause::Sdo(_, object, error) => write!(f, "{object}: {error}"),
            Cause::NoWatch(_, object, error) => {
                write!(f, "cannot be configured to watch the master, so it must not move; {object}: {error}")
            }
            Cause::NotTaken(_, object, written, read) => {
                write!(f, "{object} reads back 0x{read:X} after 0x{written:X} was written")
            }
            Cause::Implausible(_, object, read) => {
                write!(f, "{object} reads 0x{read:X}, which is not a valid value")
            }
            Cause::Transition(_, from, to, why) => {
                write!(f, "stays in \"{from}\", should be in \"{to}\": {why}")
            }
            Cause::NoCommutation(_) => f.write_str("the commutation search does not end"),
        }
    }
}

impl core::error::Error for Cause {}

/// The details of a drive's last error, read after a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Details {
    /// Error register 0x1001.
    pub register: Option<u8>,
    /// SCHUNK's code, lowest byte of 0x1002.
    pub vendor_code: Option<u8>,
    /// 0x200B:1.
    pub detail: Option<f32>,
    /// 0x200B:3, line in the firmware's source.
    pub line: Option<u16>,
}

impl fmt::Display for Details {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        let mut part = |f: &mut fmt::Formatter<'_>, text: fmt::Arguments<'_>| {
            write!(f, "{separator}{text}")?;
            separator = ", ";
            Ok::<(), fmt::Error>(())
        };
        if let Some(register) = self.register {
            part(f, format_args!("error register 0x{register:02X}"))?;
        }
        if let Some(code) = self.vendor_code {
            part(f, format_args!("code 0x{code:02X} ({})", vendor_text(code).unwrap_or("not published")))?;
        }
        if let Some(detail) = self.detail {
            part(f, format_args!("detail {detail}"))?;
        }
        if let Some(line) = self.line {
            part(f, format_args!("firmware line {line}"))?;
        }
        Ok(())
    }
}

/// Why a call was refused. Nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Not possible in the present phase: what the driver is doing.
    Phase(&'static str),
    /// A cause is latched; acknowledge it first.
    Latched(Cause),
    /// The profile does not have the mode.
    NoMode(ControlMode),
    /// The mode was not verified on hardware, and the caller does not accept that.
    NotVerified(ControlMode),
    /// The bus would be loaded by this much (1 is all of it) in the worst case.
    BusLoad(f64),
    /// The profile contradicts itself; what and where.
    Profile(&'static str),
    /// A PDO of the profile cannot be.
    Mapping(MappingError),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::Phase(what) => write!(f, "not possible now: the driver {what}"),
            Refusal::Latched(cause) => write!(f, "acknowledge the cause of the last stop first: {cause}"),
            Refusal::NoMode(mode) => write!(f, "the profile knows nothing of {mode} mode"),
            Refusal::NotVerified(mode) => {
                write!(
                    f,
                    "{mode} mode was never verified on the arm itself; accept that explicitly or choose \
                        another"
                )
            }
            Refusal::BusLoad(load) => {
                write!(
                    f,
                    "the bus would be loaded to {:.1} % in the worst case: map fewer objects, ",
                    100.0 * load
                )?;
                f.write_str("take a lower rate, or a higher bit rate")
            }
            Refusal::Profile(what) => write!(f, "the profile cannot be used: {what}"),
            Refusal::Mapping(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

// Why a set-point does not leave.

/// Why a set-point was rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Joint's value is NaN or infinite.
    NotFinite(JointNumber),
    /// Joint, position (commanded, or reached before it can stop) and the limit that it would pass, rad.
    Position(JointNumber, f64, f64),
    /// Joint, velocity and greatest velocity, rad/s.
    Velocity(JointNumber, f64, f64),
    /// Joint, current and greatest current, A.
    Current(JointNumber, f64, f64),
    /// Joint, change since the last set-point and the greatest change, in the mode's unit.
    Jump(JointNumber, f64, f64),
    /// Joint, acceleration of its set-points and the greatest one, rad/s².
    Acceleration(JointNumber, f64, f64),
    /// Joint, torque that the arm's model requires and the greatest one, N·m.
    Torque(JointNumber, f64, f64),
    /// Joint whose value the drive's type cannot hold: it would be cut.
    Saturated(JointNumber),
    /// The receive PDO of this mode holds no torque offset: see
    /// [`Profile::with_torque_offset`](super::Profile::with_torque_offset).
    NoTorqueOffset,
    /// The arm does not follow set-points now.
    NotRunning,
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Rejection::NotFinite(j) => write!(f, "joint {j}: the set-point is not a number"),
            Rejection::Position(j, q, limit) => {
                write!(f, "joint {j}: position {q:.4} rad beyond the limit {limit:.4} rad")
            }
            Rejection::Velocity(j, v, limit) => {
                write!(f, "joint {j}: {v:.4} rad/s is more than the greatest velocity {limit:.4} rad/s")
            }
            Rejection::Current(j, i, limit) => {
                write!(f, "joint {j}: {i:.3} A is more than the greatest current {limit:.3} A")
            }
            Rejection::Jump(j, step, limit) => {
                write!(f, "joint {j}: a step of {step:.5} in one cycle, above the limit {limit:.5}")
            }
            Rejection::Acceleration(j, a, limit) => {
                write!(
                    f,
                    "joint {j}: its set-points accelerate by {a:.2} rad/s², above the limit {limit:.2} rad/s²"
                )
            }
            Rejection::Torque(j, torque, limit) => {
                write!(f, "joint {j}: the set-points need {torque:.1} N·m, above the limit {limit:.1} N·m")
            }
            Rejection::Saturated(j) => {
                write!(f, "joint {j}: the drive's number type cannot hold the set-point")
            }
            Rejection::NoTorqueOffset => f.write_str("the drives get no torque offset in this mode"),
            Rejection::NotRunning => f.write_str("the arm does not follow set-points now"),
        }
    }
}

impl core::error::Error for Rejection {}
