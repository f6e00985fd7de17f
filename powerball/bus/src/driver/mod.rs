//! The master of the arm on its CAN bus: a CANopen master for CiA 402 drives, without clock, I/O or
//! allocation.
//!
//! A [`Driver`] is given the time and frames; it gives back frames ([`Transmit`]). The data of the arm are in
//! a [`Profile`]. Set-points and measurements are in SI.
//!
//! ```text
//! Idle ─start→ Listening → Boot → Identify → Configure → Verify → Starting → Ready
//! Ready ─enable→ Enabling → Running (set each cycle)
//! Enabling, Running ─stop→ Stopping → Ready
//! any phase ─cause→ Stopping (where joints may move) → Faulted
//! Faulted ─acknowledge→ Resetting → Starting, or Idle, where the cause needs a restart
//! ```
//!
//! # A cycle
//!
//! SYNC leaves on a fixed raster. The drives answer with their data, [`Driver::cycle_complete`] says when all
//! of it is there, [`Driver::set`] takes the next set-points, and at [`Budget::setpoint_slot`] one receive
//! PDO a drive leaves, to act with the next SYNC. There is one slot a cycle: two set-points never meet in one
//! SYNC, and a slot that was missed is left out.
//!
//! # Reactions
//!
//! "Stop" is: queued frames are discarded, quick stop to all joints at once, not waiting for the slot; at
//! rest Halt, which closes the brakes; then 0x0000. The cause is latched. Moving again needs
//! [`Driver::acknowledge`] and [`Driver::enable`]. Cycles count from the first sign of the fault.
//!
//! | event | detected by | reaction | within |
//! |---|---|---|---|
//! | a drive's heartbeat lost | three of its periods | stop, [`Cause::HeartbeatLost`], restart needed | at once |
//! | process data missing | not there when the next SYNC is due | data held, counted; after 3 cycles stop, [`Cause::DataMissing`] | 3 cycles |
//! | master lost | the drives: 0x1016, and SCHUNK's 0x200E, written and verified | the drives stop; without both no enabling ([`Cause::NoWatch`]) | 0x1016, 0x200E |
//! | SYNC late, left out | the driver's own raster | counted; 5 late or 3 left out: stop, [`Cause::Late`]; a missed slot is left out | the limit |
//! | emergency, code ≠ 0 | 0x80 + id | latched with its code, stop; the drive's error details are read after it; repeats are counted only | at once |
//! | boot-up while running | 0x700 + id, 0x00 | stop, [`Cause::Rebooted`], restart needed | at once |
//! | unexpected state or mode | each statusword and mode display | stop, [`Cause::DriveFault`], [`Cause::StateLost`], [`Cause::UnknownState`], [`Cause::WrongMode`] | at once |
//! | left NMT operational | heartbeat | stop, [`Cause::NotOperational`], restart needed | at once |
//! | error passive, received frames lost | transport | counted | |
//! | another master: SYNC, NMT, set-points for our nodes, our own heartbeat | listening before the start, and always | before: refused, nothing was sent; later: stop, [`Cause::OtherMaster`], restart needed | at once |
//! | two nodes with one id | process data twice in a cycle, 5 cycles in a row | stop, [`Cause::TwoNodes`], restart needed | 5 cycles |
//! | bus-off | transport | queue discarded, silence (also of the heartbeat, so that the drives stop themselves), [`Cause::BusOff`], restart needed | at once |
//! | transmit queue full | transport | queue discarded, stop, repeated until it could be queued | at once |
//! | set-point NaN, jumping, outside the limits, more torque than a joint has | before it leaves | rejected, the last one held, counted; 3 cycles in a row: stop, [`Cause::Setpoints`] | 3 cycles |
//! | torque offset NaN, beyond the joint's torque, jumping | before it leaves | as a set-point | 3 cycles |
//! | no new set-point | in the slot | the last one held; 3 cycles in a row: stop, [`Cause::Starved`] (not in profile position) | 3 cycles |
//! | velocities mean something else | commanded and measured travel, while the scale is not verified on hardware | stop, [`Cause::WrongVelocityScale`] | 0.1 rad |
//! | joint not where or not as fast as commanded, stuck, jumping, beyond its limits, at its current limit | each cycle | stop, [`Cause::FollowingError`], [`Cause::VelocityError`], [`Cause::Stuck`], [`Cause::PositionJump`], [`Cause::PositionLimit`], [`Cause::TorqueLimit`] | [`profile::Reactions`] |
//! | current mode: a joint that does not move as its torque says, measurements that no joint can have | each cycle | stop, [`Cause::ImplausibleVelocity`], [`Cause::PositionAgainstVelocity`], [`Cause::CurrentError`], [`Cause::TorqueError`], [`Cause::OffPath`] | [`profile::TorqueMode`] |
//! | voltage, remote, internal limit, interpolation, following error in the statusword | each statusword of a joint with torque | stop, [`Cause::Hindered`] | at once, 3 cycles |
//! | the program is asked to end | the caller, by a signal | stop, [`Cause::Interrupted`] | at once |
//! | joint too fast | measured velocity | 3 cycles in a row: stop, [`Cause::Overspeed`] | 3 cycles |
//! | refused transition | state and time | stop, [`Cause::Transition`] with the reason that the statusword gives | its time limit |
//!
//! The numbers are [`profile::Reactions::DEFAULT`].

