//! Frames from the arm: stored, and judged by what the phase expects.

use super::cause::{Cause, Foreign};
use super::joint::Transmit;
use super::machine::Driver;
use super::phase::Phase;
use super::stage::Stage;
use crate::canopen::client::SdoError;
use crate::canopen::emcy::Emcy;
use crate::canopen::{Cob, Frame, Micros, Object, nmt};
use crate::cia402::objects;

/// A boot-up message that comes twice within this time is one.
const BOOT_ECHO: Micros = 20_000;

/// What is checked of a joint when its data has come.
type Check<const N: usize> = fn(&mut Driver<N>, usize) -> Option<Cause>;

impl<const N: usize> Driver<N> {
    /// A frame from the bus.
    pub fn receive(&mut self, frame: &Frame, now: Micros, tx: &mut impl Transmit) {
        self.arm.now = now;
        if matches!(self.stage, Stage::Idle) || self.latch.silent {
            return;
        }
        let found = self.take(frame, tx);
        self.act(found, tx);
        self.check_queue(tx);
    }

    fn take(&mut self, frame: &Frame, tx: &mut impl Transmit) -> Option<Cause> {
        if let Some(foreign) = self.foreign(frame) {
            // An arm that is stopped already is reported once.
            let known = self.stage.is_stopped() && matches!(self.latch.cause(), Some(Cause::OtherMaster(_)));
            return (!known).then_some(Cause::OtherMaster(foreign));
        }
        let cob = Cob::of(frame)?;
        let (Cob::Tpdo(_, node) | Cob::Emcy(node) | Cob::SdoResponse(node) | Cob::Heartbeat(node)) = cob
        else {
            return None;
        };
        if matches!(self.stage, Stage::Listening { .. }) {
            return None;
        }
        let Some(j) = self.arm.joint_of(node) else {
            self.arm.counters.unexpected += 1;
            return None;
        };
        match cob {
            Cob::Tpdo(number, _) => self.process_data(j, number, frame, tx),
            Cob::Heartbeat(_) => match nmt::State::decode(frame) {
                Some((_, state)) => return self.heartbeat(j, state),
                None => self.arm.joints.get_mut(j)?.counters.malformed += 1,
            },
            Cob::Emcy(_) => match Emcy::decode(frame) {
                Some((_, emcy)) => return self.emergency(j, emcy),
                None => self.arm.joints.get_mut(j)?.counters.malformed += 1,
            },
            _ => return self.answer(j, frame, tx),
        }
        None
    }

    /// Whether `frame` is one that only a master sends. A transport does not return frames that this end has
    /// sent, so the frame is from another master.
    fn foreign(&self, frame: &Frame) -> Option<Foreign> {
        match Cob::of(frame)? {
            Cob::Sync => Some(Foreign::Sync),
            Cob::Nmt => Some(Foreign::Nmt),
            Cob::Rpdo(_, node) if self.arm.joint_of(node).is_some() => Some(Foreign::Setpoints(node)),
            Cob::Heartbeat(node) if node == self.arm.profile.master => Some(Foreign::Heartbeat(node)),
            _ => None,
        }
    }

