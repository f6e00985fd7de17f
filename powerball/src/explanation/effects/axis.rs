//! The signal that an effect depends on: the horizontal axis of the plot that shows it.

use crate::controller::JointNumber;

/// What a residual is to be drawn over to see an effect on a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// A joint's position.
    Position(JointNumber),
    /// The place within a cycle of the joint's own position, with so many cycles a turn.
    Cycle(f64),
    /// A joint's velocity.
    Velocity(JointNumber),
    /// The torque that the rigid arm asks of the joint.
    Torque,
    /// Its size, where the residual is taken against the direction of motion.
    Load,
    /// How far the joint has come since it turned back, up to several times this way, rad or m; the residual
    /// is taken against the direction of motion.
    Travel(f64),
    /// How fast the rigid arm's torque changes.
    TorqueRate,
    /// Running time; the residual is taken against the direction of motion.
    Warmth,
    /// Time.
    Time,
    /// What the effect itself adds: for those that depend on many signals at once.
    Law,
}
