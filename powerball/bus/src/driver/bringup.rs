//! From silence to following set-points: boot, scripts, first data, enabling, commutation.

use super::budget::worst_bits;
use super::cause::Hindrance;
use super::script::{Progress, Write, configuration, questions};
use super::{Cause, Driver, Phase, Transmit};
use crate::canopen::client::{SdoError, Value};
use crate::canopen::objects::{DEVICE_TYPE, PRODUCT_CODE, REVISION, SERIAL_NUMBER, VENDOR_ID};
use crate::canopen::sdo::AbortCode;
use crate::canopen::{Frame, Micros, Object, nmt};
use crate::cia402::{State, objects, schunk};

/// How often the nodes were reset since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct BringUp {
    resets: u8,
}

/// The device profile of drives, CiA 402: the low 16 bits of 0x1000.
const DRIVES: u32 = 402;

/// A node that does not boot is reset once more: supplies come late.
const RESETS: u8 = 2;

impl<const N: usize> Driver<N> {
    pub(super) fn poll_boot(&mut self, tx: &mut impl Transmit) {
        if self.bring_up.resets == 0 {
            self.sync.stop();
            self.slot_open = false;
            for joint in &mut self.joints {
                joint.client.cancel();
                joint.heartbeat.stop();
                (joint.booted, joint.status, joint.mode, joint.emergency) = (None, None, None, None);
                (joint.current_limit, joint.declined) = (None, 0);
            }
            if self.manage(nmt::Command::ResetNode, tx) {
                self.bring_up.resets = 1;
                self.enter(Phase::Boot);
            }
            return;
        }
        let Some(missing) = self.joints.iter().position(|joint| joint.booted.is_none()) else {
            // Nodes go there by themselves after their boot-up; some (python-canopen's) repeat it until they
            // are commanded.
            if self.manage(nmt::Command::EnterPreOperational, tx) {
                self.enter_script(Phase::Identify, tx);
            }
            return;
        };
        if self.elapsed() < self.profile.reactions.boot_timeout {
            return;
        }
        if self.bring_up.resets >= RESETS {
            for j in missing + 1..N {
                if self.joints.get(j).is_some_and(|joint| joint.booted.is_none()) {
                    self.note(Cause::NoBoot(self.node(j)));
                }
            }
            self.trip(Cause::NoBoot(self.node(missing)), tx);
            return;
        }
        self.bring_up.resets += 1;
        self.enter(Phase::Boot);
        for j in 0..N {
            if self.joints.get(j).is_some_and(|joint| joint.booted.is_none()) {
                self.send(nmt::Command::ResetNode.frame(Some(self.node(j))), tx);
            }
        }
    }

    fn enter_script(&mut self, phase: Phase, tx: &mut impl Transmit) {
        self.enter(phase);
        self.joints.iter_mut().for_each(|joint| (joint.step, joint.retries) = (0, 0));
        self.poll_scripts(tx);
    }

    /// Between two steps of one joint: as long as a round of all joints takes, and half of that again.
    /// Transfers without a pause would fill the bus, and the master's heartbeat, lowest in priority, would be
    /// missed by the drives.
    fn sdo_pause(&self) -> Micros {
        let round_trip = self.budget.duration(2 * worst_bits(8));
        round_trip * N as u64 * 3 / 2
    }

    /// The write that joint `j` is at, while configuring and verifying.
    fn write_of(&self, j: usize, step: usize) -> Option<Write> {
        let verifying = self.phase == Phase::Verify;
        let declined = self.joints.get(j).map_or(0, |joint| joint.declined);
        let kept =
            |write: &Write| write.verify != 0 && write.optional().is_none_or(|bit| declined & bit == 0);
        configuration(&self.profile, self.mode_profile(), self.control, j)
            .filter(|write| !verifying || kept(write))
            .nth(step)
    }

    /// Begins joint `j`'s next step; `None` where its script is done.
    fn begin_step(&mut self, j: usize) -> Option<Frame> {
        let (now, pause) = (self.now, self.sdo_pause());
        let step = self.joints.get(j)?.step;
        let frame = match self.phase {
            Phase::Identify => {
                let object = questions(self.mode_profile(), self.control).nth(step)?;
                Some(self.joints.get_mut(j)?.client.read(object, now))
            }
            Phase::Configure => {
                let write = self.write_of(j, step)?;
                Some(self.joints.get_mut(j)?.client.write(write.object, write.value(), now))
            }
            Phase::Verify => {
                let write = self.write_of(j, step)?;
                Some(self.joints.get_mut(j)?.client.read(write.object, now))
            }
            _ => None,
        };
        self.joints.get_mut(j)?.next_step = now + pause;
        frame
    }

