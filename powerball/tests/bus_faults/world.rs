//! The driver, the virtual arm and a bus that can be made to fail, on one virtual clock.

use powerball::bus::canopen::sdo::{AbortCode, Chunk, Request, Response, Transfer};
use powerball::bus::canopen::{Cob, Frame, Micros, NodeId, Object};
use powerball::bus::cia402::{Command, Controlword};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{BusEvent, ControlMode, Driver, Phase, Profile, QueueFull, Transmit};
use powerball::bus::transport::{Bus, BusError, Event, Memory, Peer};
use powerball::virtual_arm::slave::CurrentMode;
use powerball::virtual_arm::{VirtualArm, lwa4p};
use std::collections::VecDeque;

pub(crate) const CYCLE: Micros = 5_000;
pub(crate) const START: [f64; 6] = [0.05, 0.02, -0.04, 0.03, 0.05, -0.02];
/// The node that things happen to: joint 3.
pub(crate) const VICTIM: NodeId = NodeId::clamped(5);

/// What the wire does to frames of the victim. Counts are frames left to be treated so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wire {
    Good,
    Drop {
        until: Micros,
        frames: u32,
    },
    Delay {
        by: Micros,
        frames: u32,
    },
    Duplicate {
        frames: u32,
    },
    /// Two frames change places.
    Swap {
        frames: u32,
    },
    Shorten {
        until: Micros,
        frames: u32,
    },
    /// The mode display, fifth byte of its second transmit PDO, says this.
    Mode(u8),
    /// The statusword, first in its first transmit PDO, with these bits set and cleared.
    Status {
        set: u16,
        clear: u16,
    },
    /// The position, last in its first transmit PDO, is off by `by` mdeg.
    Shift {
        by: i32,
        frames: u32,
    },
    /// The node's first transmit PDO comes twice: more would be too much for the bus.
    Twice,
    /// The position stays as it is in the first frame.
    Freeze(Option<i32>),
    /// The position drifts away by 0.2 rad/s from the first frame on.
    Drift(Option<Micros>),
    /// The velocity, first in its second transmit PDO, and the torque, second in its first, read this.
    Velocity(i32),
    Torque(i16),
    /// The node's server refuses this object.
    Refuse(Object),
    /// The node's server reads this value for this object, whatever was written.
    Misread(Object, u32),
}

/// The arm behind a faulty wire, with a record of what reaches it.
#[derive(Clone, Debug)]
pub(crate) struct Faulty {
    pub(crate) arm: VirtualArm,
    pub(crate) wire: Wire,
    now: Micros,
    late: Vec<(Micros, Frame)>,
    out: VecDeque<Frame>,
    swapped: Option<(Micros, Frame)>,
    /// Frames of the master, as they arrive.
    pub(crate) heard: Vec<(Micros, Frame)>,
    /// Emergencies that the victim still sends, one a millisecond: a quarter of the bus.
    pub(crate) storm: u32,
    /// What another master says every 5 ms.
    pub(crate) foreign: Option<Frame>,
}

impl Faulty {
    fn new(arm: VirtualArm) -> Faulty {
        let (late, out, heard) = (Vec::new(), VecDeque::new(), Vec::new());
        Faulty { arm, wire: Wire::Good, now: 0, late, out, swapped: None, heard, storm: 0, foreign: None }
    }

    /// What the victim's server is made to answer, where it is.
    fn served(&self, frame: &Frame) -> Option<Response> {
        if Cob::of(frame) != Some(Cob::SdoRequest(VICTIM)) {
            return None;
        }
        match (Request::decode(frame.bytes()).ok()?, self.wire) {
            (Request::Download { object, .. } | Request::Upload { object }, Wire::Refuse(refused))
                if object == refused =>
            {
                Some(Response::Abort { object, code: AbortCode::NO_OBJECT })
            }
            (Request::Upload { object }, Wire::Misread(misread, value)) if object == misread => {
                let transfer = Transfer::Expedited(Chunk::first(&value.to_le_bytes(), 4));
                Some(Response::Upload { object, transfer })
            }
            _ => None,
        }
    }

