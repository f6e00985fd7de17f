//! A model of an arm as what the next identification or verification knows.

use super::file::read_text;
use super::{FileError, TorqueModel};
use crate::identification::KnownModel;
use crate::identification::mounting::Mounting;
use crate::logs::log::Log;
use crate::logs::regression::{Data, RigidArm};
use dyngen::Arm;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A model from a file, which errors name.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    /// The model.
    pub model: TorqueModel,
    /// Its file.
    pub file: PathBuf,
    /// The end of each joint's band, Hz, where it is an identified.json.
    pub joint_bands: Vec<f64>,
}

impl ModelFile {
    /// Reads `model.json` or `identified.json`.
    ///
    /// # Errors
    /// As [`TorqueModel::read`].
    pub fn read(file: &Path) -> Result<ModelFile, FileError> {
        ModelFile::parse(&read_text(file)?, file)
    }

    /// The same from the text of a file, which `file` names in errors.
    ///
    /// # Errors
    /// As [`TorqueModel::parse`].
    pub fn parse(text: &str, file: &Path) -> Result<ModelFile, FileError> {
        let model = TorqueModel::parse(text, file)?;
        let said: Option<Value> = serde_json::from_str(text).ok();
        let bands = said.as_ref().and_then(|json| json.get("joint_bands")?.as_array());
        let bands = bands.map(|bands| bands.iter().map(|band| band.as_f64().unwrap_or(0.0)).collect());
        Ok(ModelFile { model, file: file.to_path_buf(), joint_bands: bands.unwrap_or_default() })
    }

    /// The model with its parameters and joints in the order of a body's.
    ///
    /// # Errors
    /// As [`TorqueModel::checked`].
    pub fn checked(self, body: &RigidArm) -> Result<TorqueModel, FileError> {
        self.model.in_set_of(body).checked(body.names(), body.dof(), &self.file)
    }
}

impl KnownModel for ModelFile {
    fn arm(&self, arm: &Arm, mounting: Mounting) -> Result<Arm, String> {
        let changes = &self.model.additions.arm_changes;
        if mounting != Mounting::Filed && changes.gravity.is_some() {
            return Err(format!(
                "{}: says how the base is tilted where it stands as filed, and nothing of it mounted otherwise",
                self.file.display()
            ));
        }
        changes.of(arm).map_err(|e| format!("{}: {e}", self.file.display()))
    }

    fn in_set_of(&self, body: &RigidArm) -> Result<Box<dyn KnownModel>, String> {
        let model = self.clone().checked(body).map_err(|e| e.to_string())?;
        Ok(Box::new(ModelFile { model, ..self.clone() }))
    }

    fn take_out(&self, body: &RigidArm, logs: &mut [Log]) {
        self.model.take_out(body, logs);
    }

    fn residual(&self, body: &RigidArm, data: &Data<'_>) -> Vec<Vec<f64>> {
        self.model.residual(body, data, &[])
    }
}
