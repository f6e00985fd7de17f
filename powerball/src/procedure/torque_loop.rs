//! The arm under torques of the caller: a law in, a current a joint and cycle out, behind the driver's guards.
//!
//! The measurement of a SYNC is there when all process data of its cycle is; the torque that is computed from it leaves
//! in the same cycle's slot, acts from the next SYNC on and holds for a cycle. A cycle without data, or with a set-point that
//! came too late, leaves the torque as it is; three in a row stop the arm.

use super::RecordError;
use crate::bus::driver::{ControlMode, Phase, Profile};
use crate::bus::transport::{ArmError, Bus, Master, Moment};
use crate::controller::dynamics::State;
use crate::controller::laws::Limiter;
use nalgebra::SVector;
use std::fmt;

/// For bringing up and enabling, µs.
const PATIENCE: u64 = 60_000_000;
/// Share of the driver's limits that is used: rounding must not make a set-point one that it rejects.
const WITHIN: f64 = 0.999;

/// What a cycle brought.
#[derive(Clone, Copy, Debug)]
pub struct Measured<const N: usize> {
    /// SYNCs since the loop began.
    pub cycle: u64,
    /// Positions and velocities at the SYNC.
    pub state: State<f64, N>,
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
    begun: u64,
}

impl<B: Bus, const N: usize> fmt::Debug for TorqueLoop<B, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TorqueLoop").field("constants", &self.constants).finish_non_exhaustive()
    }
}

impl<B: Bus, const N: usize> TorqueLoop<B, N> {
    /// Brings an arm that stands with closed brakes into its current mode; `accept_unverified` as for
    /// [`Driver::start`](crate::bus::driver::Driver::start).
    ///
    /// # Errors
    /// Where driver, arm or bus refuse, or a joint's torque constant is not known; the brakes are closed then.
    pub fn bring_up(mut master: Master<B, N>, accept_unverified: bool) -> Result<Self, RecordError> {
        master.driver_mut().start(ControlMode::Current, accept_unverified).map_err(ArmError::from)?;
        master.wait_for(Phase::Ready, PATIENCE)?;
        let joints = master.driver().joints();
        let constants =
            joints.each_ref().map(|joint| joint.units.rated_torque.abs() / joint.units.rated_current);
        if let Some(j) = constants.iter().position(|constant| !(constant.is_finite() && *constant > 0.0)) {
            let units = joints[j].units;
            return Err(RecordError::Barred(format!(
                "joint {}: its torque constant is not known: {} N·m at a rated current of {} A. Set rated_torque in the bus \
                    profile, and rated_current where the drive does not tell 0x6075",
                j + 1,
                units.rated_torque,
                units.rated_current
            )));
        }
        let limiter = limits(master.driver().profile(), &constants);
        Ok(TorqueLoop { master, constants, limiter, sent: [SVector::zeros(); 2], begun: 0 })
    }

    /// Releases the brakes and runs `law` in every cycle until it gives no torque. Torques are cut to what the joints have
    /// and how fast the driver lets them change.
    ///
    /// # Errors
    /// Where the arm is stopped, or the driver rejects a set-point.
    pub fn run(
        &mut self,
        mut law: impl FnMut(&Measured<N>) -> Option<SVector<f64, N>>,
    ) -> Result<(), RecordError> {
        self.master.driver_mut().enable().map_err(ArmError::from)?;
        self.master.wait_for(Phase::Running, PATIENCE)?;
        self.begun = self.master.driver().counters().cycles;
        let period = self.master.driver().profile().period_seconds();
        loop {
            let until = self.master.bus().now() + 100_000;
            let moment = self.master.step(until)?;
            if self.master.driver().phase() != Phase::Running {
                self.master.wait_for(Phase::Faulted, 10_000_000)?;
                self.master.check()?;
            }
            if moment != Moment::Data {
                continue;
            }
            let driver = self.master.driver();
            let joints = driver.joints();
            let state = State {
                q: SVector::from(joints.each_ref().map(|joint| joint.position)),
                dq: SVector::from(joints.each_ref().map(|joint| joint.velocity)),
            };
            let cycle = driver.counters().cycles - self.begun;
            let Some(asked) = law(&Measured { cycle, state, acted: self.sent[1] }) else { return Ok(()) };
            let torque = self.limiter.limit(&asked, period);
            self.sent = [torque, self.sent[0]];
            let mut currents = [0.0; N];
            for ((current, torque), constant) in currents.iter_mut().zip(&torque).zip(&self.constants) {
                *current = torque / constant;
            }
            self.master.driver_mut().set(&currents).map_err(RecordError::Rejected)?;
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