    /// One frame of the arm through the wire.
    fn pass(&mut self, frame: Frame) {
        let victims = matches!(Cob::of(&frame),
            Some(Cob::Tpdo(_, n) | Cob::SdoResponse(n) | Cob::Heartbeat(n) | Cob::Emcy(n)) if n == VICTIM);
        if !victims {
            return self.out.push_back(frame);
        }
        match &mut self.wire {
            Wire::Drop { until, frames } if *frames > 0 && self.now < *until => *frames -= 1,
            Wire::Delay { by, frames } if *frames > 0 => {
                *frames -= 1;
                let at = self.now + *by;
                self.late.push((at, frame));
            }
            Wire::Duplicate { frames } if *frames > 0 => {
                *frames -= 1;
                self.out.extend([frame, frame]);
            }
            Wire::Swap { frames } if *frames > 0 => match self.swapped.take() {
                None => self.swapped = Some((self.now, frame)),
                Some((_, first)) => {
                    *frames -= 1;
                    self.out.extend([frame, first]);
                }
            },
            Wire::Shorten { until, frames } if *frames > 0 && self.now < *until => {
                *frames -= 1;
                self.out.push_back(frame.truncated(frame.bytes().len().saturating_sub(1)));
            }
            Wire::Mode(mode) if frame.raw_id() == Cob::Tpdo(2, VICTIM).id() => {
                let mut bytes = frame.bytes().to_vec();
                bytes[4] = *mode;
                self.out.extend(Frame::from_raw(frame.raw_id(), &bytes));
            }
            Wire::Twice if frame.raw_id() == Cob::Tpdo(1, VICTIM).id() => self.out.extend([frame, frame]),
            Wire::Velocity(velocity) if frame.raw_id() == Cob::Tpdo(2, VICTIM).id() => {
                let mut bytes = frame.bytes().to_vec();
                bytes[..4].copy_from_slice(&velocity.to_le_bytes());
                self.out.extend(Frame::from_raw(frame.raw_id(), &bytes));
            }
            wire @ (Wire::Status { .. }
            | Wire::Shift { .. }
            | Wire::Freeze(_)
            | Wire::Drift(_)
            | Wire::Torque(_))
                if frame.raw_id() == Cob::Tpdo(1, VICTIM).id() && frame.bytes().len() == 8 =>
            {
                let b = frame.bytes();
                let mut status = u16::from_le_bytes([b[0], b[1]]);
                let mut torque = i16::from_le_bytes([b[2], b[3]]);
                let mut position = i32::from_le_bytes([b[4], b[5], b[6], b[7]]);
                match wire {
                    Wire::Drift(from) => {
                        let time = (self.now - *from.get_or_insert(self.now)) as f64 * 1e-6;
                        position += (0.2f64.to_degrees() * 1e3 * time) as i32;
                    }
                    Wire::Torque(read) => torque = *read,
                    Wire::Status { set, clear } => status = status & !*clear | *set,
                    Wire::Shift { by, frames } if *frames > 0 => {
                        *frames -= 1;
                        position += *by;
                    }
                    Wire::Freeze(at) => position = *at.get_or_insert(position),
                    _ => {}
                }
                let mut bytes = b.to_vec();
                bytes[..2].copy_from_slice(&status.to_le_bytes());
                bytes[2..4].copy_from_slice(&torque.to_le_bytes());
                bytes[4..].copy_from_slice(&position.to_le_bytes());
                self.out.extend(Frame::from_raw(frame.raw_id(), &bytes));
            }
            _ => self.out.push_back(frame),
        }
    }
}

impl Peer for Faulty {
    fn receive(&mut self, frame: &Frame, now: Micros) {
        self.now = now;
        self.heard.push((now, *frame));
        match self.served(frame) {
            Some(answer) => {
                let id = Cob::SdoResponse(VICTIM).id();
                self.out.extend(Frame::from_raw(id, &answer.encode()));
            }
            None => self.arm.receive(frame, now),
        }
    }

    fn advance(&mut self, now: Micros) {
        self.now = now;
        self.arm.advance(now);
        // A frame that waits to change places with the next one does not wait for ever.
        if let Some((_, frame)) = self.swapped.take_if(|(at, _)| now > *at + 10_000) {
            self.out.push_back(frame);
        }
        if now.is_multiple_of(5000) {
            self.out.extend(self.foreign);
        }
        if self.storm > 0 && now.is_multiple_of(1000) {
            self.storm -= 1;
            let emcy =
                powerball::bus::canopen::emcy::Emcy { code: 0x3222, register: 5, vendor: [0x74, 0, 0, 0, 0] };
            self.out.push_back(emcy.frame(VICTIM));
        }
    }

    fn wake(&self) -> Micros {
        self.late.iter().map(|(at, _)| *at).min().unwrap_or(Micros::MAX).min(self.arm.wake())
    }

