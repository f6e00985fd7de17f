//! Frames from the arm: stored, and judged by what the phase expects.
//!
//! [`Foreign`] frames are those that only a master sends, and that this one did not.

use super::script::Progress;
use super::{Cause, ControlMode, Driver, Phase, Transmit};
use crate::canopen::client::SdoError;
use crate::canopen::emcy::Emcy;
use crate::canopen::{Cob, Frame, Micros, NodeId, nmt};
use crate::cia402::{State, objects};
use core::fmt;
use powerball_controller::JointNumber;

/// A boot-up message that comes twice within this time is one.
const BOOT_ECHO: Micros = 20_000;

impl<const N: usize> Driver<N> {
    /// A frame from the bus.
    pub fn receive(&mut self, frame: &Frame, now: Micros, tx: &mut impl Transmit) {
        self.now = now;
        if self.phase == Phase::Idle || self.silent {
            return;
        }
        if self.is_foreign(frame, tx) || self.phase == Phase::Listening {
            return;
        }
        let node = match Cob::of(frame) {
            Some(Cob::Tpdo(_, node) | Cob::Emcy(node) | Cob::SdoResponse(node) | Cob::Heartbeat(node)) => {
                node
            }
            _ => return,
        };
        let Some(j) = self.joint_of(node) else {
            self.counters.unexpected += 1;
            return;
        };
        match Cob::of(frame) {
            Some(Cob::Tpdo(number, _)) => self.process_data(j, number, frame, tx),
            Some(Cob::Heartbeat(_)) => match nmt::State::decode(frame) {
                Some((_, state)) => self.heartbeat(j, state, tx),
                None => self.malformed(j),
            },
            Some(Cob::Emcy(_)) => match Emcy::decode(frame) {
                Some((_, emcy)) => self.emergency(j, emcy, tx),
                None => self.malformed(j),
            },
            _ => self.answer(j, frame, tx),
        }
        self.check_queue(tx);
    }

    fn malformed(&mut self, j: usize) {
        if let Some(joint) = self.joints.get_mut(j) {
            joint.counters.malformed += 1;
        }
    }

    fn process_data(&mut self, j: usize, number: u8, frame: &Frame, tx: &mut impl Transmit) {
        let mapping =
            self.profile.tpdos.get(usize::from(number) - 1).copied().filter(|mapping| !mapping.is_empty());
        let Some(mapping) = mapping.filter(|_| self.sync.is_running()) else {
            self.counters.unexpected += 1;
            return;
        };
        let (now, cycle, all) = (self.now, self.counters.cycles, self.all_tpdos());
        let Some(joint) = self.joints.get_mut(j) else { return };
        let (velocity, since) = (joint.velocity, cycle.saturating_sub(joint.velocity_cycle));
        if !joint.update(number, &mapping, frame) {
            return;
        }
        joint.answered_at = now;
        let whole = joint.arrived == all;
        if mapping.contains(objects::VELOCITY) {
            joint.velocity_cycle = cycle;
            self.gate_velocity(j, velocity, since, tx);
        }
        if mapping.contains(objects::POSITION) {
            if let Some(joint) = self.joints.get_mut(j) {
                joint.position_cycle = cycle;
            }
            self.watch_position(j, tx);
        }
        if whole {
            self.guard_sample(j, tx);
        }
        if mapping.contains(objects::STATUSWORD) {
            self.judge_state(j, tx);
            self.watch_status(j, tx);
        }
        if mapping.contains(objects::MODE_DISPLAY) {
            self.judge_mode(j, tx);
        }
        if mapping.contains(objects::VELOCITY) && self.phase.is_live() {
            self.judge_velocity(j, tx);
        }
    }

    fn judge_state(&mut self, j: usize, tx: &mut impl Transmit) {
        let node = self.node(j);
        let Some((status, progress)) =
            self.joints.get(j).and_then(|joint| Some((joint.status?, joint.progress)))
        else {
            return;
        };
        let cause = match status.state() {
            State::Fault | State::FaultReactionActive => Some(Cause::DriveFault(node, status)),
            State::Unknown(_) => Some(Cause::UnknownState(node, status)),
            state => {
                let enabled = state == State::OperationEnabled;
                let expected = match (self.phase, progress) {
                    (Phase::Running, _) => enabled,
                    (Phase::Enabling, Progress::Waiting) | (Phase::Ready, _) => !state.has_torque(),
                    // Whether a walking joint is where it should be is judged where it walks.
                    (Phase::Enabling, Progress::Walking { .. }) => true,
                    (Phase::Enabling, _) => enabled,
                    _ => true,
                };
                (!expected).then_some(Cause::StateLost(node, status))
            }
        };
        let judging = matches!(
            self.phase,
            Phase::Starting | Phase::Ready | Phase::Enabling | Phase::Running | Phase::Stopping
        );
        if let Some(cause) = cause.filter(|_| judging) {
            self.trip(cause, tx);
        }
    }

    fn judge_mode(&mut self, j: usize, tx: &mut impl Transmit) {
        let expected = self.mode_profile().mode;
        let shown = self.joints.get(j).and_then(|joint| joint.mode).filter(|mode| *mode != expected);
        if let (Some(mode), Phase::Ready | Phase::Enabling | Phase::Running) = (shown, self.phase) {
            self.trip(Cause::WrongMode(self.node(j), mode), tx);
        }
    }

