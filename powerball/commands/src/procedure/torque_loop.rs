//! The arm under torques of the caller: from a law to a current per joint and cycle, behind the driver's
//! guards.
//!
//! The measurement of a SYNC is there when all process data of its cycle is; the torque that is computed from
//! it leaves in the same cycle's slot, acts from the next SYNC on and holds for a cycle. Where data of a
//! joint does not come in time, its state is extrapolated with its last velocity, for as many cycles as the
//! driver tolerates ([`TorqueMode::missing_cycles`](powerball_bus::driver::profile::TorqueMode)); then the
//! arm is stopped.

use super::{MotionLog, RecordError};
use nalgebra::SVector;
use powerball_bus::driver::{ControlMode, Phase, Profile, TorqueGuard, Tracking};
use powerball_bus::transport::{ArmError, Bus, Master, Moment};
use powerball_controller::dynamics::State;
use powerball_controller::laws::Limiter;
use std::fmt;

/// For bringing up and enabling, µs.
const PATIENCE: u64 = 60_000_000;
/// Share of the driver's limits that is used: rounding must not make a set-point one that it rejects.
const WITHIN: f64 = 0.999;

/// This long before the set-points leave, a law is evaluated with what has come, µs.
const LEAD: u64 = 300;

/// From a SYNC to when the drives' own loop takes up the torque that it releases, s: a tick of the virtual
/// drives. That of the LWA 4P's drives is not known.
const TAKEN_UP: f64 = 0.5e-3;

/// By how much the torque that a drive reports at a SYNC is later than the position: it is the one that it
/// has held since the SYNC before, so it stands for the middle of that time.
fn reported_late(period: f64) -> f64 {
    0.5 * period - TAKEN_UP
}

/// The output of a law.
#[derive(Clone, Copy, Debug)]
pub struct Asked<const N: usize> {
    /// N·m by joint.
    pub torque: SVector<f64, N>,
    /// Desired positions of the joints at the SYNC of the measurement, and their tolerance.
    pub tracking: Option<Tracking<N>>,
}

impl<const N: usize> From<SVector<f64, N>> for Asked<N> {
    fn from(torque: SVector<f64, N>) -> Self {
        Asked { torque, tracking: None }
    }
}

/// The measurements of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Measured<const N: usize> {
    /// SYNCs since the loop began.
    pub cycle: u64,
    /// Positions and velocities at the SYNC.
    pub state: State<f64, N>,
    /// Whether data of a joint is missing, whose state was carried on.
    pub is_carried_on: bool,
    /// The torque that acted in the cycle before the SYNC, as it was sent, N·m.
    pub acted: SVector<f64, N>,
}

/// An enabled arm in current mode.
pub struct TorqueLoop<B: Bus, const N: usize> {
    master: Master<B, N>,
    /// N·m/A.
    constants: [f64; N],
    limiter: Limiter<f64, N>,
    /// The last torque that was sent, and the one before.
    sent: [SVector<f64, N>; 2],
    first_cycle: u64,
    carried_on: u64,
}

impl<B: Bus, const N: usize> fmt::Debug for TorqueLoop<B, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TorqueLoop").field("constants", &self.constants).finish_non_exhaustive()
    }
}

impl<B: Bus, const N: usize> TorqueLoop<B, N> {
    /// Brings an arm that stands with closed brakes into its current mode; `accept_unverified` as for
    /// [`Driver::start`](powerball_bus::driver::Driver::start).
    ///
    /// # Errors
    /// Where driver, arm or bus refuse, or a joint's torque constant is not known; the brakes are closed
    /// then.
    pub fn bring_up(mut master: Master<B, N>, accept_unverified: bool) -> Result<Self, RecordError> {
        master.driver_mut().start(ControlMode::Current, accept_unverified).map_err(ArmError::from)?;
        master.wait_for(Phase::Ready, PATIENCE)?;
        let joints = master.driver().joints();
        let constants = joints.each_ref().map(|joint| joint.units.torque_constant());
        if let Some(j) = constants.iter().position(|constant| !(constant.is_finite() && *constant > 0.0)) {
            let units = joints[j].units;
            return Err(RecordError::Barred(format!(
                "joint {}: its torque constant is not known: {} N·m at a rated current of {} A. Set \
                    rated_torque in the bus profile, and rated_current if the drive does not report 0x6075",
                j + 1,
                units.rated_torque,
                units.rated_current
            )));
        }
        let limiter = limits(master.driver().profile(), &constants);
        Ok(TorqueLoop {
            master,
            constants,
            limiter,
            sent: [SVector::zeros(); 2],
            first_cycle: 0,
            carried_on: 0,
        })
    }

