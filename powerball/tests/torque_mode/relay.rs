//! The virtual arm behind a relay that changes frames of one joint from a moment on, and a record of where
//! the arm truly was. The relay stands on the bus in memory, where a multicast relay would stand between two
//! programs.

use powerball::bus::canopen::{Cob, Frame, Micros, NodeId};
use powerball::bus::cia402::{Command, Controlword};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::transport::Peer;
use powerball::virtual_arm::VirtualArm;
use powerball::virtual_arm::slave;
use std::cell::Cell;
use std::rc::Rc;

/// What goes wrong at the victim from the moment on at which the relay is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    None,
    /// Position stays, velocity goes on; both stay; position stays and velocity is 0; all process data stays.
    PositionFrozen,
    EncoderFrozen,
    Replayed,
    BrakeCloses,
    NoTorque,
    LittleTorque,
    SetpointsLost,
    FullTorque,
    CommandTurned,
    PositionMirrored,
    VelocityTurned,
    VelocityHuge,
    Drift,
    HalfScale,
    Step,
    TorqueTurned,
    TorqueFull,
    /// The drive says the current that was asked for, and gives none.
    Powerless,
    Silent,
    ShortData,
    /// A tenth of its process data is lost.
    Lossy,
    /// One velocity reads 2³¹.
    VelocityHugeOnce,
}

impl Fault {
    pub(crate) const ALL: [(Fault, &'static str); 20] = [
        (Fault::PositionFrozen, "position frozen"),
        (Fault::EncoderFrozen, "encoder frozen: position constant, velocity 0"),
        (Fault::Replayed, "process data replayed unchanged"),
        (Fault::BrakeCloses, "brake closes on a moving joint"),
        (Fault::NoTorque, "drive gives no torque"),
        (Fault::LittleTorque, "drive gives ± 2 % of its rated torque"),
        (Fault::SetpointsLost, "set-points lost to one drive"),
        (Fault::FullTorque, "torque forced to its maximum"),
        (Fault::CommandTurned, "sign of the command turned"),
        (Fault::PositionMirrored, "sign of the position turned"),
        (Fault::VelocityTurned, "sign of the velocity turned"),
        (Fault::VelocityHuge, "velocity reads 2³¹"),
        (Fault::Drift, "position drifts by 0.05 rad/s"),
        (Fault::HalfScale, "position moves at half its scale"),
        (Fault::Step, "position steps by 26 mrad"),
        (Fault::TorqueTurned, "sign of the measured torque turned"),
        (Fault::TorqueFull, "measured torque at its maximum"),
        (Fault::Powerless, "no torque, and the current reads as asked for"),
        (Fault::Silent, "node silent"),
        (Fault::ShortData, "process data of a wrong length"),
    ];
}

/// The arm, and what was heard and seen.
#[derive(Debug)]
pub(crate) struct Relay {
    pub(crate) arm: VirtualArm,
    fault: Fault,
    joint: usize,
    /// The caller's word that it begins.
    begin: Rc<Cell<bool>>,
    pub(crate) began: Option<Micros>,
    /// When the victim got its quick stop.
    pub(crate) stopped: Option<Micros>,
    /// True positions and the greatest velocity by time.
    pub(crate) truth: Vec<(Micros, [f64; 6])>,
    kept: [Option<Frame>; 2],
    position: Option<i32>,
    asked: i16,
    /// Frames of process data since it began.
    frames: u32,
    now: Micros,
}

impl Relay {
    pub(crate) fn new(arm: VirtualArm, fault: Fault, joint: usize, begin: Rc<Cell<bool>>) -> Relay {
        Relay {
            arm,
            fault,
            joint,
            begin,
            began: None,
            stopped: None,
            truth: Vec::new(),
            kept: [None; 2],
            position: None,
            asked: 0,
            frames: 0,
            now: 0,
        }
    }

    /// Whether a drive of an interpolating arm can have it: what is done to torques cannot be.
    pub(crate) fn is_of_positions(fault: Fault) -> bool {
        !matches!(
            fault,
            Fault::NoTorque
                | Fault::LittleTorque
                | Fault::FullTorque
                | Fault::CommandTurned
                | Fault::Powerless
                | Fault::SetpointsLost
        )
    }

    fn node(&self) -> NodeId {
        LWA4P.joints[self.joint].node
    }

    fn is_on(&self) -> bool {
        self.began.is_some()
    }

