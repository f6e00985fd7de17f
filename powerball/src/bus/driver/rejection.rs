//! Why a set-point does not leave.

use crate::controller::JointNumber;
use core::fmt;

/// Why a set-point was rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Joint's value is NaN or infinite.
    NotFinite(JointNumber),
    /// Joint, position (asked for, or reached before it can stop) and the limit that it would pass, rad.
    Position(JointNumber, f64, f64),
    /// Joint, velocity and greatest velocity, rad/s.
    Velocity(JointNumber, f64, f64),
    /// Joint, current and greatest current, A.
    Current(JointNumber, f64, f64),
    /// Joint, change since the last set-point and the greatest change, in the mode's unit.
    Jump(JointNumber, f64, f64),
    /// Joint, acceleration of its set-points and the greatest one, rad/s².
    Acceleration(JointNumber, f64, f64),
    /// Joint, torque that the arm's model asks for and the greatest one, N·m.
    Torque(JointNumber, f64, f64),
    /// Joint whose value the drive's type cannot hold: it would be cut.
    Saturated(JointNumber),
    /// The arm does not follow set-points now.
    NotRunning,
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Rejection::NotFinite(j) => write!(f, "joint {j}: the set-point is not a number"),
            Rejection::Position(j, q, limit) => {
                write!(f, "joint {j}: position {q:.4} rad beyond the limit {limit:.4} rad")
            }
            Rejection::Velocity(j, v, limit) => {
                write!(f, "joint {j}: {v:.4} rad/s is more than the greatest velocity {limit:.4} rad/s")
            }
            Rejection::Current(j, i, limit) => {
                write!(f, "joint {j}: {i:.3} A is more than the greatest current {limit:.3} A")
            }
            Rejection::Jump(j, step, limit) => {
                write!(f, "joint {j}: a step of {step:.5} in one cycle, {limit:.5} can be")
            }
            Rejection::Acceleration(j, a, limit) => {
                write!(f, "joint {j}: its set-points accelerate by {a:.2} rad/s², {limit:.2} rad/s² can be")
            }
            Rejection::Torque(j, torque, limit) => {
                write!(f, "joint {j}: the set-points take {torque:.1} N·m, {limit:.1} N·m can be")
            }
            Rejection::Saturated(j) => {
                write!(f, "joint {j}: the drive's number type cannot hold the set-point")
            }
            Rejection::NotRunning => f.write_str("the arm does not follow set-points now"),
        }
    }
}

impl core::error::Error for Rejection {}