mod bringup;
pub mod budget;
pub mod cause;
mod cycle;
pub mod dictionary;
mod guard;
#[cfg(feature = "std")]
pub mod import;
mod joint;
mod listen;
pub mod lwa4p;
pub mod profile;
mod receive;
mod script;
mod stop;
mod torque;
mod torque_mode;
pub mod units;
mod watch;

use crate::canopen::sync::{HeartbeatProducer, SyncProducer};
use crate::canopen::{Frame, Micros, NodeId};
use bringup::BringUp;
pub use budget::{Budget, Verdict};
pub use cause::{Cause, Details, Refusal, Rejection};
use core::fmt;
pub use guard::check_path;
pub use joint::{BusEvent, Joint, JointCounters, QueueFull, Transmit};
pub use listen::{Heard, Listener, OtherMapping};
pub use profile::{JointProfile, Profile};
pub use receive::Foreign;
use stop::{ResetStage, StopStage};
pub use torque::{ControlMode, TorqueGuard};
pub use torque_mode::Tracking;

/// The phases of the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The driver is idle: no frame is sent.
    Idle,
    /// Nothing is sent: another master would be heard.
    Listening,
    /// The nodes were reset; their boot-up messages are awaited.
    Boot,
    /// Who they are and what they offer is read.
    Identify,
    /// The nodes are configured.
    Configure,
    /// The configuration is read back.
    Verify,
    /// SYNC runs; the first process data is awaited.
    Starting,
    /// Configured, without torque, brakes closed.
    Ready,
    /// On the way to "operation enabled"; brakes closed but for a joint that commutates.
    Enabling,
    /// Following set-points.
    Running,
    /// Quick stop, brakes, torque off.
    Stopping,
    /// Stopped, with a cause latched.
    Faulted,
    /// The drives' faults are reset, once.
    Resetting,
}

impl Phase {
    /// All of them.
    pub const ALL: [Phase; 13] = [
        Phase::Idle,
        Phase::Listening,
        Phase::Boot,
        Phase::Identify,
        Phase::Configure,
        Phase::Verify,
        Phase::Starting,
        Phase::Ready,
        Phase::Enabling,
        Phase::Running,
        Phase::Stopping,
        Phase::Faulted,
        Phase::Resetting,
    ];

    /// The phase in words that continue "the driver …".
    pub const fn text(self) -> &'static str {
        match self {
            Phase::Idle => "is idle",
            Phase::Listening => "listens for another master",
            Phase::Boot => "waits for the nodes to boot",
            Phase::Identify => "identifies the nodes",
            Phase::Configure => "configures the nodes",
            Phase::Verify => "verifies the configuration",
            Phase::Starting => "waits for process data",
            Phase::Ready => "is ready, not enabled",
            Phase::Enabling => "is enabling",
            Phase::Running => "is running",
            Phase::Stopping => "is stopping",
            Phase::Faulted => "is stopped by a fault",
            Phase::Resetting => "resets faults",
        }
    }

    /// Whether the joints may have torque on the driver's command.
    const fn is_live(self) -> bool {
        matches!(self, Phase::Enabling | Phase::Running)
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// Counts of what went wrong and did no harm, or not yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// SYNCs sent.
    pub cycles: u64,
    /// SYNCs that were late.
    pub late: u64,
    /// The latest, µs.
    pub worst_late: Micros,
    /// SYNCs left out because their time had passed.
    pub skipped: u64,
    /// Slots left out because the next SYNC was due: the drives held their last set-points.
    pub dropped: u64,
    /// Cycles whose set-points were rejected.
    pub rejected: u64,
    /// Cycles without new set-points.
    pub starved: u64,
    /// Frames that could not be queued.
    pub queue_full: u64,
    /// Times that the controller became error passive.
    pub error_passive: u64,
    /// Times that received frames were lost in the controller or the adapter.
    pub overruns: u64,
    /// Received frames of unknown identifiers.
    pub unexpected: u64,
}

