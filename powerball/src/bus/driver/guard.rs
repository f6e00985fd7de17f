//! What a set-point must be to leave for the arm.

use super::profile::{ControlMode, JointProfile, Reactions};
use core::fmt;

/// Why a set-point was rejected; joints count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Joint's value is NaN or infinite.
    NotFinite(usize),
    /// Joint, position (asked for, or reached before it can stop) and the limit that it would pass, rad.
    Position(usize, f64, f64),
    /// Joint, speed and greatest speed, rad/s.
    Velocity(usize, f64, f64),
    /// Joint, current and greatest current, A.
    Current(usize, f64, f64),
    /// Joint, change since the last set-point and the greatest change, in the mode's unit.
    Jump(usize, f64, f64),
    /// Joint whose value the drive's type cannot hold: it would be cut.
    Saturated(usize),
    /// The arm does not follow set-points now.
    NotRunning,
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Rejection::NotFinite(j) => write!(f, "joint {}: the set-point is not a number", j + 1),
            Rejection::Position(j, q, limit) => {
                write!(f, "joint {}: position {q:.4} rad beyond the limit {limit:.4} rad", j + 1)
            }
            Rejection::Velocity(j, v, limit) => {
                write!(f, "joint {}: {v:.4} rad/s is more than the greatest speed {limit:.4} rad/s", j + 1)
            }
            Rejection::Current(j, i, limit) => {
                write!(f, "joint {}: {i:.3} A is more than the greatest current {limit:.3} A", j + 1)
            }
            Rejection::Jump(j, step, limit) => {
                write!(f, "joint {}: a step of {step:.5} in one cycle, {limit:.5} can be", j + 1)
            }
            Rejection::Saturated(j) => {
                write!(f, "joint {}: the drive's number type cannot hold the set-point", j + 1)
            }
            Rejection::NotRunning => f.write_str("the arm does not follow set-points now"),
        }
    }
}

impl core::error::Error for Rejection {}

/// The guard of one joint in one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guard<'a> {
    pub(super) mode: ControlMode,
    pub(super) joint: usize,
    pub(super) profile: &'a JointProfile,
    pub(super) reactions: &'a Reactions,
    /// SYNC period, s.
    pub(super) period: f64,
    /// The last set-point that left.
    pub(super) last: f64,
    /// Measured position, rad.
    pub(super) position: f64,
}

impl Guard<'_> {
    /// Whether `value` (rad, rad/s or A by the mode) may leave.
    pub(super) fn check(&self, value: f64) -> Result<(), Rejection> {
        let (j, limits) = (self.joint, self.profile);
        if !value.is_finite() {
            return Err(Rejection::NotFinite(j));
        }
        match self.mode {
            ControlMode::ProfilePosition => self.inside(value),
            ControlMode::InterpolatedPosition => {
                self.inside(value)?;
                self.step(value, limits.velocity * self.period * self.reactions.step_factor)
            }
            ControlMode::Velocity => {
                if value.abs() > limits.velocity {
                    return Err(Rejection::Velocity(j, value, limits.velocity));
                }
                // Where the joint would come to rest if it braked now; only what leads outwards is rejected.
                self.outwards(value, self.position + value * value.abs() / (2.0 * limits.acceleration))?;
                self.step(value, limits.acceleration * self.period * self.reactions.step_factor)
            }
            ControlMode::Current => {
                if value.abs() > limits.current {
                    return Err(Rejection::Current(j, value, limits.current));
                }
                self.outwards(value, self.position)?;
                self.step(value, limits.current * self.reactions.current_step)
            }
        }
    }

    fn inside(&self, position: f64) -> Result<(), Rejection> {
        let ([low, high], margin) = (self.profile.position, self.reactions.position_margin);
        // A joint that stands outside may be moved back: never further out than it is.
        let low = low.min(self.position) - margin;
        let high = high.max(self.position) + margin;
        match position {
            q if q < low => Err(Rejection::Position(self.joint, q, low)),
            q if q > high => Err(Rejection::Position(self.joint, q, high)),
            _ => Ok(()),
        }
    }

    fn outwards(&self, value: f64, position: f64) -> Result<(), Rejection> {
        let ([low, high], margin) = (self.profile.position, self.reactions.position_margin);
        if value < 0.0 && position < low - margin {
            Err(Rejection::Position(self.joint, position, low - margin))
        } else if value > 0.0 && position > high + margin {
            Err(Rejection::Position(self.joint, position, high + margin))
        } else {
            Ok(())
        }
    }

    fn step(&self, value: f64, limit: f64) -> Result<(), Rejection> {
        let step = value - self.last;
        if step.abs() > limit { Err(Rejection::Jump(self.joint, step, limit)) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lwa4p::LWA4P;
    use super::*;

    fn guard(mode: ControlMode, last: f64, position: f64) -> Guard<'static> {
        let profile = &LWA4P.joints[0];
        Guard { mode, joint: 0, profile, reactions: &LWA4P.reactions, period: 0.005, last, position }
    }

    #[test]
    fn not_a_number_never_leaves() {
        for mode in ControlMode::ALL {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert_eq!(guard(mode, 0.0, 0.0).check(value), Err(Rejection::NotFinite(0)));
            }
        }
    }

    #[test]
    fn interpolated_steps_end_at_the_greatest_speed() {
        let guard = guard(ControlMode::InterpolatedPosition, 0.1, 0.1);
        let step = LWA4P.joints[0].velocity * 0.005;
        assert_eq!(guard.check(0.1 + step), Ok(()));
        assert!(matches!(guard.check(0.1 + 1.1 * step), Err(Rejection::Jump(0, ..))));
    }

    #[test]
    fn a_joint_outside_its_limits_may_only_come_back() {
        let high = LWA4P.joints[0].position[1];
        let guard = |mode, last| guard(mode, last, high + 0.02);
        let positions = guard(ControlMode::InterpolatedPosition, high + 0.02);
        assert_eq!(positions.check(high + 0.019), Ok(()));
        assert!(matches!(positions.check(high + 0.021), Err(Rejection::Position(..))));
        let velocities = guard(ControlMode::Velocity, 0.0);
        assert_eq!(velocities.check(-0.01), Ok(()));
        assert!(matches!(velocities.check(0.01), Err(Rejection::Position(..))));
        assert!(matches!(guard(ControlMode::Current, 0.0).check(0.01), Err(Rejection::Position(..))));
    }

    /// At speed v a joint needs v²/2a to stop: the guard sees the limit that far ahead.
    #[test]
    fn velocities_are_rejected_where_the_joint_could_not_stop_before_its_limit() {
        let joint = &LWA4P.joints[0];
        let v = joint.velocity;
        let way = v * v / (2.0 * joint.acceleration);
        let at = |q| guard(ControlMode::Velocity, v, q).check(v);
        assert_eq!(at(joint.position[1] - 1.01 * way), Ok(()));
        assert!(matches!(at(joint.position[1] - 0.99 * way), Err(Rejection::Position(..))));
    }
}
