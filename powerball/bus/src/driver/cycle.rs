//! The SYNC cycle: the checks at its end, the time at which set-points are sent, and the controlword sent
//! with them.

use super::guard::Guard;
use super::script::Progress;
use super::stop::{ResetStage, StopStage};
use super::{Cause, ControlMode, Driver, Phase, Rejection, Transmit};
use crate::canopen::sync::Tick;
use crate::canopen::{Micros, cob};
use crate::cia402::{Command, Controlword, State, objects};
use powerball_controller::JointNumber;

impl<const N: usize> Driver<N> {
    /// The set-points to act with the next SYNC, in rad, rad/s or A by the mode. If it is called again before
    /// the slot, the last call counts.
    ///
    /// # Errors
    /// If one of them may not be sent. Then none is sent: the last ones are held for this cycle.
    pub fn set(&mut self, setpoints: &[f64; N]) -> Result<(), Rejection> {
        if self.phase != Phase::Running {
            return Err(Rejection::NotRunning);
        }
        let checked = self.check_setpoints(setpoints);
        match checked {
            Ok(()) => {
                self.fresh = true;
                self.pending = true;
                self.streaming = true;
            }
            Err(rejection) => self.rejection = Some(rejection),
        }
        checked
    }

    /// Sets set-points like [`Self::set`], in interpolated position mode, with a feed-forward torque (N·m)
    /// that each drive adds to its own from the next SYNC on. It holds until the next one is given, and is 0
    /// whenever the arm does not run.
    ///
    /// # Errors
    /// Those of [`Driver::set`]; and if a torque is NaN, more than the joint has, or further from the last
    /// one than [`Reactions::current_step`](super::profile::Reactions::current_step) of that.
    pub fn set_with_torque(&mut self, setpoints: &[f64; N], torques: &[f64; N]) -> Result<(), Rejection> {
        if self.phase != Phase::Running {
            return Err(Rejection::NotRunning);
        }
        if let Err(rejection) = self.check_offsets(torques) {
            self.rejection = Some(rejection);
            return Err(rejection);
        }
        self.set(setpoints)?;
        for (joint, torque) in self.joints.iter_mut().zip(torques) {
            joint.offset = *torque;
        }
        Ok(())
    }

    fn check_offsets(&self, torques: &[f64; N]) -> Result<(), Rejection> {
        if !self.mode_profile().rpdo.contains(objects::TORQUE_OFFSET) {
            return Err(Rejection::NoTorqueOffset);
        }
        let part = self.profile.reactions.current_step;
        for (j, ((profile, joint), torque)) in
            self.profile.joints.iter().zip(&self.joints).zip(torques).enumerate()
        {
            let number = JointNumber::from_index(j);
            let step = torque - joint.offset;
            if !torque.is_finite() {
                return Err(Rejection::NotFinite(number));
            } else if torque.abs() > profile.torque {
                return Err(Rejection::Torque(number, *torque, profile.torque));
            } else if step.abs() > part * profile.torque {
                return Err(Rejection::Jump(number, step, part * profile.torque));
            } else if joint.units.per_mille_of_torque(*torque).cut {
                return Err(Rejection::Saturated(number));
            }
        }
        Ok(())
    }

    fn check_setpoints(&mut self, setpoints: &[f64; N]) -> Result<(), Rejection> {
        let period = self.profile.period_seconds();
        for (j, ((profile, joint), value)) in
            self.profile.joints.iter().zip(&self.joints).zip(setpoints).enumerate()
        {
            Guard {
                mode: self.control,
                joint: JointNumber::from_index(j),
                profile,
                reactions: &self.profile.reactions,
                period,
                demand: &joint.demand,
                position: joint.position,
            }
            .check(*value)?;
            if joint.raw(self.control, *value).cut {
                return Err(Rejection::Saturated(JointNumber::from_index(j)));
            }
        }
        if let Some(guard) = &self.torque_guard {
            guard.check(&self.profile, self.control, &self.joints, setpoints)?;
        }
        for (joint, value) in self.joints.iter_mut().zip(setpoints) {
            joint.target = *value;
        }
        Ok(())
    }

    /// Bits of all transmit PDOs in use.
    pub(super) fn all_tpdos(&self) -> u8 {
        let used = self.profile.tpdos.iter().enumerate().filter(|(_, mapping)| !mapping.is_empty());
        used.fold(0, |bits, (k, _)| bits | 1 << k)
    }

    /// When the set-points of this cycle leave.
    pub(super) fn slot(&self) -> Micros {
        self.sync.scheduled() + self.budget.setpoint_slot()
    }

