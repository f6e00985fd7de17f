//! From logs to the base model that the search begins with.
//!
//! [`Prepared`] is the model that the search begins with.

use super::model::Model;
use super::named::FitErrors;
use super::search::CrossValidation;
use super::special::{Baseline, Clock, ValidationOnlyEffect, choose_clock, repeats, validation_only_effects};
use super::study::Study;
use crate::effects::Made;
use crate::options::{ExplainError, ExplainOptions};
use powerball_identification::estimate::{Fit, Folds, bands_of_logs, fit, residual_stats};
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, RigidArm, Signals};
use powerball_logs::summary::BANDS;

/// Whose inertial parameters are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inertia {
    /// The parameters of one multibody model, fitted to all joints together: the joint fit.
    Shared,
    /// The parameters of each joint by itself: the per-joint fit.
    PerJoint,
}

/// Whether what is in logs of the validation set only is looked for, and taken out of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ValidationOnly {
    /// It is.
    TakenOut,
    /// The validation set is used as logged.
    Kept,
}

/// The data and the model before the search.
pub(super) struct Prepared<'a> {
    pub(super) study: Study<'a>,
    /// The base model.
    pub(super) base: Fit,
    pub(super) initial_fit: InitialFit,
}

/// The report on the fit before the search.
pub(super) struct InitialFit {
    /// Errors of the base model.
    pub(super) errors: FitErrors,
    /// Residual of the base model on the validation set, by joint and row, N·m.
    pub(super) residual: Signals,
    /// Effects in logs of the validation set only; their torque is removed from these logs.
    pub(super) validation_only: Vec<ValidationOnlyEffect>,
    /// When the logs are taken to have been recorded.
    pub(super) clock: Clock,
}

/// Prepares the logs and fits the base model.
pub(super) fn prepare<'a>(
    body: &'a RigidArm,
    (logs, validate): (&[Log], &[Log]),
    options: &'a ExplainOptions<'a>,
    inertia: Inertia,
    validation_only: ValidationOnly,
) -> Result<Prepared<'a>, ExplainError> {
    let rule = &options.rule;
    let (mut data, mut validation) = in_own_bands(body, (logs, validate), options)?;
    if inertia == Inertia::PerJoint {
        (data, validation) = (data.per_joint_fit(), validation.per_joint_fit());
    }
    options.progress.say("fitting the base model");
    let folds = Folds::new(&data);
    let base = fit(&data, &folds, &[], None);
    let residual = base.residual_on(&validation, &[]);
    let errors = FitErrors {
        fit: residual_stats(&data, &base.residual),
        validate: residual_stats(&validation, &residual),
    };
    let baseline = Baseline { data, validation, base };
    let (Baseline { data, validation, base }, found) = match (inertia, validation_only) {
        (Inertia::PerJoint, _) | (_, ValidationOnly::Kept) => (baseline, Vec::new()),
        (Inertia::Shared, ValidationOnly::TakenOut) => {
            validation_only_effects(body, (logs, validate), options, baseline)
                .map_err(ExplainError::Validate)?
        }
    };
    let one_path = repeats(rule, &data, &validation);
    let (clock, sets) = choose_clock(rule, logs, validate, &base, (&data, &validation));
    let [data, validation] = sets.unwrap_or([data, validation]);
    let [made, made_on_validation] = [Made::default(), Made::default()];
    let study = Study { data, made, validation, made_on_validation, folds, one_path, options };
    Ok(Prepared { study, base, initial_fit: InitialFit { errors, residual, validation_only: found, clock } })
}

/// The logs as rows, each joint in the band in which they speak of it ([`bands_of_logs`]).
fn in_own_bands<'a>(
    body: &'a RigidArm,
    (logs, validate): (&[Log], &[Log]),
    options: &ExplainOptions<'_>,
) -> Result<(Data<'a>, Data<'a>), ExplainError> {
    let data = Data::new(body, logs, &options.data).map_err(ExplainError::Fit)?;
    let validation = Data::new(body, validate, &options.data).map_err(ExplainError::Validate)?;
    if options.data.cutoff != BANDS[0] {
        return Ok((data, validation));
    }
    let fit = fit(&data, &Folds::new(&data), &[], None);
    let left = residual_stats(&data, &fit.residual).relative;
    let mut which = bands_of_logs(body, logs, &options.data, &left);
    if which.iter().all(|band| *band == 0) {
        return Ok((data, validation));
    }
    let narrower = |logs: &[Log]| -> Option<Vec<Data<'a>>> {
        let bands = Data::in_bands(body, logs, &options.data, BANDS.len(), |_| {}).ok()?;
        Some(bands.into_iter().skip(1).map_while(Result::ok).collect())
    };
    let (Some(fitted), Some(judged)) = (narrower(logs), narrower(validate)) else {
        return Ok((data, validation));
    };
    // What is too short for a narrower band stays in the wider one.
    let enough =
        |j: usize, k: usize| fitted[k - 1].joints[j].len() >= LEAST && judged[k - 1].joints[j].len() >= LEAST;
    let most = fitted.len().min(judged.len());
    for (j, band) in which.iter_mut().enumerate() {
        *band = (*band).min(most);
        while *band > 0 && !enough(j, *band) {
            *band -= 1;
        }
    }
    let block = options.data.block;
    Ok((data.with_narrower(&fitted, &which, block), validation.with_narrower(&judged, &which, block)))
}

/// Rows of a joint in a narrower band, at least.
const LEAST: usize = 50;

// The model that the search begins with.

/// The base model with the effects that every arm may have, if this one shows them clearly (see
/// [`Effect::baseline`](crate::effects::Effect::baseline)): every effect is then judged together with them.
pub(super) fn initial_model<'a>(base: Fit, study: &Study<'a>) -> Model {
    let plain = Model::new(base);
    // Per-joint fits have an offset already.
    if study.data.per_joint {
        return plain;
    }
    let with = plain.baseline(study);
    if is_plainly_better(&with, &plain, study) { with } else { plain }
}

/// Whether several joints are predicted much better than by another model, on logs that took no part in the
/// fit, both ways round.
fn is_plainly_better(model: &Model, other: &Model, study: &Study<'_>) -> bool {
    let errors = |model: &Model| {
        let back = CrossValidation::new(study, model, None);
        [model.residual_on_validation(study).squares(), back.residual().squares()]
    };
    let ([ours, back], [theirs, their_back]) = (errors(model), errors(other));
    let moving: Vec<usize> = (0..study.data.dof()).filter(|j| theirs[*j] > 0.0).collect();
    let least = 1.0 - study.rule().large_gain();
    let better = |j: &&usize| ours[**j] < least * theirs[**j] && back[**j] < least * their_back[**j];
    // One joint of several is treated like any other effect.
    moving.iter().filter(better).count() >= moving.len().clamp(1, 2)
}
