//! From logs to the base model that the search begins with.

use super::named::Spreads;
use super::special::{Clock, Held, held_in_validation, repeats, settle};
use super::study::Study;
use crate::explanation::options::{ExplainError, ExplainOptions};
use crate::identification::estimate::{Fit, Folds, fit, spread};
use crate::logs::log::Log;
use crate::logs::regression::{Data, RigidBody};

/// Whose inertial parameters are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inertia {
    /// Those of one multibody model, to all joints together: the joint fit.
    Shared,
    /// Those of each joint by itself: the per-joint fit.
    PerJoint,
}

/// What is known before anything is looked for.
pub(super) struct Begun<'a> {
    pub(super) study: Study<'a>,
    /// The base model.
    pub(super) base: Fit,
    pub(super) beforehand: Beforehand,
}

/// What the result says of the time before the search.
pub(super) struct Beforehand {
    /// Errors of the base model.
    pub(super) errors: Spreads,
    /// What the base model leaves on the validation set, by joint and row, N·m.
    pub(super) residual: Vec<Vec<f64>>,
    /// What is in logs of the validation set only; its torque is taken out of them.
    pub(super) held: Option<Held>,
    /// When the logs are taken to have been recorded.
    pub(super) clock: Clock,
}

/// Prepares the logs and fits the base model.
pub(super) fn prepare<'a>(
    body: &'a RigidBody,
    (logs, validate): (&[Log], &[Log]),
    options: &'a ExplainOptions<'a>,
    inertia: Inertia,
) -> Result<Begun<'a>, ExplainError> {
    let rule = &options.rule;
    let mut data = Data::new(body, logs, &options.data).map_err(ExplainError::Fit)?;
    let mut validation = Data::new(body, validate, &options.data).map_err(ExplainError::Validate)?;
    data.take_apart(inertia == Inertia::PerJoint);
    validation.take_apart(inertia == Inertia::PerJoint);
    options.progress.say("fitting the base model");
    let folds = Folds::new(&data);
    let base = fit(&data, &folds, &[], None);
    let residual = base.residual_on(&validation, &[]);
    let errors = Spreads { fit: spread(&data, &base.residual), validate: spread(&validation, &residual) };
    let held = match inertia {
        Inertia::PerJoint => None,
        Inertia::Shared => held_in_validation(body, (logs, validate), options, &base, &mut validation)
            .map_err(ExplainError::Validate)?,
    };
    let one_path = repeats(rule, &data, &validation);
    let clock = settle(rule, logs, validate, &mut data, &base, &mut validation);
    let study = Study { data, validation, folds, one_path, options };
    Ok(Begun { study, base, beforehand: Beforehand { errors, residual, held, clock } })
}
