//! A way to read the columns of a log.

use dyngen::Arm;
use dyngen::arm::JointKind;

/// What the position columns are taken to be: joint k's position is `sign[k]`·`scale` times column
/// `column[k]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Positions {
    pub(super) column: Vec<usize>,
    pub(super) sign: Vec<f64>,
    /// rad for one unit of the columns of revolute joints.
    pub(super) scale: f64,
}

impl Positions {
    pub(super) fn plain(dof: usize) -> Positions {
        Positions { column: (0..dof).collect(), sign: vec![1.0; dof], scale: 1.0 }
    }

    pub(super) fn is_plain(&self) -> bool {
        *self == Positions::plain(self.column.len())
    }

    /// What a joint's column is multiplied by.
    pub(super) fn factor(&self, arm: &Arm, joint: usize) -> f64 {
        let turns = arm.joints[joint].kind == JointKind::Revolute;
        self.sign[joint] * if turns { self.scale } else { 1.0 }
    }

    /// The column of joint `joint` the other way round.
    pub(super) fn reversed(&self, joint: usize) -> Positions {
        let mut other = self.clone();
        other.sign[joint] = -other.sign[joint];
        other
    }

    /// The columns of two joints exchanged.
    pub(super) fn exchanged(&self, a: usize, b: usize) -> Positions {
        let mut other = self.clone();
        other.column.swap(a, b);
        other.sign.swap(a, b);
        other
    }
}

/// What the torque columns are taken to be: joint k's torque at time t is `gain[k]` times column `column[k]`
/// at t + `late[k]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Torques {
    pub(super) column: Vec<usize>,
    /// With its sign.
    pub(super) gain: Vec<f64>,
    /// How late the column is, s.
    pub(super) late: Vec<f64>,
}

impl Torques {
    pub(super) fn plain(dof: usize) -> Torques {
        Torques { column: (0..dof).collect(), gain: vec![1.0; dof], late: vec![0.0; dof] }
    }

    /// The column of joint `joint` the other way round.
    pub(super) fn reversed(&self, joint: usize) -> Torques {
        let mut other = self.clone();
        other.gain[joint] = -other.gain[joint];
        other
    }

    /// The columns of two joints exchanged, with their signs.
    pub(super) fn exchanged(&self, a: usize, b: usize) -> Torques {
        let mut other = self.clone();
        other.column.swap(a, b);
        other.gain.swap(a, b);
        other.late.swap(a, b);
        other
    }

    /// Whether some column is multiplied by more than a sign.
    pub(super) fn is_scaled(&self) -> bool {
        self.gain.iter().any(|gain| gain.abs() != 1.0)
    }

    /// All columns later by `by` seconds than taken so far.
    pub(super) fn later(&self, by: f64) -> Torques {
        let late = self.late.iter().map(|late| late + by).collect();
        Torques { late, ..self.clone() }
    }
}
