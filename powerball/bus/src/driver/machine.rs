//! The driver: its phases, what leads from one to the next, and the one place that acts on a cause.

use super::arm::Arm;
use super::bringup::Boot;
use super::budget::{Budget, Verdict};
use super::cause::{Cause, Details, Refusal};
use super::demand::ControlMode;
use super::enabling::Enabling;
use super::joint::{BusEvent, Joint, Transmit};
use super::latch::Latch;
use super::notes::{Counters, Note};
use super::phase::Phase;
use super::profile::Profile;
use super::raster::Raster;
use super::stage::Stage;
use super::stop::{Diagnosis, Reset, Stop};
use super::torque::TorqueGuard;
use super::torque_mode::TorqueWatch;
use super::watch::Watch;
use crate::canopen::sync::HeartbeatProducer;
use crate::canopen::{Micros, nmt};

/// The master of an arm of `N` joints.
#[derive(Clone, Debug)]
pub struct Driver<const N: usize> {
    pub(super) arm: Arm<N>,
    pub(super) stage: Stage<N>,
    pub(super) latch: Latch,
    pub(super) raster: Raster,
    pub(super) heartbeat: HeartbeatProducer,
    pub(super) watch: Watch<N>,
    pub(super) torque: TorqueWatch<N>,
}

impl<const N: usize> Driver<N> {
    /// A driver of the arm of `profile`, idle.
    ///
    /// # Errors
    /// Where the profile contradicts itself: a node twice, no watching of the master, a PDO without what the
    /// driver needs.
    pub fn new(profile: Profile<N>) -> Result<Driver<N>, Refusal> {
        Ok(Driver {
            raster: Raster::new(profile.sync_period),
            heartbeat: HeartbeatProducer::new(profile.master_heartbeat),
            arm: Arm::new(profile)?,
            stage: Stage::Idle,
            latch: Latch::default(),
            watch: Watch::new(),
            torque: TorqueWatch::new(),
        })
    }

    /// From now on no set-point is sent that requires more torque of a joint than its profile allows, by the
    /// model of `guard`.
    pub fn guard_torque(&mut self, guard: TorqueGuard<N>) {
        self.arm.torque_guard = Some(guard);
    }

    /// From the next [`Driver::start`] on, nodes with another device type (0x1000) or identity (0x1018) than
    /// in the profile are used, each deviation with a [`Note`]. Without this call they are refused.
    pub fn accept_other_nodes(&mut self) {
        self.arm.other_nodes = true;
    }

    /// Boots, identifies, configures and verifies all nodes for `control`; the driver is [`Phase::Ready`]
    /// then. Possible when idle and when ready (to change the mode). With `accept_unverified` the caller
    /// allows a mode that was never verified on the arm itself.
    ///
    /// # Errors
    /// If the phase does not allow it, the profile does not have the mode, it is the unverified current mode
    /// and not accepted, or the bus load would be too high.
    pub fn start(&mut self, control: ControlMode, accept_unverified: bool) -> Result<Verdict, Refusal> {
        match self.stage {
            Stage::Idle | Stage::Ready => {}
            _ => return Err(self.refusal()),
        }
        let mode = self.arm.profile.mode(control).ok_or(Refusal::NoMode(control))?;
        if control == ControlMode::Current && !mode.verified_on_hardware && !accept_unverified {
            return Err(Refusal::NotVerified(control));
        }
        let budget = Budget::of(&self.arm.profile, mode);
        let verdict = budget.verdict();
        if verdict == Verdict::TooMuch {
            return Err(Refusal::BusLoad(budget.worst_load()));
        }
        (self.arm.control, self.arm.budget) = (control, budget);
        self.raster.stop();
        self.arm.joints.iter_mut().for_each(|joint| joint.presence.release());
        // Who was heard by its nodes until now has listened all the time, and must not fall silent.
        let since = self.arm.now;
        self.stage = match self.stage {
            Stage::Ready => Stage::Boot(Boot::new(since)),
            _ => Stage::Listening { since },
        };
        Ok(verdict)
    }

    /// Releases the brakes and follows set-points: the joints are enabled and commutated, then the driver is
    /// [`Phase::Running`], holding the arm where it is until the first set-points.
    ///
    /// # Errors
    /// Where the driver is not ready.
    pub fn enable(&mut self) -> Result<(), Refusal> {
        let Stage::Ready = self.stage else { return Err(self.refusal()) };
        self.stage = Stage::Enabling(Enabling::new());
        Ok(())
    }

    /// Acknowledges the latched cause. Drives in fault are then reset, once. If the nodes' configuration can
    /// no longer be trusted, the driver becomes idle and must be started again. Nothing moves before
    /// [`Driver::enable`].
    ///
    /// # Errors
    /// Where nothing is latched, or the arm is still being stopped.
    pub fn acknowledge(&mut self) -> Result<(), Refusal> {
        let Stage::Faulted(_) = self.stage else { return Err(Refusal::Phase(self.phase().text())) };
        let restarts = self.latch.needs_restart() || !self.raster.is_running();
        self.latch.acknowledge(restarts);
        self.arm.cancel_transfers();
        self.stage = if restarts {
            self.raster.stop();
            Stage::Idle
        } else {
            Stage::Resetting(Reset::new(self.arm.now))
        };
        Ok(())
    }

