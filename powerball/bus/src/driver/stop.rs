//! Stopping, staying stopped, and the way back.

use super::arm::Arm;
use super::cause::{Cause, Details};
use super::joint::{Joint, Transmit};
use crate::canopen::client::Value;
use crate::canopen::objects::{ERROR_HISTORY, ERROR_REGISTER, MANUFACTURER_STATUS};
use crate::canopen::{Micros, Object};
use crate::cia402::{Command, Controlword, State, schunk};

/// How far a stop has come.
#[derive(Clone, Copy, Debug, PartialEq)]
enum StopStage {
    /// Quick stop, until all joints are at rest or the time is over.
    Quick,
    /// Halt closes the brakes, from `since` on.
    Brake { since: Micros },
    /// 0x0000 takes the torque away, last, from `since` on.
    Off { since: Micros },
}

/// A stop in progress.
#[derive(Clone, Debug)]
pub(super) struct Stop<const N: usize> {
    since: Micros,
    stage: StopStage,
    /// Joints to which it could not be queued yet.
    unsent: [bool; N],
}

impl<const N: usize> Stop<N> {
    pub(super) const fn new(now: Micros) -> Self {
        Stop { since: now, stage: StopStage::Quick, unsent: [true; N] }
    }

    /// The controlword for each joint now.
    pub(super) fn word(&self) -> Controlword {
        let quick = Controlword::command(Command::QuickStop);
        match self.stage {
            StopStage::Quick => quick,
            StopStage::Brake { .. } => quick.with(Controlword::HALT),
            StopStage::Off { .. } => Controlword::command(Command::DisableVoltage),
        }
    }

    /// Sends the stop to those joints to which it could not be queued yet.
    pub(super) fn retry(&mut self, arm: &mut Arm<N>, tx: &mut impl Transmit) {
        let word = self.word();
        for (j, unsent) in self.unsent.iter_mut().enumerate() {
            *unsent = *unsent && !arm.send_joint(j, word, false, tx);
        }
        arm.queue_full = false;
    }

    /// Sends the stop again to all joints, and goes back to closed brakes if the torque was to go.
    pub(super) fn repeat(&mut self, arm: &mut Arm<N>, tx: &mut impl Transmit) {
        if let StopStage::Off { .. } = self.stage {
            self.stage = StopStage::Brake { since: arm.now };
        }
        self.unsent = [true; N];
        self.retry(arm, tx);
    }

    /// Once a cycle: quick stop, brakes, torque off; true at the end.
    ///
    /// # Errors
    /// The cause, where the stop has ended and a drive keeps its torque.
    pub(super) fn advance(&mut self, arm: &Arm<N>) -> Result<bool, Cause> {
        let reactions = &arm.profile.reactions;
        let settle = 3 * arm.profile.sync_period;
        match self.stage {
            StopStage::Quick => {
                // Data that is missing proves no rest.
                let resting = arm.joints.iter().all(|joint| {
                    let slow = joint.velocity.abs() < reactions.rest_velocity;
                    joint.presence.missing() == 0 && (joint.is_off() || slow)
                });
                let elapsed = arm.elapsed(self.since);
                if (resting && elapsed >= settle) || elapsed >= reactions.stop_timeout {
                    self.stage = StopStage::Brake { since: arm.now };
                }
            }
            StopStage::Brake { since } if arm.elapsed(since) >= reactions.brake_time => {
                self.stage = StopStage::Off { since: arm.now };
            }
            StopStage::Brake { .. } => {}
            StopStage::Off { since } => match arm.joints.iter().position(|joint| !joint.is_off()) {
                None if arm.elapsed(since) >= settle => return Ok(true),
                Some(j) if arm.elapsed(since) >= reactions.transition_timeout => {
                    let status = arm.joints.get(j).and_then(|joint| joint.status);
                    return status.map_or(Ok(true), |status| Err(Cause::StateLost(arm.node(j), status)));
                }
                _ => {}
            },
        }
        Ok(false)
    }
}

/// How far the reset of faults has come. It is tried once for each acknowledgement, never in a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ResetStage {
    /// 0x0000, so that the next word is an edge.
    Low,
    /// 0x0080.
    Edge,
    /// 0x0000 again; after a while the state is checked.
    Wait,
}

