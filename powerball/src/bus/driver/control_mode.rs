//! How the joints are commanded.

use core::fmt;

/// How the joints are commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ControlMode {
    /// Profile position: the drive plans the way to a target (rad).
    ProfilePosition,
    /// Velocity (rad/s).
    Velocity,
    /// Interpolated position: one point (rad) each SYNC.
    InterpolatedPosition,
    /// Current (A).
    Current,
}

impl ControlMode {
    /// All of them.
    pub const ALL: [ControlMode; 4] = [
        ControlMode::ProfilePosition,
        ControlMode::Velocity,
        ControlMode::InterpolatedPosition,
        ControlMode::Current,
    ];

    /// Whether set-points are positions.
    pub const fn is_position(self) -> bool {
        matches!(self, ControlMode::ProfilePosition | ControlMode::InterpolatedPosition)
    }
}

impl fmt::Display for ControlMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ControlMode::ProfilePosition => "profile position",
            ControlMode::Velocity => "velocity",
            ControlMode::InterpolatedPosition => "interpolated position",
            ControlMode::Current => "current",
        })
    }
}
