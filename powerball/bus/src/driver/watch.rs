//! The watch on the motion of the joints: following error, velocity error, standstill, jumps, limits, torque,
//! and the bits of the statusword other than its state. The master watches always, whatever the drives watch
//! themselves.

use super::cause::Hindrance;
use super::script::Progress;
use super::{Cause, ControlMode, Driver, Phase, Transmit};
use crate::canopen::{Micros, NodeId};
use crate::cia402::{State, Statusword};

/// A joint that is off by less than this share of what may be keeps up with its set-points.
const BEHIND: f64 = 0.2;

/// The watch's memory of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watched {
    /// Last position and when it came.
    seen: Option<(f64, Micros)>,
    /// Position of the joint when it was released, rad: a joint outside its limits may be moved back.
    released_at: f64,
    /// Cycles in a row beyond the following error, the velocity error, with an internal limit or without
    /// interpolation.
    following: u8,
    velocity: u8,
    limited: u8,
    idle: u8,
    /// Interpolation was shown as active since the joint was released.
    interpolated: bool,
    /// The warning bit was set, and was reported.
    warned: bool,
    /// Since when the torque is at its limit.
    strained: Option<Micros>,
    /// Profile position: where the joint was when it last moved or was at its target, and when.
    still: (f64, Micros),
}

/// Counts `wrong` cycles in a row; whether they are as many as `limit`.
pub(super) fn run(count: &mut u8, wrong: bool, limit: u8) -> bool {
    *count = if wrong { count.saturating_add(1) } else { 0 };
    *count >= limit
}

impl<const N: usize> Driver<N> {
    /// The joints begin to follow set-points.
    pub(super) fn release_watch(&mut self) {
        let now = self.now;
        for joint in &mut self.joints {
            let (seen, warned) = (joint.watched.seen, joint.watched.warned);
            let (released_at, still) = (joint.position, (joint.position, now));
            joint.watched = Watched { seen, warned, released_at, still, ..Watched::default() };
        }
        self.release_guard();
    }

    /// Each position: an encoder that jumps is not a measurement.
    pub(super) fn watch_position(&mut self, j: usize, tx: &mut impl Transmit) {
        let (reactions, now, period) = (self.profile.reactions, self.now, self.profile.sync_period);
        let (Some(profile), Some(joint)) = (self.profile.joints.get(j), self.joints.get_mut(j)) else {
            return;
        };
        let position = joint.position;
        let Some((before, at)) = joint.watched.seen.replace((position, now)) else { return };
        // One period more: the data of a cycle comes early or late in it.
        let time = (now.saturating_sub(at) + period) as f64 * 1e-6;
        let most = profile.velocity * reactions.overspeed_factor * time + reactions.jump_margin;
        let step = position - before;
        if step.abs() > most && (self.phase.is_live() || self.phase == Phase::Ready) {
            self.trip(Cause::PositionJump(self.node(j), step, most), tx);
        }
    }

    /// Checks each statusword of a joint that should have torque: the bits that show whether it can use it.
    pub(super) fn watch_status(&mut self, j: usize, tx: &mut impl Transmit) {
        let node = self.node(j);
        let (running, control) = (self.phase == Phase::Running, self.control);
        let cycles = self.profile.reactions.status_cycles;
        let Some(joint) = self.joints.get_mut(j) else { return };
        let (Some(status), progress) = (joint.status, joint.progress) else { return };
        let released = running || !matches!(progress, Progress::Waiting | Progress::Walking { .. });
        if !self.phase.is_live() || status.state() != State::OperationEnabled || !released {
            return;
        }
        let watched = &mut joint.watched;
        let warning = status.has(Statusword::WARNING);
        let tell = warning && !core::mem::replace(&mut watched.warned, warning);
        let active = status.has(Statusword::MODE_12);
        let interpolating = running && control == ControlMode::InterpolatedPosition;
        watched.interpolated |= interpolating && active;
        let idle = interpolating && watched.interpolated && !active;
        let limited = status.has(Statusword::INTERNAL_LIMIT);
        let hindrance = if !status.has(Statusword::VOLTAGE_ENABLED) {
            Some(Hindrance::NoVoltage)
        } else if !status.has(Statusword::REMOTE) {
            Some(Hindrance::NotRemote)
        } else if running && control.is_position() && status.has(Statusword::MODE_13) {
            Some(Hindrance::FollowingError)
        } else if run(&mut watched.limited, limited, cycles) {
            Some(Hindrance::InternalLimit)
        } else if run(&mut watched.idle, idle, cycles) {
            Some(Hindrance::NotInterpolating)
        } else {
            None
        };
        if tell {
            self.note(Cause::Hindered(node, Hindrance::Warning, status));
        }
        if let Some(hindrance) = hindrance {
            self.trip(Cause::Hindered(node, hindrance, status), tx);
        }
    }

