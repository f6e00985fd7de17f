//! What is told of a transmission: the `transmission` of identified.json and explained.json.

use super::search::TransmissionEffect;
use crate::controller::JointNumber;
use serde::Serialize;

/// What the logs say of a joint's transmission.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum JointTransmission {
    /// It is known.
    Known(Transmission),
    /// These logs do not tell it.
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
    /// The same with the effects.
    pub left_with: f64,
    /// What was found beside friction and rotor, in the order in which it was found. Ratio, friction and
    /// rotor are those beside these.
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

    /// What is told, in a line.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            JointTransmission::Known(result) => result.sentence(),
            JointTransmission::Unknown(Unknown { joint, why_not }) => {
                format!("transmission of joint {joint}: not told: {why_not}")
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