    pub(super) fn poll_scripts(&mut self, tx: &mut impl Transmit) {
        let mut done = true;
        let phase = self.phase;
        for j in 0..N {
            let now = self.now;
            let Some(joint) = self.joints.get_mut(j) else { continue };
            if joint.client.is_idle() {
                if now < joint.next_step {
                    done = false;
                    continue;
                }
                let Some(frame) = self.begin_step(j) else { continue };
                self.send(frame, tx);
            } else {
                let step = joint.client.poll(now);
                if let Some(frame) = step.send {
                    self.send(frame, tx);
                }
                if let Some(result) = step.done {
                    self.script_result(j, result, tx);
                }
            }
            done = false;
            if self.phase != phase {
                return;
            }
        }
        match phase {
            _ if !done => {}
            Phase::Identify => self.enter_script(Phase::Configure, tx),
            Phase::Configure => self.enter_script(Phase::Verify, tx),
            Phase::Verify => self.begin_cycles(tx),
            _ => {}
        }
    }

    /// The end of a transfer of a script.
    pub(super) fn script_result(
        &mut self,
        j: usize,
        result: Result<Value, SdoError>,
        tx: &mut impl Transmit,
    ) {
        let retries = self.profile.reactions.sdo_retries;
        let Some(joint) = self.joints.get_mut(j) else { return };
        let object = joint.client.object();
        if result == Err(SdoError::Timeout) && joint.retries < retries {
            joint.retries += 1;
        } else {
            let judged = match self.phase {
                Phase::Identify => self.judge_answer(j, object, result),
                Phase::Configure => self.judge_write(j, object, result),
                Phase::Verify => self.judge_read_back(j, object, result),
                _ => return,
            };
            if let Err(cause) = judged {
                self.trip(cause, tx);
                return;
            }
            if let Some(joint) = self.joints.get_mut(j) {
                joint.step += 1;
                joint.retries = 0;
            }
        }
    }