/// Something that was reported, and when. Repeats of the last one are counted, not kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Note {
    /// When first.
    pub at: Micros,
    /// The cause of the note.
    pub cause: Cause,
    /// How often in a row.
    pub times: u32,
}

const NOTES: usize = 16;

/// The master of an arm of `N` joints.
#[derive(Clone, Debug)]
pub struct Driver<const N: usize> {
    profile: Profile<N>,
    control: ControlMode,
    budget: Budget,
    phase: Phase,
    since: Micros,
    now: Micros,
    cause: Option<Cause>,
    /// The nodes' configuration can no longer be trusted.
    restart: bool,
    /// The program was asked to end, and the arm was stopped for it.
    interrupted: bool,
    details: Details,
    silent: bool,
    joints: [Joint; N],
    torque_guard: Option<TorqueGuard<N>>,
    sync: SyncProducer,
    synced_at: Micros,
    heartbeat: HeartbeatProducer,
    bring_up: BringUp,
    /// Nodes that are others than the profile says are accepted.
    other_nodes: bool,
    stop: StopStage,
    reset: ResetStage,
    diagnosis: Option<(usize, usize)>,
    /// The set-points of this cycle have not left yet.
    slot_open: bool,
    /// New set-points came, or were rejected, since the last SYNC; whether they ever came.
    fresh: bool,
    /// Set-points were taken that have not left.
    pending: bool,
    rejection: Option<Rejection>,
    streaming: bool,
    rejected_run: u8,
    starved_run: u8,
    late_run: u8,
    good_run: u16,
    queue_full: bool,
    counters: Counters,
    notes: [Option<Note>; NOTES],
    noted: usize,
}

impl<const N: usize> Driver<N> {
    /// A driver of the arm of `profile`, idle.
    ///
    /// # Errors
    /// Where the profile contradicts itself: a node twice, no watching of the master, a PDO without what the
    /// driver needs.
    pub fn new(profile: Profile<N>) -> Result<Driver<N>, Refusal> {
        profile.check()?;
        let reactions = &profile.reactions;
        let lost = Micros::from(profile.node_heartbeat_ms) * 3000;
        Ok(Driver {
            control: ControlMode::InterpolatedPosition,
            budget: Budget::of(&profile, &profile::ModeProfile::NONE),
            phase: Phase::Idle,
            since: 0,
            now: 0,
            cause: None,
            restart: false,
            interrupted: false,
            details: Details::default(),
            silent: false,
            joints: profile.joints.map(|joint| Joint::new(&joint, lost, reactions.sdo_timeout)),
            torque_guard: None,
            sync: SyncProducer::new(profile.sync_period),
            synced_at: 0,
            heartbeat: HeartbeatProducer::new(profile.master_heartbeat),
            bring_up: BringUp::default(),
            other_nodes: false,
            stop: StopStage::Quick,
            reset: ResetStage::Low,
            diagnosis: None,
            slot_open: false,
            fresh: false,
            pending: false,
            rejection: None,
            streaming: false,
            rejected_run: 0,
            starved_run: 0,
            late_run: 0,
            good_run: 0,
            queue_full: false,
            counters: Counters::default(),
            notes: [None; NOTES],
            noted: 0,
            profile,
        })
    }

    /// From now on no set-point is sent that requires more torque of a joint than its profile allows, by the
    /// model of `guard`.
    pub fn guard_torque(&mut self, guard: TorqueGuard<N>) {
        self.torque_guard = Some(guard);
    }

    /// From the next [`Driver::start`] on, nodes with another device type (0x1000) or identity (0x1018) than
    /// in the profile are used, each deviation with a [`Note`]. Without this call they are refused.
    pub fn accept_other_nodes(&mut self) {
        self.other_nodes = true;
    }