    /// Gives the driver a model of the arm for its guard of current mode.
    pub fn guard(&mut self, guard: TorqueGuard<N>) {
        self.master.driver_mut().guard_torque(guard);
    }

    /// The greatest torque that is sent, N·m by joint.
    #[must_use]
    pub fn greatest_torque(&self) -> &SVector<f64, N> {
        &self.limiter.torque
    }

    /// Cycles in which data of a joint was missing and its state was carried on.
    #[must_use]
    pub fn carried_on(&self) -> u64 {
        self.carried_on
    }

    /// Releases the brakes and runs `law` in every cycle until it gives no torque. Torques are cut to what
    /// the joints have and how fast the driver lets them change. `log` gets a line for every cycle whose data
    /// is complete.
    ///
    /// # Errors
    /// Where the arm is stopped, the driver rejects a set-point, or the log cannot be written.
    pub fn run<A: Into<Asked<N>>>(
        &mut self,
        mut log: Option<&mut MotionLog>,
        mut law: impl FnMut(&Measured<N>) -> Option<A>,
    ) -> Result<(), RecordError> {
        self.master.driver_mut().enable().map_err(ArmError::from)?;
        self.master.wait_for(Phase::Running, PATIENCE)?;
        self.first_cycle = self.master.driver().counters().cycles;
        let period = self.master.driver().profile().period_seconds();
        // The last cycle that was served.
        let mut done = self.first_cycle;
        loop {
            let cycle = self.master.driver().counters().cycles;
            let due = self.master.driver().setpoints_due().filter(|_| cycle > done);
            let late = due.map_or(u64::MAX, |due| due.saturating_sub(LEAD));
            let until = late.min(self.master.bus().now() + 100_000);
            let moment = self.master.step(until)?;
            if self.master.driver().phase() != Phase::Running {
                self.master.wait_for(Phase::Faulted, 10_000_000)?;
                self.master.check()?;
            }
            let driver = self.master.driver();
            let now_in = driver.counters().cycles;
            let over = now_in == cycle && cycle > done && self.master.bus().now() >= late;
            if now_in == done || moment != Moment::Data && !over {
                continue;
            }
            done = now_in;
            let ([q, dq], missed) = driver.state();
            let is_carried_on = missed.iter().any(|missed| *missed > 0);
            self.carried_on += u64::from(is_carried_on);
            let state = State { q: q.into(), dq: dq.into() };
            let measured =
                Measured { cycle: now_in - self.first_cycle, state, is_carried_on, acted: self.sent[1] };
            let asked: Option<Asked<N>> = law(&measured).map(Into::into);
            if let Some(log) = log.as_deref_mut().filter(|_| !is_carried_on) {
                let should = asked.and_then(|asked| asked.tracking).map_or(q, |tracking| tracking.position);
                log.take(driver, &should, Some(reported_late(period))).map_err(RecordError::Write)?;
            }
            let Some(asked) = asked else { return Ok(()) };
            let torque = self.limiter.limit(&asked.torque, period);
            self.sent = [torque, self.sent[0]];
            let mut currents = [0.0; N];
            for ((current, torque), constant) in currents.iter_mut().zip(&torque).zip(&self.constants) {
                *current = torque / constant;
            }
            let driver = self.master.driver_mut();
            let set = match &asked.tracking {
                Some(tracking) => driver.set_tracked(&currents, tracking),
                None => driver.set(&currents),
            };
            set.map_err(RecordError::Rejected)?;
        }
    }

    /// Stops the arm: brakes closed, torque off.
    ///
    /// # Errors
    /// Where the arm or the bus fails.
    pub fn finish(mut self) -> Result<Master<B, N>, RecordError> {
        self.master.stop()?;
        Ok(self.master)
    }
}

/// Limits within the driver's own.
fn limits<const N: usize>(profile: &Profile<N>, constants: &[f64; N]) -> Limiter<f64, N> {
    let of = |j: usize| WITHIN * profile.joints[j].current * constants[j];
    let torque = SVector::from_fn(|j, _| of(j).min(WITHIN * profile.joints[j].torque));
    let rate = SVector::from_fn(|j, _| of(j) * profile.reactions.current_step / profile.period_seconds());
    Limiter::new(torque, rate, SVector::zeros())
}
