//! Stopping, staying stopped, and the way back: causes are latched here and nowhere else.

use super::{BusEvent, Cause, Details, Driver, Phase, Transmit};
use crate::canopen::client::Value;
use crate::canopen::nmt;
use crate::canopen::objects::{ERROR_HISTORY, ERROR_REGISTER, MANUFACTURER_STATUS};
use crate::canopen::{Micros, Object};
use crate::cia402::{State, schunk};

/// How far a stop has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StopStage {
    /// Quick stop, until all joints are at rest or the time is over.
    Quick,
    /// Halt closes the brakes, from `since` on.
    Brake { since: Micros },
    /// 0x0000 takes the torque away, last, from `since` on.
    Off { since: Micros },
}

/// How far the reset of faults has come. It is tried once for each acknowledgement, never in a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ResetStage {
    /// 0x0000, so that the next word is an edge.
    Low,
    /// 0x0080.
    Edge,
    /// 0x0000 again; after a while the state is checked.
    Wait,
}

/// Cycles for which each word of a fault reset is sent.
const WORD_CYCLES: Micros = 4;

/// Objects that are read from the drive that caused the stop.
const DIAGNOSIS: [Object; 4] =
    [ERROR_REGISTER, MANUFACTURER_STATUS, schunk::ERROR_DETAIL, schunk::ERROR_LINE];

impl<const N: usize> Driver<N> {
    /// Stops the arm on request: quick stop at once, brakes, torque off. In any phase.
    pub fn stop(&mut self, now: Micros, tx: &mut impl Transmit) {
        self.now = now;
        match self.phase {
            Phase::Enabling | Phase::Running => self.begin_stop(tx),
            Phase::Listening => self.enter(Phase::Idle),
            Phase::Boot | Phase::Identify | Phase::Configure | Phase::Verify => self.give_up(Phase::Idle, tx),
            Phase::Starting | Phase::Resetting => self.begin_stop(tx),
            Phase::Idle | Phase::Ready | Phase::Stopping | Phase::Faulted => {}
        }
    }

    /// Stops the arm because the program was asked to end: like [`Driver::stop`], but latched, so that
    /// nothing moves again. If a joint may have torque, quick stop is sent at once in every phase, also if
    /// the arm is being stopped already: its brakes stay closed then. One call is enough.
    pub fn interrupt(&mut self, now: Micros, tx: &mut impl Transmit) {
        self.now = now;
        if self.interrupted || self.phase == Phase::Idle {
            return;
        }
        self.interrupted = true;
        let stopping = self.phase == Phase::Stopping;
        self.trip(Cause::Interrupted, tx);
        let torque = |joint: &super::Joint| joint.state().is_some_and(State::has_torque);
        if self.silent || !self.joints.iter().any(torque) {
            return;
        }
        if stopping {
            if let StopStage::Off { .. } = self.stop {
                self.stop = StopStage::Brake { since: now };
            }
            self.joints.iter_mut().for_each(|joint| joint.unsent = true);
            self.retry_stop(tx);
        } else if self.phase == Phase::Faulted && self.sync.is_running() {
            self.begin_stop(tx);
        }
    }

    /// Handles an event of the transport.
    pub fn event(&mut self, event: BusEvent, now: Micros, tx: &mut impl Transmit) {
        self.now = now;
        match event {
            BusEvent::ErrorPassive => self.counters.error_passive += 1,
            BusEvent::Overrun => self.counters.overruns += 1,
            BusEvent::TransmitQueueFull => {
                self.counters.queue_full += 1;
                if self.phase.is_live() {
                    self.trip(Cause::TransmitQueueFull, tx);
                }
            }
            BusEvent::BusOff if self.phase != Phase::Idle => {
                // Nothing more can be sent to the arm; its drives miss the heartbeat and stop themselves.
                tx.discard_queued();
                self.latch(Cause::BusOff);
                self.silent = true;
                self.sync.stop();
                self.enter(Phase::Faulted);
            }
            BusEvent::BusOff => {}
        }
    }

