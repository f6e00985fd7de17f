//! The watch on the motion of the joints: following error, velocity error, standstill, jumps, limits, speed,
//! torque, and the bits of the statusword other than its state. The master watches always, whatever the
//! drives watch themselves.
//!
//! Each check is of one joint; it returns a cause, and stops nothing.

use super::arm::Arm;
use super::cause::{Cause, Hindrance};
use super::demand::ControlMode;
use super::presence::run;
use crate::canopen::Micros;
use crate::cia402::{State, Statusword};
use powerball_controller::JointNumber;

/// A joint that is off by less than this share of what may be keeps up with its set-points.
const BEHIND: f64 = 0.2;

/// The memory of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct Watched {
    /// Last position and when it came.
    seen: Option<(f64, Micros)>,
    /// Position of the joint when it was released, rad: a joint outside its limits may be moved back.
    released_at: f64,
    /// Cycles in a row beyond the following error, the velocity error, with an internal limit or without
    /// interpolation, too fast.
    following: u8,
    velocity: u8,
    limited: u8,
    idle: u8,
    fast: u8,
    /// Interpolation was shown as active since the joint was released.
    interpolated: bool,
    /// The warning bit was set, and was reported.
    warned: bool,
    /// Since when the torque is at its limit.
    strained: Option<Micros>,
    /// Profile position: where the joint was when it last moved or was at its target, and when.
    still: (f64, Micros),
    /// Travel that velocity set-points commanded, rad, and the position from which on they did.
    swept: f64,
    swept_from: f64,
}

/// The watch on the motion of all joints.
#[derive(Clone, Debug)]
pub(super) struct Watch<const N: usize> {
    joints: [Watched; N],
}

impl<const N: usize> Watch<N> {
    /// Nothing was seen yet.
    pub(super) fn new() -> Self {
        Watch { joints: [Watched::default(); N] }
    }

    /// The joints begin to follow set-points.
    pub(super) fn release(&mut self, arm: &Arm<N>) {
        for (watched, joint) in self.joints.iter_mut().zip(&arm.joints) {
            let Watched { seen, warned, fast, .. } = *watched;
            let (q, still) = (joint.position, (joint.position, arm.now));
            *watched =
                Watched { seen, warned, fast, released_at: q, still, swept_from: q, ..Watched::default() };
        }
    }

    /// Each position: an encoder that jumps is not a measurement. It is `judged` where the joint may have
    /// torque, or soon.
    pub(super) fn jump(&mut self, arm: &Arm<N>, judged: bool, j: usize) -> Option<Cause> {
        let (reactions, period) = (&arm.profile.reactions, arm.profile.sync_period);
        let (profile, position) = (arm.profile.joints.get(j)?, arm.joints.get(j)?.position);
        let (before, at) = self.joints.get_mut(j)?.seen.replace((position, arm.now))?;
        // One period more: the data of a cycle comes early or late in it.
        let time = (arm.elapsed(at) + period) as f64 * 1e-6;
        let most = profile.velocity * reactions.overspeed_factor * time + reactions.jump_margin;
        let step = position - before;
        (judged && step.abs() > most).then_some(Cause::PositionJump(profile.node, step, most))
    }

    /// Each velocity, while the joints may have torque.
    pub(super) fn speed(&mut self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let reactions = &arm.profile.reactions;
        let (factor, cycles) = match arm.control {
            ControlMode::Current => (reactions.torque_mode.overspeed_factor, reactions.torque_mode.cycles),
            _ => (reactions.overspeed_factor, reactions.missing_cycles),
        };
        let (velocity, most) = (arm.joints.get(j)?.velocity, arm.profile.joints.get(j)?.velocity * factor);
        let (fast, allowed) = (&mut self.joints.get_mut(j)?.fast, velocity.abs() <= most);
        if !run(fast, !allowed, cycles.max(1)) {
            return None;
        }
        *fast = 0;
        Some(Cause::Overspeed(JointNumber::from_index(j), velocity, most))
    }

    /// Each statusword of a joint that is `released`: the bits that show whether it can use its torque.
    pub(super) fn status(
        &mut self,
        arm: &mut Arm<N>,
        running: bool,
        released: bool,
        j: usize,
    ) -> Option<Cause> {
        let (node, cycles, control) = (arm.node(j), arm.profile.reactions.status_cycles, arm.control);
        let status = arm.joints.get(j)?.status?;
        if !released || status.state() != State::OperationEnabled {
            return None;
        }
        let watched = self.joints.get_mut(j)?;
        let warning = status.has(Statusword::WARNING);
        if warning && !core::mem::replace(&mut watched.warned, warning) {
            arm.note(Cause::Hindered(node, Hindrance::Warning, status));
        }
        let active = status.has(Statusword::MODE_12);
        let interpolating = running && control == ControlMode::InterpolatedPosition;
        watched.interpolated |= interpolating && active;
        let idle = interpolating && watched.interpolated && !active;
        let limited = status.has(Statusword::INTERNAL_LIMIT);
        let hindrance = if !status.has(Statusword::VOLTAGE_ENABLED) {
            Hindrance::NoVoltage
        } else if !status.has(Statusword::REMOTE) {
            Hindrance::NotRemote
        } else if running && control.is_position() && status.has(Statusword::MODE_13) {
            Hindrance::FollowingError
        } else if run(&mut watched.limited, limited, cycles) {
            Hindrance::InternalLimit
        } else if run(&mut watched.idle, idle, cycles) {
            Hindrance::NotInterpolating
        } else {
            return None;
        };
        Some(Cause::Hindered(node, hindrance, status))
    }

