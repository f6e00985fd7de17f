//! Corrects published values to those of a real arm.

use super::estimate::{TorqueMetric, nearest};
use dyngen::consistency;
use dyngen::{Arm, Diagnostics, Error, Model, Values};
use powerball_logs::Progress;
use serde::Serialize;
use std::collections::BTreeMap;

/// Torques nearer than this count as the same, N·m.
const SAME: f64 = 1e-3;

/// The physically consistent values nearest to given ones.
#[derive(Clone, Debug, Serialize)]
pub struct NearestArm {
    /// The arm's name.
    pub arm: String,
    /// The parameter set of the given values.
    pub set: String,
    /// Whether the given values were a real arm's already.
    pub possible: bool,
    /// Why they were not.
    pub reasons: Vec<String>,
    /// rms of the torque between both over the arm's states, by joint, N·m.
    pub distance: Vec<f64>,
    /// The given set's values, before and after.
    pub values: Vec<ValueChange>,
    /// Every parameter of the arm.
    pub parameters: BTreeMap<String, f64>,
    /// Smallest eigenvalue of each link's pseudo-inertia.
    pub eigenvalues: Vec<f64>,
    /// Links, from 1, whose declared symmetries no body can have.
    pub without_body: Vec<usize>,
}

/// A value of the given set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValueChange {
    /// The parameter.
    pub name: String,
    /// The given value.
    pub given: f64,
    /// The value that a real arm can have.
    pub consistent: f64,
}

/// Why no values were found.
#[derive(Debug, thiserror::Error)]
pub enum NearestError {
    /// The values are of no parameter set of the arm.
    #[error("{0}")]
    Values(Diagnostics),
    /// The arm's model, or the search.
    #[error("{0}")]
    Model(Error),
}

impl From<Error> for NearestError {
    fn from(e: Error) -> Self {
        NearestError::Model(e)
    }
}

/// Finds the real arm whose torques come nearest to those of given values, over states within the arm's
/// limits.
///
/// # Errors
/// [`NearestError`]: values of another arm, or an arm that cannot be derived.
pub fn nearest_arm(arm: &Arm, values: &Values, progress: Progress<'_>) -> Result<NearestArm, NearestError> {
    progress.say("deriving the arm");
    arm.without_mimics().map_err(dyngen::Error::Mimics)?;
    let model = Model::derive(arm.clone())?;
    let (kind, given) = values.recognise(&model).map_err(NearestError::Values)?;
    let verdict = consistency::check(&model, kind, &given)?;
    progress.say("looking for the nearest real arm");
    let metric = TorqueMetric::new(&model, kind)?;
    let consistent = nearest(&model, kind, &given, &metric.matrix(SAME))?;
    let difference: Vec<f64> = consistent.set.iter().zip(&given).map(|(a, b)| a - b).collect();
    let change = |(name, (given, consistent)): (String, (&f64, &f64))| ValueChange {
        name,
        given: *given,
        consistent: *consistent,
    };
    let kept = model.arm().kept_parameters();
    Ok(NearestArm {
        arm: model.arm().name.clone(),
        set: kind.to_string(),
        possible: verdict.possible,
        reasons: verdict.reasons,
        distance: metric.rms(&difference),
        values: model
            .set(kind)?
            .names()
            .into_iter()
            .zip(given.iter().zip(&consistent.set))
            .map(change)
            .collect(),
        parameters: kept.iter().map(|p| (p.to_string(), consistent.all[p.index()])).collect(),
        eigenvalues: consistent.eigenvalues,
        without_body: consistent.without_body.iter().map(|l| l + 1).collect(),
    })
}