    /// The first cause stays. Only missing data is replaced by a cause that explains it: data of a node that
    /// restarts is missing before the node reports it. A cause that needs a restart is never forgotten.
    fn latch(&mut self, cause: Cause) {
        self.note(cause);
        let tells_more = |first| match first {
            Cause::DataMissing(node) => cause.needs_restart() && cause.node() == Some(node),
            _ => false,
        };
        if self.cause.is_none_or(tells_more) {
            self.cause = Some(cause);
        }
        // If first data is missing for a reason that a fault reset cannot correct, the nodes must be
        // configured again.
        let mendable = matches!(cause, Cause::DriveFault(..) | Cause::Emergency(..));
        self.restart |= cause.needs_restart() || self.phase == Phase::Starting && !mendable;
    }

    /// Something is wrong: latches `cause` where it is the first, and stops what may move.
    pub(super) fn trip(&mut self, cause: Cause, tx: &mut impl Transmit) {
        if self.phase == Phase::Idle {
            return;
        }
        self.latch(cause);
        match self.phase {
            Phase::Enabling | Phase::Running => self.begin_stop(tx),
            Phase::Boot | Phase::Identify | Phase::Configure | Phase::Verify => {
                self.give_up(Phase::Faulted, tx)
            }
            // Nothing was sent yet, and nothing is: not even a heartbeat.
            Phase::Listening => {
                self.silent = true;
                self.fault();
            }
            Phase::Starting | Phase::Ready | Phase::Resetting => self.fault(),
            Phase::Idle | Phase::Stopping | Phase::Faulted => {}
        }
    }

    /// No process data flows yet: the nodes are kept from taking any.
    fn give_up(&mut self, phase: Phase, tx: &mut impl Transmit) {
        self.joints.iter_mut().for_each(|joint| joint.client.cancel());
        (self.details, self.diagnosis) = (Details::default(), None);
        self.sync.stop();
        self.manage(nmt::Command::EnterPreOperational, tx);
        self.enter(phase);
    }

    fn fault(&mut self) {
        self.details = Details::default();
        let culprit = self.cause.and_then(|cause| cause.node()).and_then(|node| self.joint_of(node));
        self.diagnosis = culprit.map(|j| (j, 0));
        self.enter(Phase::Faulted);
    }

    fn begin_stop(&mut self, tx: &mut impl Transmit) {
        // A set-point that waits in a queue would act after the stop.
        tx.discard_queued();
        self.joints.iter_mut().for_each(|joint| {
            joint.client.cancel();
            joint.unsent = true;
        });
        self.streaming = false;
        self.stop = StopStage::Quick;
        self.enter(Phase::Stopping);
        self.retry_stop(tx);
    }

    /// Sends the stop to those joints to which it could not be queued yet.
    pub(super) fn retry_stop(&mut self, tx: &mut impl Transmit) {
        for j in 0..N {
            if self.joints.get(j).is_some_and(|joint| joint.unsent) {
                let sent = self.send_joint(j, tx);
                if let Some(joint) = self.joints.get_mut(j) {
                    joint.unsent = !sent;
                }
            }
        }
        self.queue_full = false;
    }

    /// Once a cycle while stopping: quick stop, brakes, torque off.
    pub(super) fn advance_stop(&mut self, tx: &mut impl Transmit) {
        if self.phase != Phase::Stopping {
            return;
        }
        let (reactions, now) = (self.profile.reactions, self.now);
        let rest = reactions.rest_velocity;
        match self.stop {
            StopStage::Quick => {
                // Data that is missing proves no rest.
                let resting = self.joints.iter().all(|joint| {
                    let off = joint.state().is_some_and(|state| !state.has_torque());
                    joint.missing_run == 0 && (off || joint.velocity.abs() < rest)
                });
                let settled = self.elapsed() >= 3 * self.profile.sync_period;
                if (resting && settled) || self.elapsed() >= reactions.stop_timeout {
                    self.stop = StopStage::Brake { since: now };
                }
            }
            StopStage::Brake { since } if now.saturating_sub(since) >= reactions.brake_time => {
                self.stop = StopStage::Off { since: now };
            }
            StopStage::Off { since } => {
                let off = |joint: &super::Joint| joint.state().is_some_and(|state| !state.has_torque());
                let settled = now.saturating_sub(since) >= 3 * self.profile.sync_period;
                let stuck = self.joints.iter().position(|joint| !off(joint));
                match stuck {
                    None if settled => self.end_stop(),
                    Some(j) if now.saturating_sub(since) >= reactions.transition_timeout => {
                        if let Some(status) = self.joints.get(j).and_then(|joint| joint.status) {
                            self.trip(Cause::StateLost(self.node(j), status), tx);
                        }
                        self.end_stop();
                    }
                    _ => {}
                }
            }
            StopStage::Brake { .. } => {}
        }
    }