    fn process_data(&mut self, j: usize, number: u8, frame: &Frame, tx: &mut impl Transmit) {
        let mapping = self.arm.profile.tpdos.get(usize::from(number) - 1).copied();
        let used = mapping.filter(|mapping| !mapping.is_empty() && self.raster.is_running());
        let Some(mapping) = used else {
            self.arm.counters.unexpected += 1;
            return;
        };
        let (at, all) = ((self.arm.now, self.arm.counters.cycles), self.arm.all_tpdos());
        let Some(joint) = self.arm.joints.get_mut(j) else { return };
        if !joint.update(number, &mapping, frame, at) {
            return;
        }
        let has = |object: Object| mapping.contains(object);
        let (position, velocity) = (has(objects::POSITION), has(objects::VELOCITY));
        let (status, mode) = (has(objects::STATUSWORD), has(objects::MODE_DISPLAY));
        let checks: [(bool, Check<N>); 7] = [
            (velocity, |driver, j| {
                if driver.follows_currents() { driver.torque.gate_velocity(&mut driver.arm, j) } else { None }
            }),
            (position, |driver, j| driver.watch.jump(&driver.arm, driver.stage.is_up(), j)),
            (joint.presence.is_whole(all), |driver, j| {
                let at = driver.raster.synced_at();
                if driver.follows_currents() { driver.torque.slip(&driver.arm, at, j) } else { None }
            }),
            (status, |driver, j| driver.stage.wrong_state(&driver.arm, j)),
            (status, |driver, j| {
                let (running, released) = (driver.stage.is_running(), driver.stage.is_released(j));
                driver.watch.status(&mut driver.arm, running, released, j)
            }),
            (mode, |driver, j| driver.stage.wrong_mode(&driver.arm, j)),
            (
                velocity,
                |driver, j| {
                    if driver.stage.is_live() { driver.watch.speed(&driver.arm, j) } else { None }
                },
            ),
        ];
        for (due, check) in checks {
            if due {
                let found = check(self, j);
                self.act(found, tx);
            }
        }
    }

    fn heartbeat(&mut self, j: usize, state: nmt::State) -> Option<Cause> {
        let (now, node) = (self.arm.now, self.arm.node(j));
        let joint = self.arm.joints.get_mut(j)?;
        let before = joint.nmt.replace(state);
        joint.presence.beat(now);
        if state == nmt::State::BootUp {
            let echo = joint.booted.is_some_and(|booted| now.saturating_sub(booted) < BOOT_ECHO);
            return match self.stage.phase() {
                Phase::Boot => {
                    joint.booted = Some(now);
                    None
                }
                Phase::Identify if echo => None,
                _ => Some(Cause::Rebooted(node)),
            };
        }
        // A heartbeat from before the start may have waited behind everything else: its priority is the
        // lowest.
        let judged = self.raster.is_running() && !matches!(self.stage, Stage::Starting { .. });
        let was = before == Some(nmt::State::Operational);
        (state != nmt::State::Operational && was && judged).then_some(Cause::NotOperational(node))
    }

    fn emergency(&mut self, j: usize, emcy: Emcy) -> Option<Cause> {
        let cause = Cause::Emergency(self.arm.node(j), emcy);
        let joint = self.arm.joints.get_mut(j)?;
        if emcy.is_reset() {
            joint.emergency = None;
            return None;
        }
        joint.counters.emergencies += 1;
        let repeated = joint.emergency.replace(emcy).is_some_and(|last| last.code == emcy.code);
        match self.stage {
            Stage::Starting { .. } | Stage::Ready | Stage::Enabling(_) | Stage::Running(_) => Some(cause),
            _ if repeated => None,
            // Drives without motor power say so when they boot. Whether they can be used is read from their
            // state later.
            Stage::Boot(_) | Stage::Scripts(_) => {
                self.arm.note(cause);
                None
            }
            Stage::Stopping(_) | Stage::Faulted(_) | Stage::Resetting(_) => Some(cause),
            Stage::Idle | Stage::Listening { .. } => None,
        }
    }

    /// An answer of a drive's server.
    fn answer(&mut self, j: usize, frame: &Frame, tx: &mut impl Transmit) -> Option<Cause> {
        let step = self.arm.joints.get_mut(j)?.client.receive(frame, self.arm.now);
        if let Some(frame) = step.send {
            self.arm.send(frame, tx);
        }
        let result = step.done?;
        match &mut self.stage {
            Stage::Scripts(scripts) => scripts.answer(&mut self.arm, j, result).err(),
            Stage::Enabling(enabling) => enabling.answer(&self.arm, j, result).err(),
            Stage::Faulted(diagnosis) => {
                if let Ok(_) | Err(SdoError::Aborted(_)) = result {
                    diagnosis.answer(j, result.ok(), &mut self.latch.details);
                }
                None
            }
            _ => None,
        }
    }
}