    pub(super) fn poll_cycle(&mut self, tx: &mut impl Transmit) {
        let due = self.sync.next().is_some_and(|next| self.now >= next);
        if self.slot_open && !due && self.now >= self.slot() {
            self.slot_open = false;
            self.send_setpoints(tx);
        }
        if let Some(tick) = self.sync.poll(self.now) {
            // A frame that leaves now could be overtaken by SYNC and meet the next one in the same cycle.
            self.counters.dropped += u64::from(core::mem::take(&mut self.slot_open));
            self.judge_cycle(tick, tx);
            self.send(cob::SYNC, tx);
            self.synced_at = self.now;
            self.counters.cycles += 1;
            self.slot_open = true;
            self.fresh = false;
            self.rejection = None;
            self.joints.iter_mut().for_each(|joint| joint.arrived = 0);
            self.advance_stop(tx);
            self.advance_reset(tx);
        }
    }

    /// Judges the cycle that ends with this SYNC.
    fn judge_cycle(&mut self, tick: Tick, tx: &mut impl Transmit) {
        self.judge_lateness(tick, tx);
        self.judge_missing(tx);
        if self.phase == Phase::Running {
            self.judge_setpoints(tx);
            self.judge_travel(tx);
        }
        self.judge_duplicates(tx);
        self.watch_motion(tx);
    }

    fn judge_missing(&mut self, tx: &mut impl Transmit) {
        let judged = self.phase != Phase::Starting;
        let (all, limit) = (self.all_tpdos(), self.missing_limit());
        for j in 0..N {
            let Some(joint) = self.joints.get_mut(j) else { continue };
            if joint.arrived == all {
                joint.missing_run = 0;
                continue;
            }
            joint.counters.missing += u64::from(judged);
            joint.missing_run = joint.missing_run.saturating_add(1);
            // An arm that is stopped already is reported once.
            let stopped = matches!(self.phase, Phase::Stopping | Phase::Faulted | Phase::Resetting);
            if judged && (joint.missing_run == limit || joint.missing_run > limit && !stopped) {
                self.trip(Cause::DataMissing(self.node(j)), tx);
            }
        }
    }

    /// Consecutive cycles without a joint's data that stop the arm. In current mode the caller carries the state on.
    fn missing_limit(&self) -> u8 {
        let reactions = &self.profile.reactions;
        match self.control {
            ControlMode::Current if self.phase == Phase::Running => {
                reactions.torque_mode.missing_cycles.max(reactions.missing_cycles)
            }
            _ => reactions.missing_cycles,
        }
    }

    fn judge_duplicates(&mut self, tx: &mut impl Transmit) {
        let limit = self.profile.reactions.duplicate_cycles;
        for j in 0..N {
            let Some(joint) = self.joints.get_mut(j) else { continue };
            let twice = core::mem::take(&mut joint.duplicated);
            joint.duplicate_run = if twice { joint.duplicate_run.saturating_add(1) } else { 0 };
            if joint.duplicate_run == limit {
                self.trip(Cause::TwoNodes(self.node(j)), tx);
            }
        }
    }

    fn judge_lateness(&mut self, tick: Tick, tx: &mut impl Transmit) {
        let reactions = self.profile.reactions;
        self.counters.skipped += tick.skipped;
        self.counters.worst_late = self.counters.worst_late.max(tick.late);
        let late =
            tick.skipped > 0 || tick.late as f64 > reactions.late_fraction * self.profile.sync_period as f64;
        if late {
            self.counters.late += 1;
            self.late_run = self.late_run.saturating_add(1);
            self.good_run = 0;
        } else {
            self.good_run = self.good_run.saturating_add(1);
            if self.good_run >= reactions.forgiving_cycles {
                self.late_run = 0;
            }
        }
        let too_late = self.late_run >= reactions.late_limit || tick.skipped >= reactions.skipped_limit;
        if late && too_late && self.phase.is_live() {
            self.late_run = 0;
            self.trip(Cause::Late, tx);
        }
    }

    fn judge_setpoints(&mut self, tx: &mut impl Transmit) {
        let reactions = self.profile.reactions;
        if let (Some(rejection), false) = (self.rejection, self.fresh) {
            self.counters.rejected += 1;
            self.rejected_run = self.rejected_run.saturating_add(1);
            if self.rejected_run >= reactions.rejected_limit {
                self.trip(Cause::Setpoints(rejection), tx);
            }
        } else if self.fresh {
            self.rejected_run = 0;
            self.starved_run = 0;
        } else if self.streaming && self.control != ControlMode::ProfilePosition {
            self.counters.starved += 1;
            self.starved_run = self.starved_run.saturating_add(1);
            if self.starved_run >= reactions.starved_cycles {
                // Who waits for data that does not come has no set-points: the silent node is why.
                let silent =
                    self.joints.iter().position(|joint| joint.missing_run >= reactions.starved_cycles);
                let cause = silent.map_or(Cause::Starved, |j| Cause::DataMissing(self.node(j)));
                self.trip(cause, tx);
            }
        }
    }

