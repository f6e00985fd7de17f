//! From the accepted effects to a model of the arm, and what that model leaves.

use super::forward::{ExplainError, Session};
use super::result::NamedEffect;
use crate::controller::correction::Term;
use crate::explanation::effects::{Context, Part, Window, payload};
use crate::explanation::torque_model::{Additions, ArmChanges, LogChanges, NamedTerm, Payload, TorqueModel};
use crate::identification::estimate::{JointFriction, ParameterEstimate};
use crate::logs::regression::{Data, RigidBody};
use dyngen::SetKind;
use dyngen::arm::Parameter;

/// What is no part of the model but in some logs.
#[derive(Default)]
struct InLogs {
    /// When the fitted logs have the payload, and when the other ones.
    held: [Vec<Window>; 2],
    /// Accepted effects that are events.
    events: Vec<usize>,
}

/// A model and what it leaves, by joint and row, N·m.
pub(super) struct Composed {
    pub(super) model: TorqueModel,
    /// On the fitted logs.
    pub(super) fitted: Vec<Vec<f64>>,
    /// On the other path.
    pub(super) held_out: Vec<Vec<f64>>,
}

impl Session<'_> {
    /// The model, and what it leaves on the fitted logs and on the other path.
    ///
    /// The residuals are those of the whole model put together, not of the sum of columns that it was fitted
    /// with: what is reported is what a controller computes. They differ by products of small effects.
    pub(super) fn composed(&self) -> Result<Composed, ExplainError> {
        let wrong = |e: &dyn std::fmt::Display| ExplainError::Arm(e.to_string());
        let body = self.data.body;
        let mut not_zero: Vec<(Parameter, f64)> = Vec::new();
        let (additions, in_logs) = self.parts(&mut not_zero);
        let mut model = TorqueModel {
            arm: body.arm().name.clone(),
            set: SetKind::Minimal.to_string(),
            parameters: plain(body, self.fit.inertial()),
            friction: (0..body.dof()).map(|j| JointFriction::plain(j, self.fit.friction(j))).collect(),
            additions,
        };
        let changed = match model.additions.arm_changes == ArmChanges::default() {
            true => None,
            false => {
                let arm = model.additions.arm_changes.of(body.arm()).map_err(|e| wrong(&e))?;
                Some(RigidBody::new(&arm).map_err(|e| wrong(&e))?)
            }
        };
        // Another gravity alone can make the minimal set another.
        if let Some(changed) = &changed {
            model.parameters = moved(body, changed, self.fit.inertial(), &not_zero);
        }
        let arm = changed.as_ref().unwrap_or(body);
        let none: Vec<Vec<f64>> = vec![Vec::new(); body.dof()];
        let of = |data: &Data<'_>, held: &[Window]| {
            let mut residual = model.residual(arm, data, held);
            self.take_out(&in_logs.events, &Context::new(data, &self.fit, &none), &mut residual);
            residual
        };
        let (fitted, held_out) = (of(&self.data, &in_logs.held[0]), of(&self.other, &in_logs.held[1]));
        Ok(Composed { model, fitted, held_out })
    }

    /// The accepted effects, each as what it is in a model.
    fn parts(&self, not_zero: &mut Vec<(Parameter, f64)>) -> (Additions, InLogs) {
        let context = Context::new(&self.data, &self.fit, &self.fit.residual);
        let none: Vec<Vec<f64>> = vec![Vec::new(); self.other.dof()];
        let other = Context::new(&self.other, &self.fit, &none);
        let n = self.data.dof();
        let (mut offset, mut delay) = (vec![0.0; n], vec![0.0; n]);
        let (mut additions, mut in_logs) = (Additions::default(), InLogs::default());
        additions.payloads.extend(self.held.as_ref().and_then(held_payload));
        for (k, (a, coefficients)) in self.accepted.iter().zip(self.coefficients()).enumerate() {
            let effect = self.effects[a.effect].as_ref();
            match effect.part(&context, &a.candidate, &coefficients) {
                Part::Laws => {
                    let joint = a.candidate.joints[0];
                    let laws = effect.laws(&context, &a.candidate).into_iter().zip(coefficients);
                    additions.terms.extend(laws.map(|(law, coefficient)| NamedTerm {
                        effect: effect.name().to_string(),
                        term: Term { joint, coefficient, law },
                    }));
                }
                Part::Parameter(parameter, value) => {
                    additions.arm_changes.not_zero.push(parameter.to_string());
                    not_zero.push((parameter, value));
                }
                Part::Gravity(gravity, gained) => {
                    additions.arm_changes.gravity = Some(gravity);
                    not_zero.extend(self.data.body.arm().all_parameters().into_iter().zip(gained));
                }
                Part::Payload(mass, com) => {
                    let windows = &a.candidate.windows;
                    additions.payloads.push(Payload {
                        mass,
                        com,
                        logs: windows.iter().map(|w| w.log.clone()).collect(),
                        start_time: windows.iter().map(|w| w.from).collect(),
                    });
                    in_logs.held = [&context, &other].map(|c| payload::followed(c, &a.candidate));
                }
                Part::EncoderOffset(o) => a.candidate.joints.iter().for_each(|j| offset[*j] += o),
                Part::Delay(d) => a.candidate.joints.iter().for_each(|j| delay[*j] += d),
                Part::Event => in_logs.events.push(k),
            }
        }
        for (j, offset) in offset.iter().enumerate().filter(|(_, o)| **o != 0.0) {
            additions.put_zero_right(j, *offset);
        }
        let given = |list: Vec<f64>| if list.iter().any(|x| *x != 0.0) { list } else { Vec::new() };
        additions.log_changes = LogChanges { encoder_offset: given(offset), delay: given(delay) };
        (additions, in_logs)
    }

    /// Takes the torque of some accepted effects out of residuals.
    fn take_out(&self, which: &[usize], context: &Context<'_>, residual: &mut [Vec<f64>]) {
        let coefficients = self.coefficients();
        for k in which {
            let a = &self.accepted[*k];
            let columns = self.effects[a.effect].columns(context, &a.candidate);
            columns.iter().zip(&coefficients[*k]).for_each(|(column, c)| column.add_to(residual, -c));
        }
    }
}

/// The payload that only logs of the other path have; it was taken out of them.
fn held_payload(held: &NamedEffect) -> Option<Payload> {
    let number = |v: &serde_json::Value| v.as_f64();
    let list =
        |key: &str| Some(held.parameters[key].as_array()?.iter().filter_map(number).collect::<Vec<f64>>());
    Some(Payload {
        mass: number(&held.parameters["mass"])?,
        com: list("com")?.try_into().ok()?,
        logs: held.logs.clone(),
        start_time: list("start_time")?,
    })
}

/// The values of a changed arm's minimal set that move as those of the arm do with what is not zero.
fn moved(
    body: &RigidBody,
    changed: &RigidBody,
    inertial: &[f64],
    not_zero: &[(Parameter, f64)],
) -> Vec<ParameterEstimate> {
    let mut all = body.carried(inertial);
    for (parameter, value) in not_zero {
        all[parameter.index()] += value;
    }
    let Ok(set) = changed.model().set(SetKind::Minimal) else { return Vec::new() };
    plain(changed, &changed.model().set_values(set, &all))
}

/// Values of an arm's minimal set by name.
fn plain(body: &RigidBody, values: &[f64]) -> Vec<ParameterEstimate> {
    body.names().iter().zip(values).map(|(name, value)| ParameterEstimate::plain(name, *value)).collect()
}