    fn end_stop(&mut self) {
        match self.cause {
            // On request only: ready again if everything is in order, otherwise the driver waits for it.
            None => {
                let whole =
                    self.joints.iter().all(|joint| joint.missing_run == 0) && self.unready().is_none();
                self.enter(if whole { Phase::Ready } else { Phase::Starting });
            }
            Some(_) => self.fault(),
        }
    }

    /// Once a cycle while resetting faults.
    pub(super) fn advance_reset(&mut self, tx: &mut impl Transmit) {
        if self.phase != Phase::Resetting {
            return;
        }
        let word = WORD_CYCLES * self.profile.sync_period;
        match self.reset {
            ResetStage::Low if self.elapsed() >= word => self.reset = ResetStage::Edge,
            ResetStage::Edge if self.elapsed() >= 2 * word => {
                self.reset = ResetStage::Wait;
                for j in 0..N {
                    let now = self.now;
                    if let Some(joint) = self.joints.get_mut(j) {
                        joint.emergency = None;
                        // The history; whether the drive clears it decides nothing.
                        let frame = joint.client.write(ERROR_HISTORY, Value::number(0, 1), now);
                        self.send(frame, tx);
                    }
                }
            }
            ResetStage::Wait if self.elapsed() >= 2 * word + self.profile.reactions.fault_reset_time => {
                let faulty = |joint: &super::Joint| {
                    matches!(joint.state(), Some(State::Fault | State::FaultReactionActive))
                };
                self.joints.iter_mut().for_each(|joint| joint.client.cancel());
                match self.joints.iter().position(faulty) {
                    None => self.enter(Phase::Starting),
                    Some(j) => {
                        if let Some(status) = self.joints.get(j).and_then(|joint| joint.status) {
                            self.trip(Cause::DriveFault(self.node(j), status), tx);
                        }
                    }
                }
            }
            _ => {}
        }
    }

    /// After a stop: the error details of the drive that caused it.
    pub(super) fn poll_diagnosis(&mut self, tx: &mut impl Transmit) {
        let Some((j, step)) = self.diagnosis else { return };
        let now = self.now;
        let Some(joint) = self.joints.get_mut(j) else { return };
        if joint.client.is_idle() {
            let Some(object) = DIAGNOSIS.get(step) else {
                self.diagnosis = None;
                return;
            };
            let frame = joint.client.read(*object, now);
            self.send(frame, tx);
        } else {
            let polled = joint.client.poll(now);
            if let Some(frame) = polled.send {
                self.send(frame, tx);
            }
            if polled.done.is_some() {
                // A silent node is not read further.
                self.diagnosis = None;
            }
        }
    }

    /// An answer to [`Driver::poll_diagnosis`].
    pub(super) fn diagnosed(&mut self, j: usize, value: Option<Value>) {
        let Some((culprit, step)) = self.diagnosis.filter(|(culprit, _)| *culprit == j) else { return };
        let number = value.and_then(|value| value.unsigned());
        match step {
            0 => self.details.register = number.map(|n| n as u8),
            1 => self.details.vendor_code = number.map(|n| n as u8),
            2 => self.details.detail = number.map(f32::from_bits),
            _ => self.details.line = number.map(|n| n as u16),
        }
        self.diagnosis = Some((culprit, step + 1));
    }
}