    /// Compares the commanded travel with the measured travel in velocity mode: a joint that is slow to
    /// follow has no large velocity error. As long as the scale of velocities was not verified on hardware,
    /// each move verifies it too: two readings of 0x604C are the inverse of each other.
    fn judge_travel(&mut self, tx: &mut impl Transmit) {
        if self.control != ControlMode::Velocity {
            return;
        }
        let (period, reactions) = (self.profile.period_seconds(), self.profile.reactions);
        for j in 0..N {
            let part = self.joints.get_mut(j).and_then(|joint| joint.sweep(period, reactions.scale_travel));
            if let Some(part) = part.filter(|part| !(0.5..=2.0).contains(part)) {
                self.trip(Cause::WrongVelocityScale(self.node(j), part), tx);
            }
        }
    }

    /// Handles a cycle without new set-points, or with rejected ones: the joints continue their motion within
    /// their limits. An immediate standstill would need an acceleration that no joint has.
    ///
    /// # Errors
    /// Where that takes more torque than a joint has.
    fn go_on(&mut self) -> Result<(), Rejection> {
        let period = self.profile.period_seconds();
        let mut targets = [0.0; N];
        for ((target, profile), joint) in targets.iter_mut().zip(&self.profile.joints).zip(&self.joints) {
            let acceleration = profile.acceleration * self.profile.reactions.step_factor;
            *target = joint.demand.next(period, profile.position, profile.velocity, acceleration);
        }
        if let Some(guard) = &self.torque_guard {
            guard.check(&self.profile, self.control, &self.joints, &targets)?;
        }
        for (joint, target) in self.joints.iter_mut().zip(targets) {
            joint.target = target;
        }
        Ok(())
    }

    /// One receive PDO a joint.
    pub(super) fn send_setpoints(&mut self, tx: &mut impl Transmit) {
        let came = core::mem::take(&mut self.pending);
        let interpolated = self.control == ControlMode::InterpolatedPosition;
        let alone = self.phase == Phase::Running && interpolated && self.streaming && !came;
        if alone && let Err(rejection) = self.go_on() {
            self.trip(Cause::Setpoints(rejection), tx);
            return;
        }
        for j in 0..N {
            self.send_joint(j, tx);
        }
    }

    /// The receive PDO of joint `j`; true where it was queued, or is not to be sent.
    pub(super) fn send_joint(&mut self, j: usize, tx: &mut impl Transmit) -> bool {
        let (control, running) = (self.control, self.phase == Phase::Running);
        let mode = *self.mode_profile();
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get(j)) else {
            return true;
        };
        // Before the first statusword the position is unknown, and nothing can be preset to it.
        if joint.status.is_none() {
            return true;
        }
        let mut word = self.word(j);
        let Some(joint) = self.joints.get_mut(j) else { return true };
        if running {
            joint.demand.push(joint.target);
        } else {
            joint.preset(control);
        }
        let mut raw = joint.raw(control, joint.demand.last()).value;
        if running && control == ControlMode::ProfilePosition {
            let (bits, target) = joint.announce(raw);
            word = word.with(bits);
            raw = target;
        }
        match joint.rpdo(profile, &mode, word, raw) {
            Some(frame) => self.send(frame, tx),
            None => true,
        }
    }

    /// The controlword for joint `j` now.
    fn word(&self, j: usize) -> Controlword {
        let off = Controlword::command(Command::DisableVoltage);
        let Some(joint) = self.joints.get(j) else { return off };
        let enabled = Controlword::command(Command::EnableOperation);
        match self.phase {
            Phase::Running => enabled.with(self.mode_profile().running_bits),
            Phase::Enabling => match joint.progress {
                Progress::Waiting => off,
                Progress::Walking { .. } | Progress::Commutating { reads: 0, .. } | Progress::Done => {
                    joint.walk()
                }
                Progress::Commutating { .. } | Progress::Settling { .. } => {
                    enabled.with(self.mode_profile().running_bits)
                }
            },
            Phase::Stopping => match self.stop {
                StopStage::Quick => Controlword::command(Command::QuickStop),
                StopStage::Brake { .. } => Controlword::command(Command::QuickStop).with(Controlword::HALT),
                StopStage::Off { .. } => off,
            },
            Phase::Resetting => match (self.reset, joint.state()) {
                (ResetStage::Edge, Some(State::Fault)) => Controlword::command(Command::FaultReset),
                _ => off,
            },
            _ => off,
        }
    }
}
