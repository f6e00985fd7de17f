//! The model of the arm with the accepted effects, and its residual.

use super::super::model::Model;
use super::super::special::ValidationOnlyEffect;
use super::super::study::Study;
use crate::effects::{Context, Part, Window};
use crate::options::ExplainError;
use crate::torque_model::{Additions, ArmChanges, LogChanges, NamedTerm, Payload, TorqueModel};
use dyngen::SetKind;
use dyngen::arm::Parameter;
use powerball_controller::JointNumber;
use powerball_controller::correction::Term;
use powerball_identification::estimate::{JointFriction, ParameterEstimate, fit};
use powerball_logs::regression::{Data, RigidArm, Signals};

/// A model and its residual, by joint and row, N·m.
pub(crate) struct Composed {
    pub(crate) model: TorqueModel,
    /// The arm, where the model changes it.
    pub(crate) arm: Option<RigidArm>,
    /// When the fitted logs have the payload, and when the validation set.
    pub(crate) held: [Vec<Window>; 2],
    /// On the fitted logs.
    pub(crate) fitted: Signals,
    /// On the validation set.
    pub(crate) held_out: Signals,
}

/// The parts of a model from the accepted effects.
#[derive(Default)]
struct Parts {
    /// In a model of the arm.
    additions: Additions,
    /// Additions to the arm's parameters that were assumed zero or that gravity did not show.
    gained: Vec<(Parameter, f64)>,
    /// When the fitted logs have the payload, and when the validation set.
    held: [Vec<Window>; 2],
    /// The accepted effects that are events.
    events: Vec<usize>,
}

/// The model, and its residual on the fitted logs and on the validation set.
///
/// The residuals are those of the whole model put together, not of the sum of columns that it was fitted
/// with: the report is about the torque that a controller computes. They differ by products of small effects.
pub(crate) fn compose(
    study: &Study<'_>,
    found: &Model,
    validation_only: &[ValidationOnlyEffect],
) -> Result<Composed, ExplainError> {
    let body = study.data.body;
    let Parts { additions, gained, held, events } = parts(study, found, validation_only);
    let mut model = TorqueModel {
        arm: body.arm().name.clone(),
        set: SetKind::Minimal.to_string(),
        parameters: plain(body, found.fit.inertial()),
        friction: friction(found),
        joint_bands: study.data.joints.iter().map(|joint| joint.band.cutoff).collect(),
        additions,
        colour: None,
    };
    let changed = match model.additions.arm_changes == ArmChanges::default() {
        true => None,
        false => {
            let arm = model.additions.arm_changes.of(body.arm()).map_err(ExplainError::Changes)?;
            Some(RigidArm::new(&arm).map_err(ExplainError::Arm)?)
        }
    };
    // Another gravity alone can make the minimal set another.
    if let Some(changed) = &changed {
        model.parameters = moved(body, changed, found.fit.inertial(), &gained);
    }
    let arm = changed.as_ref().unwrap_or(body);
    let residual = |data: &Data<'_>, held: &[Window]| {
        let mut residual = model.residual(arm, data, held);
        take_out(found, &events, &Context::for_columns(data, &found.fit, study.rule()), &mut residual);
        residual
    };
    let (fitted, held_out) = (residual(&study.data, &held[0]), residual(&study.validation, &held[1]));
    Ok(Composed { model, arm: changed, held, fitted, held_out })
}

/// The residual of the per-joint fit, and a model of one body with the effects that it found.
pub(crate) fn compose_per_joint(study: &Study<'_>, found: &Model) -> Result<Composed, ExplainError> {
    let of_body = study.joint_fit();
    let base = fit(&of_body.data, &of_body.folds, &[], None);
    let mut shared = Model { accepted: found.accepted.clone(), ..Model::new(base) };
    shared.refit(&of_body);
    Ok(Composed {
        fitted: found.fit.residual.clone(),
        held_out: found.residual_on_validation(study),
        ..compose(&of_body, &shared, &[])?
    })
}