    /// Boots, identifies, configures and verifies all nodes for `control`; the driver is [`Phase::Ready`]
    /// then. Possible when idle and when ready (to change the mode). With `accept_unverified` the caller
    /// allows a mode that was never verified on the arm itself.
    ///
    /// # Errors
    /// If the phase does not allow it, the profile does not have the mode, it is the unverified current mode
    /// and not accepted, or the bus load would be too high.
    pub fn start(&mut self, control: ControlMode, accept_unverified: bool) -> Result<Verdict, Refusal> {
        match self.phase {
            Phase::Idle | Phase::Ready => {}
            Phase::Faulted => return Err(self.latched()),
            phase => return Err(Refusal::Phase(phase.text())),
        }
        let mode = self.profile.mode(control).ok_or(Refusal::NoMode(control))?;
        if control == ControlMode::Current && !mode.verified_on_hardware && !accept_unverified {
            return Err(Refusal::NotVerified(control));
        }
        let budget = Budget::of(&self.profile, mode);
        let verdict = budget.verdict();
        if verdict == Verdict::TooMuch {
            return Err(Refusal::BusLoad(budget.worst_load()));
        }
        self.control = control;
        self.budget = budget;
        self.bring_up = BringUp::default();
        self.sync.stop();
        self.joints.iter_mut().for_each(|joint| joint.heartbeat.stop());
        // Who was heard by its nodes until now has listened all the time, and must not fall silent.
        self.enter(if self.phase == Phase::Ready { Phase::Boot } else { Phase::Listening });
        Ok(verdict)
    }

    /// Releases the brakes and follows set-points: the joints are enabled and commutated, then the driver is
    /// [`Phase::Running`], holding the arm where it is until the first set-points.
    ///
    /// # Errors
    /// Where the driver is not ready.
    pub fn enable(&mut self) -> Result<(), Refusal> {
        match self.phase {
            Phase::Ready => {
                self.joints.iter_mut().for_each(|joint| joint.progress = script::Progress::Waiting);
                self.enter(Phase::Enabling);
                Ok(())
            }
            Phase::Faulted => Err(self.latched()),
            phase => Err(Refusal::Phase(phase.text())),
        }
    }

    /// Acknowledges the latched cause. Drives in fault are then reset, once. If the nodes' configuration can
    /// no longer be trusted, the driver becomes idle and must be started again. Nothing moves before
    /// [`Driver::enable`].
    ///
    /// # Errors
    /// Where nothing is latched, or the arm is still being stopped.
    pub fn acknowledge(&mut self) -> Result<(), Refusal> {
        if self.phase != Phase::Faulted {
            return Err(Refusal::Phase(self.phase.text()));
        }
        self.cause = None;
        self.interrupted = false;
        self.diagnosis = None;
        self.joints.iter_mut().for_each(|joint| joint.client.cancel());
        if self.restart || !self.sync.is_running() {
            self.silent = false;
            self.restart = false;
            self.sync.stop();
            self.enter(Phase::Idle);
        } else {
            self.reset = ResetStage::Low;
            self.enter(Phase::Resetting);
        }
        Ok(())
    }

    /// The profile, as given.
    pub fn profile(&self) -> &Profile<N> {
        &self.profile
    }

    /// How the joints are commanded.
    pub fn control(&self) -> ControlMode {
        self.control
    }

    /// The load of the bus in this mode.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// The present phase of the driver.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Why the arm was stopped, until it is acknowledged.
    pub fn cause(&self) -> Option<&Cause> {
        self.cause.as_ref()
    }

    /// Whether [`Driver::acknowledge`] leads to [`Phase::Idle`], from which the driver must be started again.
    pub fn needs_restart(&self) -> bool {
        self.restart
    }

    /// The error details of the drive that the cause names, as far as they were read.
    pub fn details(&self) -> &Details {
        &self.details
    }

    /// The joints from the base on.
    pub fn joints(&self) -> &[Joint; N] {
        &self.joints
    }

    /// Positions, rad.
    pub fn positions(&self) -> [f64; N] {
        self.joints.map(|joint| joint.position)
    }

    /// The set-points that have left last, rad, rad/s or A: where new ones begin.
    pub fn setpoints(&self) -> [f64; N] {
        self.joints.map(|joint| joint.demand.last())
    }

    /// Counts.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// When the last SYNC left, on the driver's clock, µs.
    pub fn synced_at(&self) -> Micros {
        self.synced_at
    }

    /// The last 16 notes, oldest first.
    pub fn notes(&self) -> impl Iterator<Item = &Note> {
        let (newer, older) = self.notes.split_at(self.noted % NOTES);
        older.iter().chain(newer).flatten()
    }

