//! A model of an arm as what the next identification or verification knows.

use super::{FileError, TorqueModel};
use crate::identification::KnownModel;
use crate::identification::mounting::Mounting;
use crate::logs::log::Log;
use crate::logs::regression::{Data, RigidBody};
use dyngen::Arm;
use std::path::{Path, PathBuf};

/// A model from a file, which errors name.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    /// The model.
    pub model: TorqueModel,
    /// Its file.
    pub file: PathBuf,
}

impl ModelFile {
    /// Reads `model.json` or `identified.json`.
    ///
    /// # Errors
    /// As [`TorqueModel::read`].
    pub fn read(file: &Path) -> Result<ModelFile, FileError> {
        Ok(ModelFile { model: TorqueModel::read(file)?, file: file.to_path_buf() })
    }

    /// The model with its parameters and joints in the order of a body's.
    ///
    /// # Errors
    /// As [`TorqueModel::checked`].
    pub fn checked(self, body: &RigidBody) -> Result<TorqueModel, FileError> {
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

    fn in_set_of(&self, body: &RigidBody) -> Result<Box<dyn KnownModel>, String> {
        let model = self.clone().checked(body).map_err(|e| e.to_string())?;
        Ok(Box::new(ModelFile { model, file: self.file.clone() }))
    }

    fn take_out(&self, body: &RigidBody, logs: &mut [Log]) {
        self.model.take_out(body, logs);
    }

    fn residual(&self, body: &RigidBody, data: &Data<'_>) -> Vec<Vec<f64>> {
        self.model.residual(body, data, &[])
    }
}
