//! The driver in time: what is due, the SYNC cycle, the checks at its end, and the set-points in its slot.

use super::bringup::{Boot, Scripts, begin_cycles, first_data};
use super::cause::{Cause, Rejection};
use super::demand::ControlMode;
use super::joint::Transmit;
use super::machine::Driver;
use super::stage::Stage;
use super::stream::Stream;
use super::torque_mode::{TorqueWatch, Tracking};
use super::watch::Watch;
use crate::canopen::sync::Tick;
use crate::canopen::{Micros, cob, nmt};

impl<const N: usize> Driver<N> {
    /// The set-points to act with the next SYNC, in rad, rad/s or A by the mode. If it is called again before
    /// the slot, the last call counts.
    ///
    /// # Errors
    /// If one of them may not be sent. Then none is sent: the last ones are held for this cycle.
    pub fn set(&mut self, setpoints: &[f64; N]) -> Result<(), Rejection> {
        let Stage::Running(stream) = &mut self.stage else { return Err(Rejection::NotRunning) };
        stream.set(&mut self.arm, setpoints)
    }

    /// Sets set-points like [`Self::set`], in interpolated position mode, with a feed-forward torque (N·m)
    /// that each drive adds to its own from the next SYNC on. It holds until the next one is given, and is 0
    /// whenever the arm does not run.
    ///
    /// # Errors
    /// Those of [`Driver::set`]; and if a torque is NaN, more than the joint has, or further from the last
    /// one than [`Reactions::current_step`](super::profile::Reactions::current_step) of that.
    pub fn set_with_torque(&mut self, setpoints: &[f64; N], torques: &[f64; N]) -> Result<(), Rejection> {
        let Stage::Running(stream) = &mut self.stage else { return Err(Rejection::NotRunning) };
        stream.set_with_torque(&mut self.arm, setpoints, torques)
    }

    /// Currents (A) for the next SYNC as [`Driver::set`], with where the joints should be at the last one. A
    /// joint that is farther from there than it may be stops the arm.
    ///
    /// # Errors
    /// Those of [`Driver::set`].
    pub fn set_tracked(&mut self, currents: &[f64; N], tracking: &Tracking<N>) -> Result<(), Rejection> {
        self.set(currents)?;
        self.torque.track(&self.arm, tracking);
        Ok(())
    }

    /// Time: sends what is due. To be called at [`Driver::deadline`] or earlier, and after set-points and
    /// commands.
    pub fn poll(&mut self, now: Micros, tx: &mut impl Transmit) {
        self.arm.now = now;
        if matches!(self.stage, Stage::Idle) || self.latch.silent {
            return;
        }
        // Nothing is sent before another master would have been heard.
        if let Stage::Listening { since } = self.stage {
            if self.arm.elapsed(since) >= self.arm.profile.reactions.listen_time {
                self.stage = Stage::Boot(Boot::new(now));
            }
            return;
        }
        if self.heartbeat.poll(now) {
            self.arm.send(nmt::State::Operational.frame(self.arm.profile.master), tx);
        }
        // A frame that leaves when SYNC is due could be overtaken by it, and meet the next one in one cycle.
        let due = |at: Option<Micros>| at.is_some_and(|at| now >= at);
        if due(self.setpoints_due()) && !due(self.raster.next()) {
            self.raster.close();
            let failed = self.send_setpoints(tx).err();
            self.act(failed, tx);
        }
        if let Some(tick) = self.raster.poll(now) {
            self.cycle(tick, tx);
        }
        self.act_on_each(tx, |driver, j| {
            let lost = driver.arm.joints.get_mut(j)?.presence.is_lost(now);
            lost.then(|| Cause::HeartbeatLost(driver.arm.node(j)))
        });
        let failed = self.advance(tx).err();
        self.act(failed, tx);
        self.check_queue(tx);
    }

    /// What the phase does whenever it is polled, and the next phase where it is done.
    fn advance(&mut self, tx: &mut impl Transmit) -> Result<(), Cause> {
        let (now, arm) = (self.arm.now, &mut self.arm);
        match &mut self.stage {
            Stage::Boot(boot) => {
                if boot.poll(arm, tx)? {
                    let mut scripts = Scripts::new();
                    scripts.poll(arm, tx)?;
                    self.stage = Stage::Scripts(scripts);
                }
            }
            Stage::Scripts(scripts) => {
                if scripts.poll(arm, tx)? {
                    begin_cycles(arm, tx);
                    self.watch = Watch::new();
                    self.raster.start(now);
                    self.stage = Stage::Starting { since: now };
                }
            }
            Stage::Starting { since } => {
                if arm.unready().is_none() && self.raster.is_running() && arm.is_whole() {
                    self.stage = Stage::Ready;
                } else if let Some(cause) = first_data(arm, *since) {
                    return Err(cause);
                }
            }
            Stage::Enabling(enabling) => {
                if enabling.poll(arm, tx)? {
                    let control = arm.control;
                    arm.joints.iter_mut().for_each(|joint| joint.preset(control));
                    self.watch.release(arm);
                    self.torque = TorqueWatch::new();
                    self.stage = Stage::Running(Stream::default());
                }
            }
            Stage::Stopping(stop) => stop.retry(arm, tx),
            Stage::Faulted(diagnosis) => diagnosis.poll(arm, tx),
            Stage::Idle
            | Stage::Listening { .. }
            | Stage::Ready
            | Stage::Running(_)
            | Stage::Resetting(_) => {}
        }
        Ok(())
    }