    /// Whether all process data of the present cycle is there.
    pub fn cycle_complete(&self) -> bool {
        let all = self.all_tpdos();
        self.sync.is_running() && self.joints.iter().all(|joint| joint.arrived == all)
    }

    /// When the set-points of this cycle leave, where they have not left yet.
    pub fn setpoints_due(&self) -> Option<Micros> {
        self.slot_open.then(|| self.slot())
    }

    /// When [`Driver::poll`] has something to do at the latest.
    pub fn deadline(&self) -> Micros {
        let soon = self.now.saturating_add(10_000);
        if self.phase == Phase::Idle || self.silent {
            return soon;
        }
        // Neither SYNC nor heartbeat leaves, and neither is due.
        if self.phase == Phase::Listening {
            return soon.min(self.since.saturating_add(self.profile.reactions.listen_time)).max(self.now);
        }
        let slot = self.slot_open.then(|| self.slot());
        let scripted = matches!(self.phase, Phase::Identify | Phase::Configure | Phase::Verify);
        let steps = self
            .joints
            .iter()
            .filter(|joint| scripted && joint.client.is_idle())
            .map(|joint| joint.next_step);
        let soon = steps.filter(|step| *step > self.now).fold(soon, Micros::min);
        [self.sync.next(), slot, Some(self.heartbeat.next())].into_iter().flatten().fold(soon, Micros::min)
    }

    /// Time: sends what is due. To be called at [`Driver::deadline`] or earlier, and after set-points and
    /// commands.
    pub fn poll(&mut self, now: Micros, tx: &mut impl Transmit) {
        self.now = now;
        if self.phase == Phase::Idle || self.silent {
            return;
        }
        if self.phase == Phase::Listening {
            self.poll_listening();
            return;
        }
        if self.heartbeat.poll(now) {
            let frame = crate::canopen::nmt::State::Operational.frame(self.profile.master);
            self.send(frame, tx);
        }
        self.poll_cycle(tx);
        self.watch_heartbeats(tx);
        match self.phase {
            Phase::Boot => self.poll_boot(tx),
            Phase::Identify | Phase::Configure | Phase::Verify => self.poll_scripts(tx),
            Phase::Starting => self.poll_starting(tx),
            Phase::Enabling => self.poll_enabling(tx),
            Phase::Stopping => self.retry_stop(tx),
            Phase::Faulted => self.poll_diagnosis(tx),
            Phase::Idle | Phase::Listening | Phase::Ready | Phase::Running | Phase::Resetting => {}
        }
        self.check_queue(tx);
    }

    fn send(&mut self, frame: Frame, tx: &mut impl Transmit) -> bool {
        let sent = tx.send(frame).is_ok();
        if !sent {
            self.counters.queue_full += 1;
            self.queue_full = true;
        }
        sent
    }

    /// A full queue stops a live arm. Otherwise what matters is repeated anyway.
    fn check_queue(&mut self, tx: &mut impl Transmit) {
        if core::mem::take(&mut self.queue_full) && self.phase.is_live() {
            self.trip(Cause::TransmitQueueFull, tx);
        }
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.since = self.now;
    }

    fn elapsed(&self) -> Micros {
        self.now.saturating_sub(self.since)
    }

    fn latched(&self) -> Refusal {
        self.cause.map_or(Refusal::Phase(self.phase.text()), Refusal::Latched)
    }

    fn node(&self, j: usize) -> NodeId {
        self.profile.joints.get(j).map_or(self.profile.master, |joint| joint.node)
    }

    fn joint_of(&self, node: NodeId) -> Option<usize> {
        self.profile.joints.iter().position(|joint| joint.node == node)
    }

    fn mode_profile(&self) -> &profile::ModeProfile {
        self.profile.mode(self.control).unwrap_or(&profile::ModeProfile::NONE)
    }

    fn note(&mut self, cause: Cause) {
        let last = (self.noted + NOTES - 1) % NOTES;
        if let Some(Some(note)) =
            self.notes.get_mut(last).filter(|note| note.is_some_and(|n| n.cause == cause))
        {
            note.times = note.times.saturating_add(1);
            return;
        }
        if let Some(place) = self.notes.get_mut(self.noted % NOTES) {
            *place = Some(Note { at: self.now, cause, times: 1 });
            self.noted = (self.noted + 1) % NOTES;
        }
    }
}