    /// Why a command is refused in this phase.
    fn refusal(&self) -> Refusal {
        let latched = self.latch.cause().filter(|_| matches!(self.stage, Stage::Faulted(_)));
        latched.map_or(Refusal::Phase(self.phase().text()), |cause| Refusal::Latched(*cause))
    }

    /// Stops the arm on request: quick stop at once, brakes, torque off. In any phase.
    pub fn stop(&mut self, now: Micros, tx: &mut impl Transmit) {
        self.arm.now = now;
        match self.stage {
            Stage::Listening { .. } => self.stage = Stage::Idle,
            Stage::Boot(_) | Stage::Scripts(_) => self.give_up(Stage::Idle, tx),
            Stage::Starting { .. } | Stage::Enabling(_) | Stage::Running(_) | Stage::Resetting(_) => {
                self.begin_stop(tx);
            }
            Stage::Idle | Stage::Ready | Stage::Stopping(_) | Stage::Faulted(_) => {}
        }
    }

    /// Stops the arm because the program was asked to end: like [`Driver::stop`], but latched, so that
    /// nothing moves again. If a joint may have torque, quick stop is sent at once in every phase, also if
    /// the arm is being stopped already: its brakes stay closed then. One call is enough.
    pub fn interrupt(&mut self, now: Micros, tx: &mut impl Transmit) {
        self.arm.now = now;
        if self.latch.interrupted || matches!(self.stage, Stage::Idle) {
            return;
        }
        self.latch.interrupted = true;
        let stopping = matches!(self.stage, Stage::Stopping(_));
        self.act(Some(Cause::Interrupted), tx);
        if self.latch.silent || !self.arm.joints.iter().any(Joint::has_torque) {
            return;
        }
        match &mut self.stage {
            Stage::Stopping(stop) if stopping => stop.repeat(&mut self.arm, tx),
            Stage::Faulted(_) if self.raster.is_running() => self.begin_stop(tx),
            _ => {}
        }
    }

    /// Handles an event of the transport.
    pub fn event(&mut self, event: BusEvent, now: Micros, tx: &mut impl Transmit) {
        self.arm.now = now;
        match event {
            BusEvent::ErrorPassive => self.arm.counters.error_passive += 1,
            BusEvent::Overrun => self.arm.counters.overruns += 1,
            BusEvent::TransmitQueueFull => {
                self.arm.counters.queue_full += 1;
                self.arm.queue_full = true;
                self.check_queue(tx);
            }
            BusEvent::BusOff if !matches!(self.stage, Stage::Idle) => {
                // Nothing more can be sent to the arm; its drives miss the heartbeat and stop themselves.
                tx.discard_queued();
                self.latch(Cause::BusOff);
                self.latch.silent = true;
                self.raster.stop();
                self.stage = Stage::Faulted(Diagnosis::default());
            }
            BusEvent::BusOff => {}
        }
    }

    /// A full queue stops a live arm. Otherwise what matters is repeated anyway.
    pub(super) fn check_queue(&mut self, tx: &mut impl Transmit) {
        let full = core::mem::take(&mut self.arm.queue_full) && self.stage.is_live();
        self.act(full.then_some(Cause::TransmitQueueFull), tx);
    }

    /// Acts on what a check has found; nothing but bus-off, in [`Driver::event`], is acted on elsewhere. The
    /// cause is latched where it is the first, and what may move is stopped.
    pub(super) fn act(&mut self, found: Option<Cause>, tx: &mut impl Transmit) {
        let Some(cause) = found.filter(|_| !matches!(self.stage, Stage::Idle)) else { return };
        self.latch(cause);
        match self.stage {
            Stage::Enabling(_) | Stage::Running(_) => self.begin_stop(tx),
            Stage::Boot(_) | Stage::Scripts(_) => self.give_up(Stage::Faulted(Diagnosis::default()), tx),
            // Nothing was sent yet, and nothing is: not even a heartbeat.
            Stage::Listening { .. } => {
                self.latch.silent = true;
                self.fault();
            }
            Stage::Starting { .. } | Stage::Ready | Stage::Resetting(_) => self.fault(),
            Stage::Idle | Stage::Stopping(_) | Stage::Faulted(_) => {}
        }
    }

    /// Acts on what a check finds of each joint, one after the other.
    pub(super) fn act_on_each(
        &mut self,
        tx: &mut impl Transmit,
        check: impl Fn(&mut Self, usize) -> Option<Cause>,
    ) {
        for j in 0..N {
            let found = check(self, j);
            self.act(found, tx);
        }
    }

    fn latch(&mut self, cause: Cause) {
        self.arm.note(cause);
        self.latch.take(cause, matches!(self.stage, Stage::Starting { .. }));
    }

