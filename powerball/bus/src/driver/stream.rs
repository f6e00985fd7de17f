//! Set-points on their way to the drives, while the arm follows them: accepted or rejected, held, continued.

use super::arm::Arm;
use super::cause::{Cause, Rejection};
use super::demand::ControlMode;
use super::guard::Guard;
use crate::cia402::objects;
use powerball_controller::JointNumber;

/// The stream of set-points of an arm that follows them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stream {
    /// New ones came since the last SYNC; or were rejected.
    fresh: bool,
    rejection: Option<Rejection>,
    /// Some were taken that have not left.
    pending: bool,
    /// Set-points ever came.
    started: bool,
    /// Cycles in a row with rejected ones, and without any.
    rejected: u8,
    starved: u8,
}

impl Stream {
    /// Takes set-points, in rad, rad/s or A by the mode, if all of them may be sent.
    pub(super) fn set<const N: usize>(
        &mut self,
        arm: &mut Arm<N>,
        setpoints: &[f64; N],
    ) -> Result<(), Rejection> {
        let checked = check(arm, setpoints);
        self.rejection = checked.err().or(self.rejection);
        if checked.is_ok() {
            (self.fresh, self.pending, self.started) = (true, true, true);
            for (joint, value) in arm.joints.iter_mut().zip(setpoints) {
                joint.target = *value;
            }
        }
        checked
    }

    /// Takes set-points with torque offsets, N·m, if all of them may be sent.
    pub(super) fn set_with_torque<const N: usize>(
        &mut self,
        arm: &mut Arm<N>,
        setpoints: &[f64; N],
        torques: &[f64; N],
    ) -> Result<(), Rejection> {
        if let Err(rejection) = check_offsets(arm, torques) {
            self.rejection = Some(rejection);
            return Err(rejection);
        }
        self.set(arm, setpoints)?;
        for (joint, torque) in arm.joints.iter_mut().zip(torques) {
            joint.offset = *torque;
        }
        Ok(())
    }

    /// The set-points are about to leave. In a cycle without new ones, or with rejected ones, the joints
    /// continue their motion within their limits: an immediate standstill would need an acceleration that no
    /// joint has.
    ///
    /// # Errors
    /// Where that takes more torque than a joint has.
    pub(super) fn leave<const N: usize>(&mut self, arm: &mut Arm<N>) -> Result<(), Rejection> {
        let came = core::mem::take(&mut self.pending);
        if came || !self.started || arm.control != ControlMode::InterpolatedPosition {
            return Ok(());
        }
        let period = arm.profile.period_seconds();
        let mut targets = [0.0; N];
        for ((target, profile), joint) in targets.iter_mut().zip(&arm.profile.joints).zip(&arm.joints) {
            let acceleration = profile.acceleration * arm.profile.reactions.step_factor;
            *target = joint.demand.next(period, profile.position, profile.velocity, acceleration);
        }
        if let Some(guard) = &arm.torque_guard {
            guard.check(&arm.profile, arm.control, &arm.joints, &targets)?;
        }
        for (joint, target) in arm.joints.iter_mut().zip(targets) {
            joint.target = target;
        }
        Ok(())
    }

    /// A cycle ends: whether too many in a row had no set-points, or rejected ones.
    pub(super) fn end_cycle<const N: usize>(&mut self, arm: &mut Arm<N>) -> Option<Cause> {
        let reactions = &arm.profile.reactions;
        if self.fresh {
            (self.rejected, self.starved) = (0, 0);
        } else if let Some(rejection) = self.rejection {
            arm.counters.rejected += 1;
            self.rejected = self.rejected.saturating_add(1);
            return (self.rejected >= reactions.rejected_limit).then_some(Cause::Setpoints(rejection));
        } else if self.started && arm.control != ControlMode::ProfilePosition {
            arm.counters.starved += 1;
            self.starved = self.starved.saturating_add(1);
            let limit = reactions.starved_cycles;
            if self.starved >= limit {
                // Who waits for data that does not come has no set-points: the silent node is why.
                let silent = arm.joints.iter().position(|joint| joint.presence.missing() >= limit);
                return Some(silent.map_or(Cause::Starved, |j| Cause::DataMissing(arm.node(j))));
            }
        }
        None
    }

    /// A SYNC leaves: the next cycle's set-points are awaited.
    pub(super) fn await_setpoints(&mut self) {
        (self.fresh, self.rejection) = (false, None);
    }
}

fn check<const N: usize>(arm: &Arm<N>, setpoints: &[f64; N]) -> Result<(), Rejection> {
    let period = arm.profile.period_seconds();
    let joints = arm.profile.joints.iter().zip(&arm.joints).zip(setpoints);
    for (j, ((profile, joint), value)) in joints.enumerate() {
        Guard {
            mode: arm.control,
            joint: JointNumber::from_index(j),
            profile,
            reactions: &arm.profile.reactions,
            period,
            demand: &joint.demand,
            position: joint.position,
        }
        .check(*value)?;
        if joint.raw(arm.control, *value).cut {
            return Err(Rejection::Saturated(JointNumber::from_index(j)));
        }
    }
    match &arm.torque_guard {
        Some(guard) => guard.check(&arm.profile, arm.control, &arm.joints, setpoints),
        None => Ok(()),
    }
}

fn check_offsets<const N: usize>(arm: &Arm<N>, torques: &[f64; N]) -> Result<(), Rejection> {
    if !arm.mode().rpdo.contains(objects::TORQUE_OFFSET) {
        return Err(Rejection::NoTorqueOffset);
    }
    let part = arm.profile.reactions.current_step;
    for (j, ((profile, joint), torque)) in arm.profile.joints.iter().zip(&arm.joints).zip(torques).enumerate()
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