    /// A receive PDO of the victim on its way to it.
    fn pass_setpoint(&mut self, frame: &Frame) -> Option<Frame> {
        let b = frame.bytes();
        let word = Controlword(u16::from_le_bytes([b[0], b[1]]));
        if word.decode(Controlword::default()) == Command::QuickStop && self.is_on() {
            self.stopped.get_or_insert(self.now);
        }
        if b.len() != 4 {
            return Some(*frame);
        }
        let asked = i16::from_le_bytes([b[2], b[3]]);
        self.asked = asked;
        // The stop itself gets through.
        if !self.is_on() || word.decode(Controlword::default()) != Command::EnableOperation {
            return Some(*frame);
        }
        let sent = match self.fault {
            Fault::SetpointsLost => return None,
            Fault::NoTorque | Fault::Powerless => 0,
            Fault::LittleTorque => asked.clamp(-20, 20),
            Fault::FullTorque => i16::MAX,
            Fault::CommandTurned => -asked,
            _ => return Some(*frame),
        };
        let s = sent.to_le_bytes();
        Frame::from_raw(frame.raw_id(), &[b[0], b[1], s[0], s[1]])
    }

    /// Process data of the victim on its way to the master.
    fn pass_data(&mut self, number: u8, frame: &Frame) -> Option<Frame> {
        let place = usize::from(number) - 1;
        self.frames += u32::from(self.is_on());
        // A fixed sequence of no pattern that the two frames of a cycle share (Knuth's multiplicative hash).
        if self.fault == Fault::Lossy
            && self.is_on()
            && self.frames.wrapping_mul(2_654_435_769) < u32::MAX / 10
        {
            return None;
        }
        let b = frame.bytes().to_vec();
        if !self.is_on() {
            self.kept[place] = Some(*frame);
            if number == 1 {
                self.position = Some(i32::from_le_bytes([b[4], b[5], b[6], b[7]]));
            }
            return Some(*frame);
        }
        let id = frame.raw_id();
        let time = (self.now - self.began.unwrap_or(self.now)) as f64 * 1e-6;
        let per_radian = LWA4P.joints[self.joint].units.counts_per_radian;
        if number == 1 {
            let mut torque = i16::from_le_bytes([b[2], b[3]]);
            let mut position = i32::from_le_bytes([b[4], b[5], b[6], b[7]]);
            let from = self.position.unwrap_or(position);
            match self.fault {
                Fault::Replayed => return self.kept[0],
                Fault::PositionFrozen | Fault::EncoderFrozen => position = from,
                Fault::PositionMirrored => position = -position,
                Fault::Drift => position += (0.05 * time * per_radian) as i32,
                Fault::HalfScale => position = from + (position - from) / 2,
                Fault::Step => position += (0.026 * per_radian) as i32,
                Fault::TorqueTurned => torque = -torque,
                Fault::TorqueFull => torque = i16::MAX,
                Fault::Powerless => torque = self.asked,
                Fault::Silent => return None,
                Fault::ShortData => return Some(frame.truncated(7)),
                _ => return Some(*frame),
            }
            let mut bytes = b;
            bytes[2..4].copy_from_slice(&torque.to_le_bytes());
            bytes[4..8].copy_from_slice(&position.to_le_bytes());
            return Frame::from_raw(id, &bytes);
        }
        let mut velocity = i32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        match self.fault {
            Fault::Replayed => return self.kept[1],
            Fault::EncoderFrozen => velocity = 0,
            Fault::VelocityTurned => velocity = -velocity,
            Fault::VelocityHuge => velocity = i32::MIN,
            Fault::VelocityHugeOnce if self.frames <= 2 => velocity = i32::MIN,
            Fault::Silent => return None,
            Fault::ShortData => return Some(frame.truncated(3)),
            _ => return Some(*frame),
        }
        let mut bytes = b;
        bytes[..4].copy_from_slice(&velocity.to_le_bytes());
        Frame::from_raw(id, &bytes)
    }
}

impl Peer for Relay {
    fn receive(&mut self, frame: &Frame, now: Micros) {
        self.now = now;
        let passed = match Cob::of(frame) {
            Some(Cob::Rpdo(1, node)) if node == self.node() => self.pass_setpoint(frame),
            _ => Some(*frame),
        };
        if let Some(frame) = passed {
            self.arm.receive(&frame, now);
        }
    }

    fn advance(&mut self, now: Micros) {
        self.now = now;
        if self.begin.get() && self.began.is_none() {
            self.began = Some(now);
            if self.fault == Fault::BrakeCloses {
                self.arm.fault(self.node(), slave::Fault::BrakeStuck(true));
            }
            if self.fault == Fault::Silent {
                self.arm.fault(self.node(), slave::Fault::Silent(true));
            }
        }
        self.arm.advance(now);
        self.truth.push((now, std::array::from_fn(|j| self.arm.simulation().position(j))));
    }

    fn wake(&self) -> Micros {
        self.arm.wake()
    }

    fn transmit(&mut self) -> Option<Frame> {
        loop {
            let frame = self.arm.transmit()?;
            let passed = match Cob::of(&frame) {
                Some(Cob::Tpdo(number @ (1 | 2), node)) if node == self.node() => {
                    self.pass_data(number, &frame)
                }
                _ => Some(frame),
            };
            if passed.is_some() {
                return passed;
            }
        }
    }
}
