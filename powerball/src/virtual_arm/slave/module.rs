//! What a joint's module is: the facts that its drive is set up with.

use super::dictionary::Identity;
use crate::bus::canopen::{NodeId, Object};

/// A mode in which the set-point is a current. The maker's public files have none, so this is told and not
/// known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurrentMode {
    /// Its number in 0x6060.
    pub mode: i8,
    /// Where its set-point goes: i16, per mille of the rated current.
    pub target: Object,
}

/// One joint's module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Module {
    /// Its node.
    pub node: NodeId,
    /// Who it says that it is.
    pub identity: Identity,
    /// Software limits, rad.
    pub limits: [f64; 2],
    /// Greatest velocity, rad/s.
    pub velocity: f64,
    /// Greatest acceleration, rad/s².
    pub acceleration: f64,
    /// Torque at the current limit, N·m.
    pub torque: f64,
    /// Rated current, mA.
    pub rated_current: u32,
    /// Torque at the rated current, N·m; negative where the motor turns against the joint.
    pub rated_torque: f64,
    /// Whether the motor's commutation is found already.
    pub commutated: bool,
    /// A current mode, where there is one.
    pub current_mode: Option<CurrentMode>,
}