/// Cycles for which each word of a fault reset is sent.
const WORD_CYCLES: Micros = 4;

/// The drives' faults are reset.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reset {
    since: Micros,
    stage: ResetStage,
}

impl Reset {
    pub(super) const fn new(now: Micros) -> Reset {
        Reset { since: now, stage: ResetStage::Low }
    }

    /// The controlword for a joint now.
    pub(super) fn word(&self, joint: &Joint) -> Controlword {
        Controlword::command(match (self.stage, joint.state()) {
            (ResetStage::Edge, Some(State::Fault)) => Command::FaultReset,
            _ => Command::DisableVoltage,
        })
    }

    /// Once a cycle; true when no drive is in fault any more.
    ///
    /// # Errors
    /// The cause, where one still is.
    pub(super) fn advance<const N: usize>(
        &mut self,
        arm: &mut Arm<N>,
        tx: &mut impl Transmit,
    ) -> Result<bool, Cause> {
        let word = WORD_CYCLES * arm.profile.sync_period;
        let elapsed = arm.elapsed(self.since);
        match self.stage {
            ResetStage::Low if elapsed >= word => self.stage = ResetStage::Edge,
            ResetStage::Edge if elapsed >= 2 * word => {
                self.stage = ResetStage::Wait;
                for j in 0..N {
                    let now = arm.now;
                    if let Some(joint) = arm.joints.get_mut(j) {
                        joint.emergency = None;
                        // The history; whether the drive clears it decides nothing.
                        let frame = joint.client.write(ERROR_HISTORY, Value::number(0, 1), now);
                        arm.send(frame, tx);
                    }
                }
            }
            ResetStage::Wait if elapsed >= 2 * word + arm.profile.reactions.fault_reset_time => {
                arm.cancel_transfers();
                let faulty = |joint: &Joint| {
                    let faulty = matches!(joint.state(), Some(State::Fault | State::FaultReactionActive));
                    joint.status.filter(|_| faulty)
                };
                let first = arm.joints.iter().enumerate().find_map(|(j, joint)| Some((j, faulty(joint)?)));
                return match first {
                    None => Ok(true),
                    Some((j, status)) => Err(Cause::DriveFault(arm.node(j), status)),
                };
            }
            _ => {}
        }
        Ok(false)
    }
}

/// Objects that are read from the drive that caused the stop.
const DIAGNOSIS: [Object; 4] =
    [ERROR_REGISTER, MANUFACTURER_STATUS, schunk::ERROR_DETAIL, schunk::ERROR_LINE];

/// After a stop: the error details are read of the drive that caused it, if it was one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Diagnosis {
    /// The joint that is read, and how many objects were read.
    at: Option<(usize, usize)>,
}

impl Diagnosis {
    pub(super) fn of(joint: Option<usize>) -> Diagnosis {
        Diagnosis { at: joint.map(|j| (j, 0)) }
    }

    pub(super) fn poll<const N: usize>(&mut self, arm: &mut Arm<N>, tx: &mut impl Transmit) {
        let Some((j, step)) = self.at else { return };
        let now = arm.now;
        let Some(joint) = arm.joints.get_mut(j) else { return };
        if joint.client.is_idle() {
            match DIAGNOSIS.get(step) {
                Some(object) => arm.read(j, *object, tx),
                None => self.at = None,
            }
            return;
        }
        let polled = joint.client.poll(now);
        if let Some(frame) = polled.send {
            arm.send(frame, tx);
        }
        if polled.done.is_some() {
            // A silent node is not read further.
            self.at = None;
        }
    }

    /// The answer of joint `j`, if the drive has the object.
    pub(super) fn answer(&mut self, j: usize, value: Option<Value>, details: &mut Details) {
        let Some((culprit, step)) = self.at.filter(|(culprit, _)| *culprit == j) else { return };
        let number = value.and_then(|value| value.unsigned());
        match step {
            0 => details.register = number.map(|n| n as u8),
            1 => details.vendor_code = number.map(|n| n as u8),
            2 => details.detail = number.map(f32::from_bits),
            _ => details.line = number.map(|n| n as u16),
        }
        self.at = Some((culprit, step + 1));
    }
}
