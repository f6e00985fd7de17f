//! The transmission between two torques of one log: of a joint's motor, and on its link's side.
//!
//! Where a log holds both, their difference is the gear: ratio, rotor and friction, without any rigid model.
//! By joint, in the band and with phases of rest left out as everywhere,
//!
//! motor = k·(τ + Iₘ·q̈ + F_v·q̇ + F_c·tanh(q̇/γ) + offset),
//!
//! with k in the motor's unit per N·m at the link: sign, ratio and constant in one. Effects are then looked
//! for on each joint by itself.
//!
//! | | |
//! |---|---|
//! | `result` | the result, and its words |
//! | `products` | logs on even grids; the signals that a motor's torque is compared with, and their products by block |
//! | `fit` | ratio and friction from products; standard errors |
//! | `search` | what a transmission may hold beside friction and rotor, and which of it is there, judged on logs that took no part in a fit |

mod fit;
mod products;
mod result;
mod search;

pub use result::{JointTransmission, Transmission, Unknown};
pub use search::{Figures, TransmissionEffect};

use crate::controller::JointNumber;
use crate::logs::log::{Log, logs_of_motors};
use crate::logs::parallel;
use crate::logs::regression::inactive_joints;
use dyngen::Arm;
use dyngen::arm::JointKind;
use products::Grid;

/// The transmission of each joint from the logs that hold both torques, judged on those of `validate`;
/// without them parts of the logs judge each other. `None` where no log holds the motors' torques.
///
/// Nothing fails: of a joint whose transmission the logs do not tell it is said why.
#[must_use]
pub fn transmission<'l>(
    arm: &Arm,
    logs: impl IntoIterator<Item = &'l Log>,
    validate: impl IntoIterator<Item = &'l Log>,
) -> Option<Vec<JointTransmission>> {
    let has_both = |log: &&Log| log.motor.is_some();
    let mut all: Vec<Log> = logs.into_iter().filter(has_both).cloned().collect();
    let fitted = all.len();
    all.extend(validate.into_iter().filter(has_both).cloned());
    if all.is_empty() {
        return None;
    }
    // Where only logs to judge on hold both, these are fitted.
    let fitted = if fitted == 0 { all.len() } else { fitted };
    // Beside a motor's torque stands what its gear gives, which where joints are coupled is not one joint's.
    let grid = Grid::new(&logs_of_motors(arm, &all), fitted);
    let inactive = inactive_joints(arm, &all);
    let joints: Vec<usize> = (0..arm.dof()).collect();
    Some(parallel::map(&joints, |&j| {
        let joint = JointNumber::from_index(j);
        let found = match (&inactive[j], &grid) {
            (Some(why), _) => Err(why.clone()),
            (None, Err(why)) => Err(why.clone()),
            (None, Ok(grid)) => of_joint(arm, grid, joint),
        };
        match found {
            Ok(result) => JointTransmission::Known(result),
            Err(why_not) => JointTransmission::Unknown(Unknown { joint, why_not }),
        }
    }))
}

/// A joint's transmission, or why it is not told.
fn of_joint(arm: &Arm, grid: &Grid, joint: JointNumber) -> Result<Transmission, String> {
    let (evidence, scales) = products::evidence(arm, grid, joint)?;
    let base = search::base(&evidence, joint)?;
    let unit = if arm.joints[joint.index()].kind == JointKind::Prismatic { "N" } else { "N·m" };
    let found = search::search(&evidence);
    Ok(search::tell(&evidence, &scales, (joint, unit), &base, &found))
}

#[cfg(test)]
#[cfg(feature = "virtual-arm")]
mod tests;