    /// A cycle ends and the next one begins: SYNC.
    fn cycle(&mut self, tick: Tick, tx: &mut impl Transmit) {
        self.arm.counters.dropped += u64::from(self.raster.close());
        self.end_cycle(tick, tx);
        self.arm.send(cob::SYNC, tx);
        self.raster.sent(self.arm.now);
        self.arm.counters.cycles += 1;
        self.arm.joints.iter_mut().for_each(|joint| joint.presence.await_data());
        match &mut self.stage {
            Stage::Running(stream) => stream.await_setpoints(),
            Stage::Stopping(stop) => match stop.advance(&self.arm) {
                Ok(true) => self.end_stop(),
                Ok(false) => {}
                Err(cause) => {
                    self.act(Some(cause), tx);
                    self.end_stop();
                }
            },
            Stage::Resetting(reset) => match reset.advance(&mut self.arm, tx) {
                Ok(true) => self.stage = Stage::Starting { since: self.arm.now },
                Ok(false) => {}
                Err(cause) => self.act(Some(cause), tx),
            },
            _ => {}
        }
    }

    /// The checks at the end of a cycle, in order.
    fn end_cycle(&mut self, tick: Tick, tx: &mut impl Transmit) {
        let (arm, live) = (&mut self.arm, self.stage.is_live());
        let late = self.raster.is_too_late(tick, live, &arm.profile.reactions, &mut arm.counters);
        self.act(late.then_some(Cause::Late), tx);
        let (all, most) = (self.arm.all_tpdos(), self.missing_limit());
        self.act_on_each(tx, |driver, j| driver.missing(all, most, j));
        if let Stage::Running(stream) = &mut self.stage {
            let found = stream.end_cycle(&mut self.arm);
            self.act(found, tx);
            self.act_on_each(tx, |driver, j| driver.watch.travel(&driver.arm, j));
        }
        let most = self.arm.profile.reactions.duplicate_cycles;
        self.act_on_each(tx, |driver, j| {
            let double = driver.arm.joints.get_mut(j)?.presence.is_double(most);
            double.then(|| Cause::TwoNodes(driver.arm.node(j)))
        });
        if self.follows_currents() {
            let found = self.torque.torque_error(&self.arm);
            self.act(found, tx);
        }
        self.act_on_each(tx, |driver, j| driver.wrong_motion(j));
    }

    fn missing(&mut self, all: u8, most: u8, j: usize) -> Option<Cause> {
        let judged = !matches!(self.stage, Stage::Starting { .. });
        let joint = self.arm.joints.get_mut(j)?;
        let missing = joint.presence.end_cycle(all);
        if missing == 0 || !judged {
            return None;
        }
        joint.counters.missing += 1;
        // An arm that is stopped already is reported once.
        let found = missing == most || missing > most && !self.stage.is_stopped();
        found.then(|| Cause::DataMissing(self.arm.node(j)))
    }

    /// Consecutive cycles without a joint's data that stop the arm. In current mode the caller carries the
    /// state on.
    fn missing_limit(&self) -> u8 {
        let reactions = &self.arm.profile.reactions;
        if self.follows_currents() {
            reactions.torque_mode.missing_cycles.max(reactions.missing_cycles)
        } else {
            reactions.missing_cycles
        }
    }

    fn wrong_motion(&mut self, j: usize) -> Option<Cause> {
        let follows = self.follows_currents();
        let Driver { arm, watch, torque, stage, .. } = self;
        // Data that did not come is judged as missing.
        if !stage.is_live() || arm.joints.get(j)?.presence.missing() > 0 {
            return None;
        }
        let found = watch.motion(arm, stage.is_running(), j);
        found.or_else(|| if follows { torque.not_obeying(arm, j) } else { None })
    }

    /// Whether each joint follows its current: the guard of current mode is asked.
    pub(super) fn follows_currents(&self) -> bool {
        self.stage.is_running() && self.arm.control == ControlMode::Current
    }

    /// One receive PDO a joint.
    ///
    /// # Errors
    /// The cause, where the set-points cannot be continued.
    fn send_setpoints(&mut self, tx: &mut impl Transmit) -> Result<(), Cause> {
        if let Stage::Running(stream) = &mut self.stage {
            stream.leave(&mut self.arm).map_err(Cause::Setpoints)?;
        }
        for j in 0..N {
            let word = self.stage.word(&self.arm, j);
            self.arm.send_joint(j, word, self.stage.is_running(), tx);
        }
        Ok(())
    }
}
