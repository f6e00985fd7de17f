//! A model together with its arm, for control laws and simulations.

use super::{ModelFile, TorqueModel};
use dyngen::Arm;
use powerball_identification::mounting::Mounting;
use powerball_identification::{KnownModel, NumericArm};
use powerball_logs::regression::RigidArm;

/// A model of an arm of `N` joints.
#[derive(Debug)]
pub struct ModelOnArm<const N: usize> {
    /// The arm with the model's changes.
    pub body: RigidArm,
    /// The model.
    pub model: TorqueModel,
    /// The rigid arm with its payload, for control laws.
    pub numeric: NumericArm<N>,
}

impl<const N: usize> ModelOnArm<N> {
    /// A model of the arm of a file, with its effects or without.
    ///
    /// # Errors
    /// In words: a model of another arm or of another number of joints, an arm whose motors turn with several
    /// joints.
    pub fn new(arm: &Arm, read: &ModelFile, effects: bool) -> Result<Self, String> {
        let (named, name) = (&read.model.arm, read.file.display());
        if !named.is_empty() && *named != arm.name {
            return Err(format!(
                "{name}: is a model of the arm '{named}', and the arm file is of '{}': take the arm file \
                    that it was identified with",
                arm.name
            ));
        }
        if !arm.transmissions.is_empty() {
            let what = "the arm file couples joints by a transmission, which the control laws here do not \
                support";
            return Err(what.to_string());
        }
        let arm = read.arm(arm, Mounting::Filed)?;
        let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
        let model = read.clone().checked(&body).map_err(|e| e.to_string())?;
        let model = if effects { model } else { model.base() };
        let numeric = model.numeric_arm(&body).map_err(|e| e.to_string())?;
        let numeric = numeric.ok_or_else(|| format!("{name}: does not fit the arm file"))?;
        Ok(ModelOnArm { body, model, numeric })
    }
}
