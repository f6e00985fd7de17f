//! The base model along logs: the rigid arm in its minimal set and the friction of Eq. 16, nothing else.

use super::estimates::{JointFriction, ParameterEstimate};
use crate::controller::friction::TanhFriction;
use crate::logs::parallel;
use crate::logs::regression::{Data, Recording, RigidArm};
use dyngen::{SetKind, Values};

/// What an identification finds: τ = rigid(q, q̇, q̈) + Eq. 16 friction.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseModel {
    /// The arm's name.
    pub arm: String,
    /// The minimal set's values, SI units.
    pub parameters: Vec<ParameterEstimate>,
    /// Eq. 16 by joint.
    pub friction: Vec<JointFriction>,
}

impl BaseModel {
    /// The model in the minimal set of a body, whose parameters its own determine. As it is where they do
    /// not.
    #[must_use]
    pub fn in_set_of(mut self, body: &RigidArm) -> BaseModel {
        if let Some(parameters) = in_set_of(&self.parameters, &self.arm, body) {
            self.parameters = parameters;
        }
        self
    }

    /// Measured less predicted torque, by joint and row, N·m.
    #[must_use]
    pub fn residual(&self, body: &RigidArm, data: &Data<'_>) -> Vec<Vec<f64>> {
        data.residual(&parallel::map(&data.recordings, |recording| self.torque(body, recording)))
    }

    /// The torque along one recording, n a sample, N·m.
    fn torque(&self, body: &RigidArm, recording: &Recording) -> Vec<f64> {
        let parameters: Vec<f64> = self.parameters.iter().map(|p| p.value).collect();
        let mut torque = body.torque(&recording.q, &recording.v, &recording.a, &parameters);
        let law = |f: &JointFriction| (TanhFriction::new(f.gamma()), f.offset.unwrap_or(0.0));
        let laws: Vec<(TanhFriction<f64>, f64)> = self.friction.iter().map(law).collect();
        for (row, velocities) in
            torque.chunks_exact_mut(recording.dof).zip(recording.v.chunks_exact(recording.dof))
        {
            for ((torque, velocity), (law, offset)) in row.iter_mut().zip(velocities).zip(&laws) {
                *torque += law.torque(*velocity);
                *torque += offset;
            }
        }
        torque
    }
}

/// Parameters in the minimal set of a body, which they determine: those that logs of several mountings
/// determine together, say. Errors of converted values are not known. `None` where nothing is to be
/// converted, or cannot be.
#[must_use]
pub(crate) fn in_set_of(
    parameters: &[ParameterEstimate],
    arm: &str,
    body: &RigidArm,
) -> Option<Vec<ParameterEstimate>> {
    let names = body.names();
    if names.iter().all(|name| parameters.iter().any(|p| p.name == *name)) {
        return None;
    }
    let values = Values::named(parameters.iter().map(|p| (p.name.as_str(), p.value)), arm);
    let model = body.model();
    let values = values.of_set(model, model.set(SetKind::Minimal).ok()?).ok()?;
    let plain = |(name, value): (&String, f64)| ParameterEstimate::plain(name, value);
    Some(names.iter().zip(values).map(plain).collect())
}