/// The accepted effects, each in its form in a model.
fn parts(study: &Study<'_>, found: &Model, validation_only: &[ValidationOnlyEffect]) -> Parts {
    let context = found.context(study);
    let on_validation = study.on_validation(&found.fit, &[]);
    let n = study.data.dof();
    let (mut offset, mut delay) = (vec![0.0; n], vec![0.0; n]);
    let mut parts = Parts::default();
    let of_held = validation_only.iter().flat_map(|effect| &effect.parts);
    let of_held = of_held.filter_map(|held| payload(&held.part, &held.windows));
    parts.additions.payloads.extend(of_held);
    let (errors, places) = (found.errors(), found.places());
    for (k, (a, coefficients)) in found.accepted.iter().zip(found.coefficients()).enumerate() {
        // A ripple that was measured above the band has no column.
        let error = |c: usize| errors(places[k].start + c).filter(|_| a.above_band().is_none());
        let (effect, candidate) = (a.effect(), &a.candidate);
        let add = |to: &mut [f64], by: f64| candidate.joints.iter().for_each(|j| to[j.index()] += by);
        let part = effect.part(&context, candidate, &coefficients);
        match part {
            Part::Laws => {
                let laws = effect.placed_laws(&context, candidate).into_iter().zip(coefficients);
                for (c, (laws, coefficient)) in laws.enumerate() {
                    parts.additions.terms.extend(laws.into_iter().map(|(joint, law, share)| NamedTerm {
                        effect: effect.name().to_string(),
                        std: error(c).map(|std| std * share.abs()),
                        term: Term { joint: joint.index(), coefficient: coefficient * share, law },
                    }));
                }
            }
            Part::Parameter(parameter, value) => {
                parts.additions.arm_changes.not_zero.push(parameter.to_string());
                parts.gained.push((parameter, value));
            }
            Part::Gravity(gravity, gained) => {
                parts.additions.arm_changes.gravity = Some(gravity);
                parts.gained.extend(study.data.body.arm().all_parameters().into_iter().zip(gained));
            }
            Part::Payload(..) => {
                parts.additions.payloads.extend(payload(&part, &candidate.windows));
                parts.held = [&context, &on_validation].map(|c| effect.windows(c, candidate));
            }
            Part::EncoderOffset(by) => add(&mut offset, by),
            Part::Delay(by) => add(&mut delay, by),
            Part::Event => parts.events.push(k),
        }
    }
    for (j, offset) in offset.iter().enumerate().filter(|(_, o)| **o != 0.0) {
        parts.additions.put_zero_right(JointNumber::from_index(j), *offset);
    }
    let given = |list: Vec<f64>| if list.iter().any(|x| *x != 0.0) { list } else { Vec::new() };
    parts.additions.log_changes = LogChanges { encoder_offset: given(offset), delay: given(delay) };
    parts
}

/// Eq. 16 by joint, with the errors of its levels; those of its steepnesses are not reported.
fn friction(found: &Model) -> Vec<JointFriction> {
    let (errors, layout) = (found.errors(), found.fit.design.layout);
    let of_joint = |j: usize| {
        let level = |k| errors(layout.friction(j, k));
        let std = [level(0), None, level(1), None, level(2)];
        JointFriction { std, ..JointFriction::plain(j, found.fit.friction(j)) }
    };
    (0..layout.dof).map(of_joint).collect()
}

/// A payload of a model, where a part is one.
fn payload(part: &Part, windows: &[Window]) -> Option<Payload> {
    let Part::Payload(mass, com, link) = *part else { return None };
    let logs = windows.iter().map(|w| w.log.clone()).collect();
    let start_time = windows.iter().map(|w| w.from).collect();
    Some(Payload { mass, com, link, logs, start_time, end_time: Window::ends(windows) })
}

/// Takes the torque of some accepted effects out of residuals.
fn take_out(found: &Model, which: &[usize], context: &Context<'_>, residual: &mut Signals) {
    let coefficients = found.coefficients();
    for k in which {
        let a = &found.accepted[*k];
        let columns = context.columns(&a.candidate);
        residual.subtract(&columns, &coefficients[*k]);
    }
}

/// The values of a changed arm's minimal set that move as those of the arm do with what they gain.
fn moved(
    body: &RigidArm,
    changed: &RigidArm,
    inertial: &[f64],
    gained: &[(Parameter, f64)],
) -> Vec<ParameterEstimate> {
    let mut all = body.carried(inertial);
    for (parameter, value) in gained {
        all[parameter.index()] += value;
    }
    let Ok(set) = changed.model().set(SetKind::Minimal) else { return Vec::new() };
    plain(changed, &changed.model().set_values(set, &all))
}

/// Values of an arm's minimal set by name.
fn plain(body: &RigidArm, values: &[f64]) -> Vec<ParameterEstimate> {
    body.names().iter().zip(values).map(|(name, value)| ParameterEstimate::plain(name, *value)).collect()
}