    /// Each cycle in velocity mode: compares the commanded travel with the measured one. A joint that is slow
    /// to follow has no large velocity error. As long as the scale of velocities was not verified on
    /// hardware, each move verifies it too: two readings of 0x604C are the inverse of each other.
    pub(super) fn travel(&mut self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let (joint, watched) = (arm.joints.get(j)?, self.joints.get_mut(j)?);
        if arm.control != ControlMode::Velocity {
            return None;
        }
        watched.swept += joint.demand.last() * arm.profile.period_seconds();
        if watched.swept.abs() < arm.profile.reactions.scale_travel {
            return None;
        }
        let part = (joint.position - watched.swept_from) / watched.swept;
        (watched.swept, watched.swept_from) = (0.0, joint.position);
        (!(0.5..=2.0).contains(&part)).then_some(Cause::WrongVelocityScale(arm.node(j), part))
    }

    /// Each cycle with the data of a joint that may have torque.
    pub(super) fn motion(&mut self, arm: &Arm<N>, running: bool, j: usize) -> Option<Cause> {
        self.beyond_limits(arm, j)
            .or_else(|| self.torque_at_its_limit(arm, running, j))
            .or_else(|| if running { self.not_following(arm, j) } else { None })
    }

    fn not_following(&mut self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let (reactions, node) = (&arm.profile.reactions, arm.node(j));
        let (profile, joint) = (arm.profile.joints.get(j)?, arm.joints.get(j)?);
        let watched = self.joints.get_mut(j)?;
        match arm.control {
            ControlMode::InterpolatedPosition => {
                let error = joint.demand.error(joint.position);
                let wrong = error.abs() > profile.following_error;
                run(&mut watched.following, wrong, reactions.following_cycles)
                    .then_some(Cause::FollowingError(node, error, profile.following_error))
            }
            ControlMode::Velocity => {
                let error = joint.demand.error(joint.velocity);
                let wrong = error.abs() > profile.velocity_error;
                run(&mut watched.velocity, wrong, reactions.velocity_cycles).then_some(Cause::VelocityError(
                    node,
                    error,
                    profile.velocity_error,
                ))
            }
            ControlMode::ProfilePosition => {
                // The drive makes the way itself: it must come on, or be there.
                let left = joint.demand.last() - joint.position;
                let (from, since) = watched.still;
                if left.abs() <= profile.following_error
                    || (joint.position - from).abs() > reactions.still_travel
                {
                    watched.still = (joint.position, arm.now);
                    return None;
                }
                (arm.elapsed(since) >= reactions.still_time).then_some(Cause::Stuck(node, left))
            }
            ControlMode::Current => None,
        }
    }

    fn beyond_limits(&self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let (profile, released_at) = (arm.profile.joints.get(j)?, self.joints.get(j)?.released_at);
        let ([low, high], tolerance) = (profile.position, arm.profile.reactions.position_tolerance);
        // One that stood outside may come back.
        let (low, high) = (low.min(released_at) - tolerance, high.max(released_at) + tolerance);
        match arm.joints.get(j)?.position {
            q if q < low => Some(Cause::PositionLimit(profile.node, q, low)),
            q if q > high => Some(Cause::PositionLimit(profile.node, q, high)),
            _ => None,
        }
    }

    fn torque_at_its_limit(&mut self, arm: &Arm<N>, running: bool, j: usize) -> Option<Cause> {
        let (reactions, control) = (&arm.profile.reactions, arm.control);
        let (profile, joint) = (arm.profile.joints.get(j)?, arm.joints.get(j)?);
        let watched = self.joints.get_mut(j)?;
        // A caller that commands currents may command the greatest one.
        let limit = joint.current_limit.unwrap_or(profile.current);
        let strained =
            control != ControlMode::Current && joint.current.abs() >= reactions.current_limit_part * limit;
        if !strained {
            watched.strained = None;
            return None;
        }
        // A drive may work at its limit as long as the joint goes where it is commanded.
        let keeps_up = running
            && match control {
                ControlMode::InterpolatedPosition => {
                    joint.demand.error(joint.position).abs() < BEHIND * profile.following_error
                }
                ControlMode::Velocity => {
                    joint.demand.error(joint.velocity).abs() < BEHIND * profile.velocity_error
                }
                ControlMode::ProfilePosition | ControlMode::Current => false,
            };
        let since = *watched.strained.get_or_insert(arm.now);
        let long = arm.elapsed(since) >= reactions.current_limit_time;
        (long && !keeps_up).then_some(Cause::TorqueLimit(profile.node, joint.current, limit))
    }
}