    /// Once a cycle, while the joints may have torque.
    pub(super) fn watch_motion(&mut self, tx: &mut impl Transmit) {
        if let Some(cause) = self.torque_left().and_then(|left| self.torque_error(&left)) {
            self.trip(cause, tx);
        }
        for j in 0..N {
            if !self.phase.is_live() {
                return;
            }
            // Data that did not come is judged as missing.
            if self.joints.get(j).is_none_or(|joint| joint.missing_run > 0) {
                continue;
            }
            let running = self.phase == Phase::Running;
            let cause = self
                .beyond_limits(j)
                .or_else(|| self.torque_at_its_limit(j))
                .or_else(|| if running { self.not_following(j) } else { None });
            if let Some(cause) = cause {
                self.trip(cause, tx);
            }
        }
    }

    fn not_following(&mut self, j: usize) -> Option<Cause> {
        if self.control == ControlMode::Current {
            return self.not_obeying(j);
        }
        let (reactions, now, node) = (self.profile.reactions, self.now, self.node(j));
        let (profile, joint) = (self.profile.joints.get(j)?, self.joints.get_mut(j)?);
        let watched = &mut joint.watched;
        match self.control {
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
                    watched.still = (joint.position, now);
                    return None;
                }
                (now.saturating_sub(since) >= reactions.still_time).then_some(Cause::Stuck(node, left))
            }
            ControlMode::Current => None,
        }
    }

    fn beyond_limits(&self, j: usize) -> Option<Cause> {
        let (profile, joint) = (self.profile.joints.get(j)?, self.joints.get(j)?);
        let ([low, high], tolerance) = (profile.position, self.profile.reactions.position_tolerance);
        // One that stood outside may come back.
        let low = low.min(joint.watched.released_at) - tolerance;
        let high = high.max(joint.watched.released_at) + tolerance;
        let (node, q) = (profile.node, joint.position);
        match q {
            q if q < low => Some(Cause::PositionLimit(node, q, low)),
            q if q > high => Some(Cause::PositionLimit(node, q, high)),
            _ => None,
        }
    }

    fn torque_at_its_limit(&mut self, j: usize) -> Option<Cause> {
        let (reactions, now, control) = (self.profile.reactions, self.now, self.control);
        let running = self.phase == Phase::Running;
        let (profile, joint) = (self.profile.joints.get(j)?, self.joints.get_mut(j)?);
        // A caller that commands currents may command the greatest one.
        let limit = joint.current_limit.unwrap_or(profile.current);
        let strained =
            control != ControlMode::Current && joint.current.abs() >= reactions.current_limit_part * limit;
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
        if !strained {
            joint.watched.strained = None;
            return None;
        }
        let since = *joint.watched.strained.get_or_insert(now);
        let node: NodeId = profile.node;
        let long = now.saturating_sub(since) >= reactions.current_limit_time;
        (long && !keeps_up).then_some(Cause::TorqueLimit(node, joint.current, limit))
    }
}