    fn transmit(&mut self) -> Option<Frame> {
        while let Some(frame) = self.arm.transmit() {
            self.pass(frame);
        }
        let now = self.now;
        let (due, late) = self.late.iter().partition(|(at, _)| *at <= now);
        self.late = late;
        let due: Vec<(Micros, Frame)> = due;
        self.out.extend(due.iter().map(|(_, frame)| *frame));
        self.out.pop_front()
    }
}

/// The driver's door to the bus.
struct Door<'a> {
    bus: &'a mut Memory<Faulty>,
    full: bool,
}

impl Transmit for Door<'_> {
    fn send(&mut self, frame: Frame) -> Result<(), QueueFull> {
        if self.full {
            return Err(QueueFull);
        }
        match self.bus.send(&frame) {
            Err(BusError::Full) => Err(QueueFull),
            _ => Ok(()),
        }
    }

    fn discard_queued(&mut self) {
        self.bus.flush();
    }
}

/// What the caller of the driver does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pilot {
    /// Enables as soon as the driver is ready.
    pub(crate) enable: bool,
    /// Gives set-points in each cycle; one of those that must not leave where `bad` is above 0.
    pub(crate) bad: u32,
    pub(crate) bad_value: f64,
}

#[derive(Clone)]
pub(crate) struct World {
    pub(crate) bus: Memory<Faulty>,
    pub(crate) driver: Driver<6>,
    pub(crate) pilot: Pilot,
    pub(crate) full_until: Micros,
    /// Set-points that the driver took, with the time.
    pub(crate) accepted: Vec<(Micros, [f64; 6])>,
    /// What came while nobody looked.
    backlog: VecDeque<(Micros, Event)>,
    cycle: u64,
    phase: f64,
    base: [f64; 6],
    dropped: u64,
    holding: bool,
}

impl World {
    pub(crate) fn new(commutated: bool, profile: Profile<6>) -> World {
        World::with(commutated, profile, true)
    }

    /// With or without a current mode.
    pub(crate) fn with(commutated: bool, profile: Profile<6>, current: bool) -> World {
        let mut setup = lwa4p::setup(START, 7).unwrap();
        for module in &mut setup.modules {
            module.commutated = commutated;
            let target = LWA4P.current.unwrap();
            let mode = CurrentMode { mode: target.mode.code(), target: target.setpoint };
            module.current_mode = current.then_some(mode);
        }
        let arm = VirtualArm::new(setup).unwrap();
        let pilot = Pilot { enable: true, bad: 0, bad_value: 0.0 };
        World {
            bus: Memory::new(Faulty::new(arm), profile.bitrate),
            driver: Driver::new(profile).unwrap(),
            pilot,
            full_until: 0,
            accepted: Vec::new(),
            backlog: VecDeque::new(),
            cycle: 0,
            phase: 0.0,
            base: START,
            dropped: 0,
            holding: false,
        }
    }

    pub(crate) fn now(&self) -> Micros {
        self.bus.now()
    }

    pub(crate) fn stop(&mut self) {
        let now = self.now();
        let mut door = Door { full: now < self.full_until, bus: &mut self.bus };
        self.driver.stop(now, &mut door);
    }

    pub(crate) fn event(&mut self, event: BusEvent) {
        let now = self.now();
        let mut door = Door { full: now < self.full_until, bus: &mut self.bus };
        self.driver.event(event, now, &mut door);
    }

    /// One turn of the caller's loop: at most to the driver's deadline.
    pub(crate) fn turn(&mut self) {
        self.turn_until(Micros::MAX);
    }

    fn turn_until(&mut self, limit: Micros) {
        let now = self.now();
        let mut door = Door { full: now < self.full_until, bus: &mut self.bus };
        self.driver.poll(now, &mut door);
        if !self.holding {
            self.fly();
        }
        let until = self.driver.deadline().max(now + 1).min(limit);
        let waited = self.backlog.pop_front().map(|(_, event)| (now, event));
        if let Some((at, event)) = waited.or_else(|| self.bus.receive(until).unwrap()) {
            let mut door = Door { full: at < self.full_until, bus: &mut self.bus };
            match event {
                Event::Frame(frame) => self.driver.receive(&frame, at, &mut door),
                Event::BusOff => self.driver.event(BusEvent::BusOff, at, &mut door),
                Event::ErrorPassive => self.driver.event(BusEvent::ErrorPassive, at, &mut door),
                Event::Restarted | Event::Overrun | Event::NotSent => {}
            }
        }
    }