    /// No process data flows yet: the nodes are kept from taking any.
    fn give_up(&mut self, next: Stage<N>, tx: &mut impl Transmit) {
        self.arm.cancel_transfers();
        self.latch.details = Details::default();
        self.raster.stop();
        self.arm.manage(nmt::Command::EnterPreOperational, tx);
        self.stage = next;
    }

    fn fault(&mut self) {
        self.latch.details = Details::default();
        let culprit = self.latch.cause().and_then(Cause::node).and_then(|node| self.arm.joint_of(node));
        self.stage = Stage::Faulted(Diagnosis::of(culprit));
    }

    fn begin_stop(&mut self, tx: &mut impl Transmit) {
        // A set-point that waits in a queue would act after the stop.
        tx.discard_queued();
        self.arm.cancel_transfers();
        let mut stop = Stop::new(self.arm.now);
        stop.retry(&mut self.arm, tx);
        self.stage = Stage::Stopping(stop);
    }

    /// The joints are at rest, without torque, or one of them keeps it.
    pub(super) fn end_stop(&mut self) {
        if self.latch.cause().is_some() {
            return self.fault();
        }
        // On request only: ready again if everything is in order, otherwise the driver waits for it.
        let whole = self.arm.joints.iter().all(|joint| joint.presence.missing() == 0);
        self.stage = match self.arm.unready() {
            None if whole => Stage::Ready,
            _ => Stage::Starting { since: self.arm.now },
        };
    }

    /// The profile, as given.
    pub fn profile(&self) -> &Profile<N> {
        &self.arm.profile
    }

    /// How the joints are commanded.
    pub fn control(&self) -> ControlMode {
        self.arm.control
    }

    /// The load of the bus in this mode.
    pub fn budget(&self) -> &Budget {
        &self.arm.budget
    }

    /// The present phase of the driver.
    pub fn phase(&self) -> Phase {
        self.stage.phase()
    }

    /// Why the arm was stopped, until it is acknowledged.
    pub fn cause(&self) -> Option<&Cause> {
        self.latch.cause()
    }

    /// Whether [`Driver::acknowledge`] leads to [`Phase::Idle`], from which the driver must be started again.
    pub fn needs_restart(&self) -> bool {
        self.latch.needs_restart()
    }

    /// The error details of the drive that the cause names, as far as they were read.
    pub fn details(&self) -> &Details {
        &self.latch.details
    }

    /// The joints from the base on.
    pub fn joints(&self) -> &[Joint; N] {
        &self.arm.joints
    }

    /// Positions, rad.
    pub fn positions(&self) -> [f64; N] {
        self.arm.joints.map(|joint| joint.position)
    }

    /// The set-points that have left last, rad, rad/s or A: where new ones begin.
    pub fn setpoints(&self) -> [f64; N] {
        self.arm.joints.map(|joint| joint.demand.last())
    }

    /// Counts.
    pub fn counters(&self) -> &Counters {
        &self.arm.counters
    }

    /// When the last SYNC left, on the driver's clock, µs.
    pub fn synced_at(&self) -> Micros {
        self.raster.synced_at()
    }

    /// The last 16 notes, oldest first.
    pub fn notes(&self) -> impl Iterator<Item = &Note> {
        self.arm.notes.iter()
    }

    /// Whether all process data of the present cycle is there.
    pub fn cycle_complete(&self) -> bool {
        self.raster.is_running() && self.arm.is_whole()
    }

    /// When the set-points of this cycle leave, where they have not left yet.
    pub fn setpoints_due(&self) -> Option<Micros> {
        self.raster.slot(self.arm.budget.setpoint_slot())
    }

    /// Positions (rad) and velocities (rad/s) of the joints at the last SYNC. What has not come yet is
    /// carried on with the last velocity; the second array says for how many cycles.
    pub fn state(&self) -> ([[f64; N]; 2], [u64; N]) {
        let (now, period) = (self.arm.counters.cycles, self.arm.profile.period_seconds());
        let position = self.arm.joints.each_ref().map(|joint| {
            joint.position + joint.velocity * period * now.saturating_sub(joint.position_cycle) as f64
        });
        let missed = self
            .arm
            .joints
            .each_ref()
            .map(|joint| now.saturating_sub(joint.position_cycle.min(joint.velocity_cycle)));
        ([position, self.arm.joints.each_ref().map(|joint| joint.velocity)], missed)
    }

    /// When [`Driver::poll`] has something to do at the latest.
    pub fn deadline(&self) -> Micros {
        let now = self.arm.now;
        let soon = now.saturating_add(10_000);
        if matches!(self.stage, Stage::Idle) || self.latch.silent {
            return soon;
        }
        let step = match &self.stage {
            // Neither SYNC nor heartbeat leaves, and neither is due.
            Stage::Listening { since } => {
                return soon.min(since.saturating_add(self.arm.profile.reactions.listen_time)).max(now);
            }
            Stage::Scripts(scripts) => scripts.due(&self.arm),
            _ => None,
        };
        let times = [step, self.raster.next(), self.setpoints_due(), Some(self.heartbeat.next())];
        times.into_iter().flatten().fold(soon, Micros::min)
    }
}
