//! One joint while the driver runs: reports of its drive, and its commands.
//!
//! The traits and events between driver and transport: [`Transmit`] and [`BusEvent`].

use super::demand::{ControlMode, Demand};
use super::presence::Presence;
use super::profile::{JointProfile, ModeProfile};
use super::units::{JointUnits, Saturated, to_i16};
use crate::canopen::client::Client;
use crate::canopen::emcy::Emcy;
use crate::canopen::pdo::{Mapping, sign_extend};
use crate::canopen::{Cob, Frame, Micros, nmt};
use crate::cia402::{Command, Controlword, Mode, State, Statusword, objects};

/// Counts of what went wrong and did no harm, or not yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointCounters {
    /// Cycles without all of its process data.
    pub missing: u64,
    /// Process data that came twice in a cycle.
    pub duplicates: u64,
    /// Frames of a wrong length.
    pub malformed: u64,
    /// Emergencies, beyond the first of each kind not reported one by one.
    pub emergencies: u64,
    /// Velocities that no joint can have, in current mode: the one before was used in their place.
    pub implausible: u64,
}

/// The measured and commanded state of one joint.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// Position, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Motor current, A, with the joint's sign.
    pub current: f64,
    /// Joint torque from the current, N·m; as good as the profile's calibration.
    pub torque: f64,
    /// The drive's statusword; `None` before its first process data.
    pub status: Option<Statusword>,
    /// The mode that the drive shows.
    pub mode: Option<Mode>,
    /// NMT state of its heartbeat.
    pub nmt: Option<nmt::State>,
    /// The last emergency, until the drive says that it is gone.
    pub emergency: Option<Emcy>,
    /// 0x1000: the device type; its low 16 bits are the number of the device profile.
    pub device_type: Option<u32>,
    /// 0x1018: vendor, product, revision, serial number, as far as the drive reports them.
    pub identity: [Option<u32>; 4],
    /// When its last process data came, on the driver's clock, µs.
    pub answered_at: Micros,
    /// Counts.
    pub counters: JointCounters,
    /// Scales, with the rated current that the drive reported.
    pub units: JointUnits,
    /// mdeg/s of a count of 0x6042.
    pub(super) velocity_count: f64,
    pub(super) velocity_numerator: i32,
    pub(super) client: Client,
    pub(super) booted: Option<Micros>,
    pub(super) presence: Presence,
    /// Accepted set-point, and those that have left; rad, rad/s or A.
    pub(super) target: f64,
    pub(super) demand: Demand,
    /// Torque offset that goes with the set-points, N·m.
    pub(super) offset: f64,
    /// Cycles, by the driver's count, whose position and velocity came last.
    pub(super) position_cycle: u64,
    pub(super) velocity_cycle: u64,
    /// The velocity before the last one, and how many cycles lay between them.
    pub(super) velocity_before: (f64, u64),
    /// Greatest current that the drive gives (0x6073), A, if the drive reports it.
    pub(super) current_limit: Option<f64>,
    /// Settings that the drive declined and need not have, by bit.
    pub(super) declined: u8,
    /// Profile position: the target announced last, and whether its announcing bit is up.
    announced: Option<i32>,
    raised: bool,
}

impl Joint {
    pub(super) fn new(profile: &JointProfile, heartbeat_timeout: Micros, sdo_timeout: Micros) -> Joint {
        Joint {
            position: 0.0,
            velocity: 0.0,
            current: 0.0,
            torque: 0.0,
            status: None,
            mode: None,
            nmt: None,
            emergency: None,
            device_type: None,
            identity: [None; 4],
            answered_at: 0,
            counters: JointCounters::default(),
            units: profile.units,
            velocity_count: 1.0,
            velocity_numerator: 0,
            client: Client::new(profile.node, sdo_timeout),
            booted: None,
            presence: Presence::new(heartbeat_timeout),
            target: 0.0,
            demand: Demand::at_rest(0.0),
            offset: 0.0,
            position_cycle: 0,
            velocity_cycle: 0,
            velocity_before: (0.0, 0),
            current_limit: None,
            declined: 0,
            announced: None,
            raised: false,
        }
    }

    /// The drive's state; `None` before its first process data.
    pub fn state(&self) -> Option<State> {
        self.status.map(Statusword::state)
    }

    /// Whether the drive gives torque; not before its first process data.
    pub(super) fn has_torque(&self) -> bool {
        self.state().is_some_and(State::has_torque)
    }

    /// Whether the drive reports that it gives no torque; in a fault it gives none either.
    pub(super) fn is_off(&self) -> bool {
        self.state().is_some_and(|state| !state.has_torque())
    }

