//! An existing torque model, as identification and verification use it.

use super::estimate::BaseModel;
use super::mounting::Mounting;
use dyngen::Arm;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, RigidArm, Signals};
use std::fmt;

/// A torque model of an arm that was identified before.
pub trait KnownModel: fmt::Debug + Sync {
    /// The arm of the file as the model has it, for logs of this mounting.
    ///
    /// # Errors
    /// The reason why the model does not apply to this arm or to this mounting.
    fn arm(&self, arm: &Arm, mounting: Mounting) -> Result<Arm, String>;

    /// The model with its parameters and joints in the order of a body's.
    ///
    /// # Errors
    /// What the model lacks for this body, in words.
    fn in_set_of(&self, body: &RigidArm) -> Result<Box<dyn KnownModel>, String>;

    /// Takes out of logs what goes beyond rigid arm and Eq. 16. `body` is the arm of [`KnownModel::arm`].
    fn take_out(&self, body: &RigidArm, logs: &mut [Log]);

    /// Measured less predicted torque, by joint and row, N·m.
    fn residual(&self, body: &RigidArm, data: &Data<'_>) -> Signals;
}

/// An identified base model has no further terms: it can be judged on other logs without changes.
impl KnownModel for BaseModel {
    fn arm(&self, arm: &Arm, _: Mounting) -> Result<Arm, String> {
        Ok(arm.clone())
    }

    fn in_set_of(&self, body: &RigidArm) -> Result<Box<dyn KnownModel>, String> {
        let mut model = self.clone().in_set_of(body);
        let of_name = |name: &String| {
            let found = model.parameters.iter().find(|p| p.name == *name).cloned();
            found.ok_or_else(|| {
                format!(
                    "has no value for the parameter {name}: it was identified for another arm file, or in \
                        mountings that do not determine it"
                )
            })
        };
        let of_joint = |joint: usize| {
            let found = model.friction.iter().find(|f| f.joint == joint).cloned();
            found.ok_or_else(|| format!("has no friction for joint {joint}"))
        };
        let parameters = body.names().iter().map(of_name).collect::<Result<_, _>>()?;
        let friction = (1..=body.dof()).map(of_joint).collect::<Result<_, _>>()?;
        (model.parameters, model.friction) = (parameters, friction);
        Ok(Box::new(model))
    }

    fn take_out(&self, _: &RigidArm, _: &mut [Log]) {}

    fn residual(&self, body: &RigidArm, data: &Data<'_>) -> Signals {
        BaseModel::residual(self, body, data)
    }
}