    /// Small motions of all joints in the mode's unit, once a cycle.
    fn fly(&mut self) {
        if self.pilot.enable && self.driver.phase() == Phase::Ready {
            self.driver.enable().unwrap();
        }
        let cycles = self.driver.counters().cycles;
        if self.driver.phase() != Phase::Running || cycles == self.cycle {
            return;
        }
        // The first cycle after this one was not running: from where the joints are held.
        if cycles != self.cycle + 1 {
            (self.base, self.phase) = (self.driver.setpoints(), 0.0);
        }
        self.cycle = cycles;
        // What came too late for its slot is given again.
        let dropped = self.driver.counters().dropped;
        if std::mem::replace(&mut self.dropped, dropped) == dropped {
            self.phase += 0.005;
        }
        let (wave, now) = ((2.0 * self.phase).sin(), self.now());
        let mut targets = match self.driver.control() {
            ControlMode::ProfilePosition => START.map(|q| q + 0.05 * (self.phase / 0.2).floor().sin()),
            ControlMode::InterpolatedPosition => {
                self.base.map(|q| q + 0.05 * (1.0 - (2.0 * self.phase).cos()))
            }
            ControlMode::Velocity => [0.15 * wave; 6],
            ControlMode::Current => [0.05 * wave; 6],
        };
        if self.pilot.bad > 0 {
            self.pilot.bad -= 1;
            targets[2] = self.pilot.bad_value;
        }
        if self.driver.set(&targets).is_ok() {
            self.accepted.push((now, targets));
        }
    }

    pub(crate) fn run(&mut self, time: Micros) {
        let until = self.now() + time;
        while self.now() < until {
            self.turn_until(until);
        }
    }

    /// Runs until `done`, at most `limit` µs; whether it came to that.
    pub(crate) fn run_until(&mut self, limit: Micros, done: impl Fn(&World) -> bool) -> bool {
        let until = self.now() + limit;
        while self.now() < until {
            if done(self) {
                return true;
            }
            self.turn();
        }
        done(self)
    }

    /// Runs while the caller gives no set-points.
    pub(crate) fn hold_pilot(&mut self, time: Micros) {
        let until = self.now() + time;
        while self.now() < until {
            self.holding = true;
            self.turn();
            self.holding = false;
        }
    }

    /// The bus goes on without the driver: nobody polls it.
    pub(crate) fn run_without_driver(&mut self, time: Micros) {
        let until = self.now() + time;
        while let Some(event) = self.bus.receive(until).unwrap() {
            self.backlog.push_back(event);
        }
    }

    /// Controlwords that reached the drives since `from`.
    pub(crate) fn words(&self, from: Micros) -> impl Iterator<Item = (Micros, NodeId, Controlword)> + '_ {
        self.bus.peer().heard.iter().filter(move |(at, _)| *at >= from).filter_map(|(at, frame)| {
            let Some(Cob::Rpdo(1, node)) = Cob::of(frame) else { return None };
            let bytes = frame.bytes();
            Some((*at, node, Controlword(u16::from_le_bytes([bytes[0], bytes[1]]))))
        })
    }

    /// When each node heard its first quick stop after `from`.
    pub(crate) fn quick_stops(&self, from: Micros) -> Vec<Option<Micros>> {
        LWA4P
            .joints
            .iter()
            .map(|joint| {
                self.words(from)
                    .find(|(_, node, word)| {
                        *node == joint.node && word.decode(Controlword::default()) == Command::QuickStop
                    })
                    .map(|(at, ..)| at)
            })
            .collect()
    }

    /// A word that would move a joint, after `from`, or after that joint's own quick stop where one came
    /// since `since`.
    pub(crate) fn motion_after_stop(
        &self,
        since: Micros,
        from: Micros,
    ) -> Option<(Micros, NodeId, Controlword)> {
        let stops = self.quick_stops(since);
        let stop = |node| {
            LWA4P.joints.iter().zip(&stops).find(|(joint, _)| joint.node == node).and_then(|(_, at)| *at)
        };
        self.words(since).find(|(at, node, word)| {
            *at > stop(*node).unwrap_or(from).min(from)
                && word.decode(Controlword::default()) == Command::EnableOperation
        })
    }

    /// Words that would move a joint, after `from`.
    pub(crate) fn motion_after(&self, from: Micros) -> Option<(Micros, NodeId, Controlword)> {
        self.words(from).find(|(_, _, word)| word.decode(Controlword::default()) == Command::EnableOperation)
    }
}
