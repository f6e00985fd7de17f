//! The arm of the file as a model has it.

use super::ArmChanges;
use dyngen::Arm;
use dyngen::arm::{Parameter, ParameterKind};
use dyngen::exact::rational::Rational;
use std::fmt;

/// Why an arm cannot be changed as a model says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unchanged {
    /// A name that is none of the arm's parameters.
    NoParameter(String),
    /// Gravity that is no number.
    Gravity,
}

impl fmt::Display for Unchanged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Unchanged::NoParameter(name) => {
                write!(f, "arm_changes.not_zero: '{name}' is no parameter of this arm")
            }
            Unchanged::Gravity => f.write_str("arm_changes.gravity must be three finite numbers"),
        }
    }
}

impl std::error::Error for Unchanged {}

impl ArmChanges {
    /// The arm as it is.
    ///
    /// # Errors
    /// [`Unchanged`] where the changes are another arm's.
    pub fn of(&self, arm: &Arm) -> Result<Arm, Unchanged> {
        let mut arm = arm.clone();
        if let Some(gravity) = self.gravity {
            let [x, y, z] = gravity.map(Rational::from_float);
            let (Some(x), Some(y), Some(z)) = (x, y, z) else { return Err(Unchanged::Gravity) };
            arm.gravity = [x, y, z];
        }
        for name in &self.not_zero {
            let parameter = Parameter::parse(name).filter(|p| p.link < arm.dof());
            let Parameter { link, kind } = parameter.ok_or_else(|| Unchanged::NoParameter(name.clone()))?;
            arm.joints[link].zero.retain(|zero| *zero != kind);
            // A published grouping does not know the parameter.
            arm.groupings.clear();
        }
        Ok(arm)
    }

    /// Whether the arm is as its file says.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == ArmChanges::default()
    }
}

/// The arm with nothing declared zero at its last link that a payload may fill.
#[must_use]
pub(super) fn with_open_hand(arm: &Arm) -> Arm {
    let mut arm = arm.clone();
    if let Some(last) = arm.joints.last_mut() {
        last.zero.retain(|kind| *kind == ParameterKind::Im);
    }
    arm.groupings.clear();
    arm
}