    fn judge_answer(
        &mut self,
        j: usize,
        object: Object,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let node = self.node(j);
        let target = self.mode_profile().setpoint;
        let failed = |error| Cause::Sdo(node, object, error);
        let number = result.and_then(|value| value.unsigned().ok_or(SdoError::Protocol(AbortCode::LENGTH)));
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get_mut(j)) else {
            return Ok(());
        };
        let id = profile.identity;
        let [vendor, product, revision, serial] = &mut joint.identity;
        let identity = match object {
            DEVICE_TYPE => Some((&mut joint.device_type, Some(DRIVES))),
            VENDOR_ID => Some((vendor, id.vendor)),
            PRODUCT_CODE => Some((product, id.product)),
            REVISION => Some((revision, id.revision)),
            SERIAL_NUMBER => Some((serial, id.serial)),
            _ => None,
        };
        if let Some((place, expected)) = identity {
            *place = number.ok();
            // The high bits of the device type say what kind of drive it is.
            let same = |found: u32, expected| match object {
                DEVICE_TYPE => found & 0xFFFF == expected,
                _ => found == expected,
            };
            // A drive need not have every part; what the profile knows, it must have.
            let deviation = match (number, expected) {
                (Ok(found), Some(expected)) if !same(found, expected) => {
                    Cause::WrongIdentity(node, object, expected, found)
                }
                (Ok(_), _) | (Err(SdoError::Aborted(_)), None) => return Ok(()),
                (Err(error), _) => failed(error),
            };
            let acceptable = matches!(deviation, Cause::WrongIdentity(..))
                || matches!(deviation, Cause::Sdo(_, _, SdoError::Aborted(_)));
            return if self.other_nodes && acceptable {
                self.note(deviation);
                Ok(())
            } else {
                Err(deviation)
            };
        }
        // A drive need not report it; the profile's limit is used then.
        if object == objects::MAX_CURRENT {
            let stated = number.ok().filter(|n| (1..=u32::from(u16::MAX)).contains(n));
            joint.current_limit =
                stated.map(|n| joint.units.current(n as i32).abs()).filter(|limit| *limit > 0.0);
            return match number {
                Ok(_) | Err(SdoError::Aborted(_)) => Ok(()),
                Err(error) => Err(failed(error)),
            };
        }
        // A target that is there and cannot be read: that it is followed is watched anyway.
        if object == target
            && let Err(SdoError::Aborted(code)) = number
            && !matches!(code, AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX)
        {
            return Ok(());
        }
        let number = number.map_err(failed)?;
        match object {
            objects::SUPPORTED_MODES => {
                let mode =
                    self.profile.mode(self.control).map_or(crate::cia402::Mode::None, |mode| mode.mode);
                if mode.is_in(number) == Some(false) {
                    return Err(Cause::ModeNotOffered(node, mode, number));
                }
            }
            objects::RATED_CURRENT if number > 0 => joint.units.rated_current = f64::from(number) / 1000.0,
            // Without a scale of its own the drive's currents are nonsense, and a current set-point more so.
            objects::RATED_CURRENT if profile.units.rated_current <= 0.0 => {
                return Err(Cause::Implausible(node, object, number));
            }
            objects::VL_FACTOR_NUMERATOR => joint.velocity_numerator = number as i32,
            objects::VL_FACTOR_DENOMINATOR => {
                let scale = self.profile.velocity_scale.at(joint.velocity_numerator, number as i32);
                joint.velocity_count = scale.ok_or(Cause::Implausible(node, object, number))?;
            }
            _ => {}
        }
        Ok(())
    }

    fn judge_write(
        &mut self,
        j: usize,
        object: Object,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let write = self.joints.get(j).and_then(|joint| self.write_of(j, joint.step));
        if let (Err(SdoError::Aborted(_)), Some(bit)) = (result, write.and_then(|write| write.optional())) {
            if let Some(joint) = self.joints.get_mut(j) {
                joint.declined |= bit;
            }
            return Ok(());
        }
        let cause = if write.is_some_and(|write| write.is_watch()) { Cause::NoWatch } else { Cause::Sdo };
        result.map(|_| ()).map_err(|error| cause(self.node(j), object, error))
    }

    fn judge_read_back(
        &self,
        j: usize,
        object: Object,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let node = self.node(j);
        let value = result.map_err(|error| Cause::Sdo(node, object, error))?;
        let Some(write) = self.joints.get(j).and_then(|joint| self.write_of(j, joint.step)) else {
            return Ok(());
        };
        let read = value.unsigned().unwrap_or(0) & write.verify;
        if read == write.expected() && !value.as_slice().is_empty() {
            Ok(())
        } else {
            Err(Cause::NotTaken(node, object, write.expected(), read))
        }
    }

    /// Configured and verified: process data and watching begin.
    fn begin_cycles(&mut self, tx: &mut impl Transmit) {
        let now = self.now;
        for joint in &mut self.joints {
            joint.heartbeat.beat(now);
            joint.watched = super::watch::Watched::default();
            (joint.arrived, joint.missing_run, joint.overspeed_run) = (0, 0, 0);
            (joint.status, joint.mode, joint.nmt) = (None, None, None);
        }
        (self.late_run, self.good_run) = (0, 0);
        self.manage(nmt::Command::Start, tx);
        self.sync.start(now);
        self.enter(Phase::Starting);
    }

    /// The first joint whose drive is not in the right mode, without torque.
    pub(super) fn unready(&self) -> Option<usize> {
        let expected = self.mode_profile().mode;
        let ready = |joint: &super::Joint| joint.state().is_some_and(is_off) && joint.mode == Some(expected);
        self.joints.iter().position(|joint| !ready(joint))
    }

    pub(super) fn poll_starting(&mut self, tx: &mut impl Transmit) {
        let expected = self.mode_profile().mode;
        let unready = self.unready();
        if unready.is_none() && self.cycle_complete() {
            self.enter(Phase::Ready);
            return;
        }
        let hindered = unready.or_else(|| self.joints.iter().position(|joint| joint.missing_run > 0));
        let Some(j) = hindered else { return };
        if self.elapsed() < self.profile.reactions.transition_timeout {
            return;
        }
        let (node, Some(joint)) = (self.node(j), self.joints.get(j)) else { return };
        let cause = match (joint.state(), joint.mode) {
            (None, _) | (_, None) => Cause::DataMissing(node),
            (Some(state), _) if !is_off(state) => {
                Cause::Transition(node, state, State::SwitchOnDisabled, Hindrance::of(joint.status, true))
            }
            (_, Some(mode)) if mode != expected => Cause::WrongMode(node, mode),
            _ => Cause::DataMissing(node),
        };
        self.trip(cause, tx);
    }

    pub(super) fn poll_enabling(&mut self, tx: &mut impl Transmit) {
        for j in 0..N {
            let turn = !self.profile.reactions.one_at_a_time
                || self.joints.iter().take(j).all(|joint| joint.progress == Progress::Done);
            let Some(progress) = self.joints.get(j).map(|joint| joint.progress) else { continue };
            match progress {
                Progress::Waiting if turn => self.begin_walk(j),
                Progress::Walking { .. } => self.walk(j, tx),
                Progress::Commutating { next, .. } => self.poll_commutation(j, next, tx),
                Progress::Settling { until } if self.now >= until => self.progress(j, Progress::Done),
                _ => {}
            }
            if self.phase != Phase::Enabling {
                return;
            }
        }
        if self.joints.iter().all(|joint| joint.progress == Progress::Done) {
            let control = self.control;
            for joint in &mut self.joints {
                joint.preset(control);
                (joint.swept, joint.swept_from) = (0.0, joint.position);
            }
            self.release_watch();
            (self.fresh, self.rejection, self.streaming) = (false, None, false);
            self.pending = false;
            (self.rejected_run, self.starved_run) = (0, 0);
            self.enter(Phase::Running);
        }
    }

    fn progress(&mut self, j: usize, progress: Progress) {
        if let Some(joint) = self.joints.get_mut(j) {
            joint.progress = progress;
        }
    }

    fn begin_walk(&mut self, j: usize) {
        let deadline = self.now + self.profile.reactions.transition_timeout;
        let state = self.joints.get(j).and_then(|joint| joint.state()).unwrap_or(State::SwitchOnDisabled);
        self.progress(j, Progress::Walking { state, deadline });
    }

    fn walk(&mut self, j: usize, tx: &mut impl Transmit) {
        let Some(joint) = self.joints.get(j) else { return };
        let (Progress::Walking { state, deadline }, Some(now_in)) = (joint.progress, joint.state()) else {
            return;
        };
        let status = joint.status;
        let failed = |wanted, on_the_way| {
            Cause::Transition(self.node(j), now_in, wanted, Hindrance::of(status, on_the_way))
        };
        match (step_of(state), step_of(now_in)) {
            // Only SCHUNK's drives say when their commutation search is done.
            (_, Some(4)) if self.profile.sync_timeout_factor.is_none() => self.progress(j, Progress::Done),
            (_, Some(4)) => self.progress(j, Progress::Commutating { reads: 0, next: self.now }),
            (Some(before), Some(after)) if after > before => {
                let deadline = self.now + self.profile.reactions.transition_timeout;
                self.progress(j, Progress::Walking { state: now_in, deadline });
            }
            (Some(before), Some(after)) if after == before && self.now < deadline => {}
            (_, after) => self.trip(failed(next_of(state), after == step_of(state)), tx),
        }
    }

    fn poll_commutation(&mut self, j: usize, next: Micros, tx: &mut impl Transmit) {
        let now = self.now;
        let Some(joint) = self.joints.get_mut(j) else { return };
        if !joint.client.is_idle() {
            let step = joint.client.poll(now);
            if let Some(frame) = step.send {
                self.send(frame, tx);
            }
            if let Some(result) = step.done {
                self.commutation_result(j, result, tx);
            }
        } else if now >= next {
            let frame = joint.client.read(schunk::EXTENDED_STATUS, now);
            self.send(frame, tx);
        }
    }

    /// The drive's answer on whether its commutation search is done. Until it is, the joint is commanded to
    /// stay where it is.
    pub(super) fn commutation_result(
        &mut self,
        j: usize,
        result: Result<Value, SdoError>,
        tx: &mut impl Transmit,
    ) {
        let (reactions, now) = (self.profile.reactions, self.now);
        let Some(Progress::Commutating { reads, .. }) = self.joints.get(j).map(|joint| joint.progress) else {
            return;
        };
        let found = match result {
            Ok(value) => value.unsigned().is_some_and(|status| status as u8 & schunk::COMMUTATED != 0),
            Err(SdoError::Timeout) => false,
            Err(error) => {
                self.trip(Cause::Sdo(self.node(j), schunk::EXTENDED_STATUS, error), tx);
                return;
            }
        };
        match (found, reads) {
            (true, 0) => self.progress(j, Progress::Done),
            (true, _) => self.progress(j, Progress::Settling { until: now + reactions.commutation_settle }),
            (false, reads) if reads >= reactions.commutation_tries => {
                self.trip(Cause::NoCommutation(self.node(j)), tx);
            }
            (false, reads) => {
                let next = now + reactions.commutation_interval;
                self.progress(j, Progress::Commutating { reads: reads + 1, next });
            }
        }
    }
}

/// Whether a drive needs no change until it is enabled.
fn is_off(state: State) -> bool {
    matches!(state, State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn)
}

/// Steps on the way to "operation enabled"; states that are not on it have none.
fn step_of(state: State) -> Option<u8> {
    match state {
        State::SwitchOnDisabled => Some(1),
        State::ReadyToSwitchOn => Some(2),
        State::SwitchedOn => Some(3),
        State::OperationEnabled => Some(4),
        _ => None,
    }
}

/// The next state on the way.
fn next_of(state: State) -> State {
    match state {
        State::ReadyToSwitchOn => State::SwitchedOn,
        State::SwitchedOn | State::OperationEnabled => State::OperationEnabled,
        _ => State::ReadyToSwitchOn,
    }
}