    /// Stores the process data of transmit PDO `number`, which came at `now` in `cycle`; returns false if it
    /// does not fit the mapping.
    pub(super) fn update(
        &mut self,
        number: u8,
        mapping: &Mapping,
        frame: &Frame,
        (now, cycle): (Micros, u64),
    ) -> bool {
        let Some(values) = mapping.unpack(frame.bytes()) else {
            self.counters.malformed += 1;
            return false;
        };
        for (entry, raw) in values {
            let signed = sign_extend(raw, entry.bits);
            match entry.object {
                objects::STATUSWORD => self.status = Some(Statusword(raw as u16)),
                objects::MODE_DISPLAY => self.mode = Some(Mode::from_code(raw as i8)),
                objects::POSITION => {
                    self.position = self.units.position(signed);
                    self.position_cycle = cycle;
                }
                objects::VELOCITY => {
                    self.velocity_before = (self.velocity, cycle.saturating_sub(self.velocity_cycle));
                    self.velocity = self.units.position(signed);
                    self.velocity_cycle = cycle;
                }
                objects::TORQUE => {
                    self.current = self.units.current(signed);
                    self.torque = self.units.torque(signed);
                }
                _ => {}
            }
        }
        self.answered_at = now;
        self.counters.duplicates += u64::from(self.presence.arrive(number));
        true
    }

    /// The last velocity is not to be used: the one before takes its place.
    pub(super) fn reject_velocity(&mut self) {
        self.counters.implausible += 1;
        self.velocity = self.velocity_before.0;
    }

    /// The number on the wire for a set-point in rad, rad/s or A.
    pub(super) fn raw(&self, control: ControlMode, value: f64) -> Saturated<i32> {
        match control {
            ControlMode::ProfilePosition | ControlMode::InterpolatedPosition => self.units.counts(value),
            ControlMode::Velocity => to_i16(value * self.units.counts_per_radian / self.velocity_count),
            ControlMode::Current => self.units.per_mille(value),
        }
    }

    /// The set-point that holds the joint: its actual position, or zero.
    pub(super) fn hold(&self, control: ControlMode) -> f64 {
        if control.is_position() { self.position } else { 0.0 }
    }

    /// Target := what holds the joint, forgetting every set-point.
    pub(super) fn preset(&mut self, control: ControlMode) {
        self.target = self.hold(control);
        self.demand = Demand::at_rest(self.target);
        self.offset = 0.0;
        self.announced = None;
        self.raised = false;
    }

    /// The controlword that leads to "operation enabled" from where the drive is, with the brake closed.
    pub(super) fn walk(&self) -> Controlword {
        match self.state() {
            Some(State::SwitchOnDisabled) => Controlword::command(Command::Shutdown),
            Some(State::ReadyToSwitchOn) => Controlword::command(Command::SwitchOn),
            Some(State::SwitchedOn | State::OperationEnabled) => {
                Controlword::command(Command::EnableOperation).with(Controlword::HALT)
            }
            _ => Controlword::command(Command::DisableVoltage),
        }
    }

    /// The receive PDO with this controlword and a set-point.
    pub(super) fn rpdo(
        &self,
        profile: &JointProfile,
        mode: &ModeProfile,
        word: Controlword,
        raw: i32,
    ) -> Option<Frame> {
        let (bytes, len) = mode.rpdo.pack(|object| match object {
            objects::CONTROLWORD => i64::from(word.0),
            object if object == mode.setpoint => i64::from(raw),
            objects::TORQUE_OFFSET => i64::from(self.units.per_mille_of_torque(self.offset).value),
            _ => 0,
        });
        Frame::from_raw(Cob::Rpdo(1, profile.node).id(), bytes.get(..len)?)
    }

    /// Profile position's handshake: the word's bits and the target to send now. A target changes only with a
    /// rising edge of "new set-point", which waits until the drive has released the last one.
    pub(super) fn announce(&mut self, raw: i32) -> (u16, i32) {
        let acknowledged = self.status.is_some_and(|status| status.has(Statusword::MODE_12));
        if self.raised && acknowledged {
            self.raised = false;
        } else if !self.raised && !acknowledged && self.announced != Some(raw) {
            self.raised = true;
            self.announced = Some(raw);
        }
        (if self.raised { Controlword::MODE_4 } else { 0 }, self.announced.unwrap_or(raw))
    }
}

// Requirements of the driver on a transport, and reports of a transport to it.

/// The transport's queue holds no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueueFull;

/// The sending side of a transport. Nothing here blocks.
pub trait Transmit {
    /// Queues `frame`.
    ///
    /// # Errors
    /// [`QueueFull`] where it could not be queued; the frame is lost then.
    fn send(&mut self, frame: Frame) -> Result<(), QueueFull>;

    /// Throws away what is queued and not yet on the bus. Called before a stop: no set-point may leave after
    /// it.
    fn discard_queued(&mut self);
}

/// An event that a transport reports about its controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BusEvent {
    /// The controller is error passive: a warning.
    ErrorPassive,
    /// The controller is off the bus. It must not be restarted into motion: the driver is silent until it is
    /// acknowledged.
    BusOff,
    /// A frame that was queued could not be sent.
    TransmitQueueFull,
    /// Received frames were lost before they came here: a warning. Missing data is judged separately.
    Overrun,
}
