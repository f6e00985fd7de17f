//! The transmission between two torques of one log: that of a joint's motor, and that on its link's side.
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
//! | `products` | logs on even grids; the signals that a motor's torque is compared with, and their products by block |
//! | `fit` | ratio and friction from products; standard errors |
//! | `search` | effects of a transmission beyond friction and rotor, judged on logs that were not fitted |

mod fit;
mod products;
mod search;

use dyngen::Arm;
use dyngen::arm::JointKind;
use powerball_controller::JointNumber;
use powerball_logs::log::{Log, logs_of_motors};
use powerball_logs::parallel;
use powerball_logs::regression::inactive_joints;
use products::Grid;
pub use search::{Figures, TransmissionEffect};
use serde::Serialize;

/// The transmission of each joint from the logs that hold both torques, judged on those of `validate`;
/// without them parts of the logs judge each other. `None` where no log holds the motors' torques.
///
/// Nothing fails: for a joint whose transmission the logs do not determine the reason is given.
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
    // A motor's torque is compared with what its gear gives, which where joints are coupled is not one
    // joint's.
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

/// A joint's transmission, or why it is not determined.
fn of_joint(arm: &Arm, grid: &Grid, joint: JointNumber) -> Result<Transmission, String> {
    let (evidence, scales) = products::evidence(arm, grid, joint)?;
    let base = search::base(&evidence, joint)?;
    let unit = if arm.joints[joint.index()].kind == JointKind::Prismatic { "N" } else { "N·m" };
    let found = search::search(&evidence);
    Ok(search::tell(&evidence, &scales, (joint, unit), &base, &found))
}

// The result, and its words: the `transmission` of identified.json and explained.json.

/// The result about a joint's transmission.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum JointTransmission {
    /// The logs determine the transmission.
    Known(Transmission),
    /// These logs do not determine the transmission.
    Unknown(Unknown),
}

/// A transmission that logs do not tell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unknown {
    /// The joint.
    pub joint: JointNumber,
    /// Why, in words.
    pub why_not: String,
}

/// A joint's transmission, everything on the link's side of the gear (N and m where the joint is prismatic).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Transmission {
    /// The joint.
    pub joint: JointNumber,
    /// k: the motor's unit per N·m at the link, with its sign.
    pub ratio: f64,
    /// The standard error of k.
    pub std: f64,
    /// Unit of torques at the link: "N·m", or "N" where the joint is prismatic.
    pub unit: &'static str,
    /// F_v, N·m·s/rad.
    pub viscous: f64,
    /// F_c, N·m.
    pub coulomb: f64,
    /// γ: the velocity at which Coulomb friction is at three quarters, rad/s.
    pub width: f64,
    /// Iₘ: inertia of rotor and gear at the link, kg·m².
    pub rotor_inertia: f64,
    /// The difference of the zeros of the two torques, N·m at the link.
    pub offset: f64,
    /// Share of the motor torque's rms that stays on logs that were not fitted.
    pub left: f64,
    /// Share of the motor torque's rms that stays with the effects included.
    pub left_with: f64,
    /// The effects that were found in addition to friction and rotor, in this order. Ratio, friction
    /// and rotor are those fitted together with these.
    pub effects: Vec<TransmissionEffect>,
}

impl JointTransmission {
    /// The joint.
    #[must_use]
    pub fn joint(&self) -> JointNumber {
        match self {
            JointTransmission::Known(result) => result.joint,
            JointTransmission::Unknown(unknown) => unknown.joint,
        }
    }

    /// The result, in a line.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            JointTransmission::Known(result) => result.sentence(),
            JointTransmission::Unknown(Unknown { joint, why_not }) => {
                format!("transmission of joint {joint}: not determined: {why_not}")
            }
        }
    }
}

impl Transmission {
    /// The standard error of k as a share of it.
    #[must_use]
    pub fn relative_std(&self) -> f64 {
        self.std / self.ratio.abs()
    }

    fn sentence(&self) -> String {
        let Transmission { joint, ratio, unit, coulomb, viscous, left, left_with, .. } = self;
        let mut text = format!(
            "transmission of joint {joint}: motor = {ratio:.4e} (±{:.1} %) per {unit} at the link, 1/{:.1}; \
             Coulomb {coulomb:.3} {unit}, viscous {viscous:.3} {unit}·s, rotor {:.3}; {:.1} % of the motor's \
             torque left",
            100.0 * self.relative_std(),
            1.0 / ratio,
            self.rotor_inertia,
            100.0 * left
        );
        if !self.effects.is_empty() {
            let names: Vec<String> = self.effects.iter().map(TransmissionEffect::in_words).collect();
            text.push_str(&format!(", {:.1} % with {}", 100.0 * left_with, names.join(", ")));
        }
        text
    }
}

#[cfg(test)]
#[path = "../../../../tests/support/measured.rs"]
mod measured;
#[cfg(test)]
mod tests;
