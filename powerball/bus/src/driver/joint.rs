//! One joint while the driver runs: reports of its drive, and its commands.
//!
//! The traits and events between driver and transport: [`Transmit`] and [`BusEvent`].

use super::profile::{JointProfile, ModeProfile};
use super::script::Progress;
use super::torque::{ControlMode, Demand};
use super::torque_mode::Guarded;
use super::units::{JointUnits, Saturated, to_i16};
use super::watch::Watched;
use crate::canopen::client::Client;
use crate::canopen::emcy::Emcy;
use crate::canopen::pdo::{Mapping, sign_extend};
use crate::canopen::sync::HeartbeatConsumer;
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
    pub(super) step: usize,
    pub(super) retries: u8,
    /// Earliest time of the next step.
    pub(super) next_step: Micros,
    pub(super) booted: Option<Micros>,
    pub(super) heartbeat: HeartbeatConsumer,
    /// Transmit PDOs that came since the last SYNC, by bit.
    pub(super) arrived: u8,
    pub(super) missing_run: u8,
    /// Process data came twice in this cycle, and in how many cycles in a row.
    pub(super) duplicated: bool,
    pub(super) duplicate_run: u8,
    pub(super) overspeed_run: u8,
    pub(super) progress: Progress,
    /// Accepted set-point, and those that have left; rad, rad/s or A.
    pub(super) target: f64,
    pub(super) demand: Demand,
    /// Torque offset that goes with the set-points, N·m.
    pub(super) offset: f64,
    pub(super) watched: Watched,
    pub(super) guarded: Guarded,
    /// Cycles, by the driver's count, whose position and velocity came last.
    pub(super) position_cycle: u64,
    pub(super) velocity_cycle: u64,
    /// Greatest current that the drive gives (0x6073), A, if the drive reports it.
    pub(super) current_limit: Option<f64>,
    /// Settings that the drive declined and need not have, by bit.
    pub(super) declined: u8,
    /// Profile position: the target announced last, and whether its announcing bit is up.
    pub(super) announced: Option<i32>,
    pub(super) raised: bool,
    /// Travel that velocity set-points commanded since `swept_from`, rad, and the position then.
    pub(super) swept: f64,
    pub(super) swept_from: f64,
    /// A stop that could not be queued yet.
    pub(super) unsent: bool,
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
            step: 0,
            retries: 0,
            next_step: 0,
            booted: None,
            heartbeat: HeartbeatConsumer::new(heartbeat_timeout),
            arrived: 0,
            missing_run: 0,
            duplicated: false,
            duplicate_run: 0,
            overspeed_run: 0,
            progress: Progress::Waiting,
            target: 0.0,
            demand: Demand::at_rest(0.0),
            offset: 0.0,
            watched: Watched::default(),
            guarded: Guarded::default(),
            position_cycle: 0,
            velocity_cycle: 0,
            current_limit: None,
            declined: 0,
            announced: None,
            raised: false,
            swept: 0.0,
            swept_from: 0.0,
            unsent: false,
        }
    }

    /// The drive's state; `None` before its first process data.
    pub fn state(&self) -> Option<State> {
        self.status.map(Statusword::state)
    }

    /// Stores the process data of transmit PDO `number`; returns false if it does not fit the mapping.
    pub(super) fn update(&mut self, number: u8, mapping: &Mapping, frame: &Frame) -> bool {
        let Some(values) = mapping.unpack(frame.bytes()) else {
            self.counters.malformed += 1;
            return false;
        };
        for (entry, raw) in values {
            let signed = sign_extend(raw, entry.bits);
            match entry.object {
                objects::STATUSWORD => self.status = Some(Statusword(raw as u16)),
                objects::MODE_DISPLAY => self.mode = Some(Mode::from_code(raw as i8)),
                objects::POSITION => self.position = self.units.position(signed),
                objects::VELOCITY => self.velocity = self.units.position(signed),
                objects::TORQUE => {
                    self.current = self.units.current(signed);
                    self.torque = self.units.torque(signed);
                }
                _ => {}
            }
        }
        let bit = 1 << (number - 1);
        if self.arrived & bit != 0 {
            self.counters.duplicates += 1;
            self.duplicated = true;
        }
        self.arrived |= bit;
        true
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

    /// A cycle of `period` s with the velocity that was sent. Once enough travel was commanded: the part of
    /// it that the joint has gone, and a new beginning.
    pub(super) fn sweep(&mut self, period: f64, enough: f64) -> Option<f64> {
        self.swept += self.demand.last() * period;
        if self.swept.abs() < enough {
            return None;
        }
        let part = (self.position - self.swept_from) / self.swept;
        (self.swept, self.swept_from) = (0.0, self.position);
        Some(part)
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