    fn judge_velocity(&mut self, j: usize, tx: &mut impl Transmit) {
        let reactions = self.profile.reactions;
        let (factor, cycles) = match self.control {
            ControlMode::Current => (reactions.torque_mode.overspeed_factor, reactions.torque_mode.cycles),
            _ => (reactions.overspeed_factor, reactions.missing_cycles),
        };
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get_mut(j)) else {
            return;
        };
        let most = profile.velocity * factor;
        if joint.velocity.abs() <= most {
            joint.overspeed_run = 0;
            return;
        }
        joint.overspeed_run = joint.overspeed_run.saturating_add(1);
        if joint.overspeed_run >= cycles {
            joint.overspeed_run = 0;
            let velocity = joint.velocity;
            self.trip(Cause::Overspeed(JointNumber::from_index(j), velocity, most), tx);
        }
    }

    fn heartbeat(&mut self, j: usize, state: nmt::State, tx: &mut impl Transmit) {
        let (now, node) = (self.now, self.node(j));
        let Some(joint) = self.joints.get_mut(j) else { return };
        let before = joint.nmt.replace(state);
        if joint.heartbeat.is_watching() {
            joint.heartbeat.beat(now);
        }
        if state == nmt::State::BootUp {
            match (self.phase, joint.booted) {
                (Phase::Boot, _) => joint.booted = Some(now),
                (Phase::Identify, Some(booted)) if now.saturating_sub(booted) < BOOT_ECHO => {}
                _ => self.trip(Cause::Rebooted(node), tx),
            }
        } else if state != nmt::State::Operational
            // A heartbeat from before the start may have waited behind everything else: its priority is the
            // lowest.
            && before == Some(nmt::State::Operational)
            && self.sync.is_running()
            && self.phase != Phase::Starting
        {
            self.trip(Cause::NotOperational(node), tx);
        }
    }

    pub(super) fn watch_heartbeats(&mut self, tx: &mut impl Transmit) {
        for j in 0..N {
            let now = self.now;
            let Some(joint) = self.joints.get_mut(j) else { continue };
            if joint.heartbeat.is_lost(now) {
                // Reported once; it is watched again after a restart.
                joint.heartbeat.stop();
                self.trip(Cause::HeartbeatLost(self.node(j)), tx);
            }
        }
    }

    fn emergency(&mut self, j: usize, emcy: Emcy, tx: &mut impl Transmit) {
        let node: NodeId = self.node(j);
        let Some(joint) = self.joints.get_mut(j) else { return };
        if emcy.is_reset() {
            joint.emergency = None;
            return;
        }
        joint.counters.emergencies += 1;
        let repeated = joint.emergency.is_some_and(|last| last.code == emcy.code);
        joint.emergency = Some(emcy);
        let cause = Cause::Emergency(node, emcy);
        match self.phase {
            // Drives without motor power say so when they boot. Whether they can be used is read from their
            // state later.
            Phase::Boot | Phase::Identify | Phase::Configure | Phase::Verify if !repeated => self.note(cause),
            Phase::Starting | Phase::Ready | Phase::Enabling | Phase::Running => self.trip(cause, tx),
            Phase::Stopping | Phase::Faulted | Phase::Resetting if !repeated => self.trip(cause, tx),
            _ => {}
        }
    }

    fn answer(&mut self, j: usize, frame: &Frame, tx: &mut impl Transmit) {
        let now = self.now;
        let Some(joint) = self.joints.get_mut(j) else { return };
        let step = joint.client.receive(frame, now);
        if let Some(frame) = step.send {
            self.send(frame, tx);
        }
        let Some(result) = step.done else { return };
        match self.phase {
            Phase::Identify | Phase::Configure | Phase::Verify => self.script_result(j, result, tx),
            Phase::Enabling => self.commutation_result(j, result, tx),
            Phase::Faulted => match result {
                Ok(value) => self.diagnosed(j, Some(value)),
                Err(SdoError::Aborted(_)) => self.diagnosed(j, None),
                Err(_) => {}
            },
            _ => {}
        }
    }
}

// Frames that only a master sends, and that this one did not: another master is on the bus.

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

impl<const N: usize> Driver<N> {
    /// Whether `frame` is one that only a master sends; it is judged then. A transport does not return frames
    /// that this end has sent, so the frame is from another master.
    pub(super) fn is_foreign(&mut self, frame: &Frame, tx: &mut impl Transmit) -> bool {
        let master = self.profile.master;
        let foreign = match Cob::of(frame) {
            Some(Cob::Sync) => Foreign::Sync,
            Some(Cob::Nmt) => Foreign::Nmt,
            Some(Cob::Rpdo(_, node)) if self.joint_of(node).is_some() => Foreign::Setpoints(node),
            Some(Cob::Heartbeat(node)) if node == master => Foreign::Heartbeat(node),
            _ => return false,
        };
        // An arm that is stopped already is reported once.
        let known = matches!(self.phase, Phase::Stopping | Phase::Faulted | Phase::Resetting)
            && matches!(self.cause, Some(Cause::OtherMaster(_)));
        if !known {
            self.trip(Cause::OtherMaster(foreign), tx);
        }
        true
    }

    /// Listens before anything is sent: no other master may be on the bus.
    pub(super) fn poll_listening(&mut self) {
        if self.elapsed() >= self.profile.reactions.listen_time {
            self.enter(Phase::Boot);
        }
    }

    /// A command of network management to each node of the arm, and to no other device on the bus; whether all
    /// of them could be queued.
    pub(super) fn manage(&mut self, command: nmt::Command, tx: &mut impl Transmit) -> bool {
        let mut all = true;
        for j in 0..N {
            all &= self.send(command.frame(Some(self.node(j))), tx);
        }
        all
    }
}
