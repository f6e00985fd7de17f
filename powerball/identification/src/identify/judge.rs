//! What a model leaves of the validation set, each joint in the band in which it was fitted.
//!
//! The file also has what one set of parameters leaves of the logs of each mounting; whether friction that
//! differs with the direction is what a poor fit lacks; logs prepared in the band of each joint.

use super::IdentifyOptions;
use super::fit::{Along, Fitted, fit};
use super::gather::{Gathered, Mounted};
use super::result::{Identified, IdentifyError};
use crate::conventions::{Conventions, conventions};
use crate::estimate::{BaseModel, FrictionKind, ResidualStats, estimates, residual_stats, stats_of};
use crate::mounting::Mounting;
use crate::usable::Findings;
use powerball_controller::JointNumber;
use powerball_logs::Progress;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataOptions, FEWEST_ROWS, RigidArm};
use powerball_logs::summary::BANDS;
use serde::Serialize;

/// What the model leaves of the logs to judge by; `None` where there are none.
pub(super) fn validate(
    gathered: &Gathered,
    model: &BaseModel,
    joint_bands: &[f64],
    options: &IdentifyOptions<'_>,
) -> Result<Option<ResidualStats>, IdentifyError> {
    let judge = |mounted: &Mounted| of_mounting(mounted, model, joint_bands, &options.data);
    let judged = gathered.judging().map(judge).collect::<Result<Vec<_>, _>>()?;
    Ok(match judged.as_slice() {
        [(only, _)] => Some(only.clone()),
        several => ResidualStats::pooled(several),
    })
}

/// What the model leaves of the logs of one mounting; and the rows of each joint.
fn of_mounting(
    mounted: &Mounted,
    model: &BaseModel,
    joint_bands: &[f64],
    options: &DataOptions,
) -> Result<(ResidualStats, Vec<usize>), IdentifyError> {
    let body = &mounted.body;
    let model = model.clone().in_set_of(body);
    let mut judged: Option<(ResidualStats, Vec<usize>)> = None;
    for band in by_band(body, &mounted.held_out, joint_bands, options) {
        let (members, data) = band?;
        let own = residual_stats(&data, &model.residual(body, &data));
        let (all, rows) = judged.get_or_insert_with(|| (own.clone(), vec![0; body.dof()]));
        for j in members {
            (all.rms[j], all.relative[j]) = (own.rms[j], own.relative[j]);
            (all.of_deviation[j], all.band[j]) = (own.of_deviation[j], own.band[j]);
            rows[j] = data.joints[j].len();
        }
    }
    judged.ok_or(IdentifyError::NoBand)
}

/// The model along the logs of the first mounting: those to judge by where there are any, else the fitted
/// ones.
pub(super) fn along(
    gathered: &Gathered,
    model: &BaseModel,
    joint_bands: &[f64],
    options: &IdentifyOptions<'_>,
) -> Result<Along, IdentifyError> {
    let held_out = gathered.judging().next();
    let shown = held_out.unwrap_or(&gathered.mounted[0]);
    let logs = if held_out.is_some() { &shown.held_out } else { &shown.logs };
    let model = model.clone().in_set_of(&shown.body);
    Along::new(&shown.body, logs, shown.mounting, &options.data, joint_bands, &model)
}

// What one set of parameters leaves of the logs of each mounting.

/// The logs of one mounting in the fit.
#[derive(Clone, Debug, Serialize)]
pub struct MountedFit {
    /// How the base stood, in words.
    pub mounting: String,
    /// Gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// The logs.
    pub logs: Vec<String>,
    /// What the fit leaves of them.
    pub fit: ResidualStats,
}

/// The fit by mounting, where the base did not always stand as filed; what is odd about a mounting's logs is
/// added to `warnings`.
pub(super) fn fits(
    gathered: &Gathered,
    fitted: &Fitted,
    options: &IdentifyOptions<'_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<MountedFit>, IdentifyError> {
    let all = stats_of(&fitted.solution, &fitted.solution.theta);
    let errors = match (&gathered.together, gathered.mounted.as_slice()) {
        (None, [only]) if only.mounting == Mounting::Filed => Vec::new(),
        (None, _) => vec![all.clone()],
        (Some(_), _) => errors(gathered, fitted, options, warnings)?,
    };
    // The columns of the first mounting's logs are asked in any case (see `Gathered::conventions`).
    for (mounted, errors) in gathered.mounted.iter().zip(&errors).skip(1) {
        if errors.relative.iter().any(|share| *share > SUSPECT) {
            warnings.extend(wrong_columns(mounted));
        }
    }
    let of = |(fit, mounted): (ResidualStats, &Mounted)| MountedFit {
        mounting: mounted.mounting.to_string(),
        gravity: mounted.body.gravity(),
        logs: mounted.bands.widest().logs.iter().map(|(name, _)| name.clone()).collect(),
        fit,
    };
    Ok(errors.into_iter().zip(&gathered.mounted).map(of).collect())
}

/// A joint of which more than this share of its torque is left is suspected.
const SUSPECT: f64 = 0.3;

/// What speaks against the columns of a mounting's logs, in words.
fn wrong_columns(mounted: &Mounted) -> Option<String> {
    let asked = conventions(&mounted.body, &mounted.logs, &mounted.held_out);
    asked.differ().then(|| format!("the logs with the base {}: {}", mounted.mounting, asked.wrong()))
}

/// Several mountings: what the common parameters leave of each, and which logs contradict the others.
fn errors(
    gathered: &Gathered,
    fitted: &Fitted,
    options: &IdentifyOptions<'_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<ResidualStats>, IdentifyError> {
    let Some(together) = &gathered.together else { return Ok(Vec::new()) };
    let errors = together
        .errors(&fitted.solution, &fitted.bands)
        .map_err(|e| IdentifyError::Together(e.to_string()))?;
    let contradictions = together.contradictions(&errors, &fitted.bands, options.friction);
    for (joints, mounted) in contradictions.iter().zip(&gathered.mounted).filter(|(j, _)| !j.is_empty()) {
        let joints: Vec<String> = joints.iter().map(ToString::to_string).collect();
        warnings.push(format!(
            "one set of parameters leaves more than twice as much of the logs with the base {} on joint {} \
                as a set of their own: is the mounting of each log stated correctly, and was it one arm with \
                one load?",
            mounted.mounting,
            joints.join(", ")
        ));
    }
    Ok(errors)
}

// Whether friction that differs with the direction is what a poor fit lacks.

/// A joint of whose torque more is left than this share is fitted poorly.
const POOR: f64 = 0.5;
/// Friction of two directions helps a poor joint where its error falls to this share,
const HELPS: f64 = 0.7;
/// and does not where another joint's grows to this many times.
const HARMS: f64 = 1.1;

/// What `--friction asymmetric` would do to a fit that leaves more than half of a joint's torque; `None`
/// where nothing is that poor, or it would not help.
pub(super) fn advice(
    gathered: &Gathered,
    identified: &Identified,
    options: &IdentifyOptions<'_>,
) -> Result<Option<String>, IdentifyError> {
    let now = identified.validate.as_ref().unwrap_or(&identified.fit);
    let poor: Vec<usize> = (0..now.relative.len()).filter(|j| now.relative[*j] > POOR).collect();
    if poor.is_empty() || options.friction == FrictionKind::Asymmetric {
        return Ok(None);
    }
    options.progress.say("trying friction that differs with the direction");
    let other = IdentifyOptions {
        friction: FrictionKind::Asymmetric,
        progress: Progress::default(),
        ..options.clone()
    };
    let with = judged(gathered, identified, &other)?;
    let ratio = |j: usize| with.relative[j] / now.relative[j];
    let helped: Vec<usize> = poor.into_iter().filter(|j| ratio(*j) < HELPS).collect();
    if helped.is_empty() || (0..now.relative.len()).any(|j| ratio(j) > HARMS) {
        return Ok(None);
    }
    let joints: Vec<String> = helped.iter().map(|j| JointNumber::from_index(*j).to_string()).collect();
    let percent = |of: &ResidualStats| -> Vec<String> {
        helped.iter().map(|j| format!("{:.0}", 100.0 * of.relative[*j])).collect()
    };
    let which = if identified.validate.is_some() { "held-out error" } else { "error of the fit" };
    Ok(Some(format!(
        "Friction that differs with the direction (--friction asymmetric) lowers the {which} of joint {} \
         from {} to {} % of the torque.",
        joints.join(", "),
        percent(now).join(", "),
        percent(&with).join(", ")
    )))
}

/// What a fit with other options leaves.
fn judged(
    gathered: &Gathered,
    identified: &Identified,
    options: &IdentifyOptions<'_>,
) -> Result<ResidualStats, IdentifyError> {
    let fitted = fit(gathered, options, &mut Vec::new())?;
    let solution = &fitted.solution;
    let found = estimates(gathered.body().names(), solution, &fitted.errors);
    let arm = identified.arm.clone();
    let model = BaseModel { arm, parameters: found.parameters, friction: found.friction };
    let bands: Vec<f64> = fitted.bands.iter().map(|band| BANDS[*band]).collect();
    let held_out = validate(gathered, &model, &bands, options)?;
    Ok(held_out.unwrap_or_else(|| stats_of(solution, &solution.theta)))
}

/// Why an identification should not be used.
pub(super) fn unusable(
    gathered: &Gathered,
    columns: Option<&Conventions>,
    identified: &Identified,
) -> Vec<String> {
    let judged = identified.validate.as_ref().unwrap_or(&identified.fit);
    let joints = &gathered.bands().widest().joints;
    let rests = |j: &usize| (joints[*j].rows() as usize) < FEWEST_ROWS;
    let values = identified.parameters.iter().map(|p| p.value).chain(judged.rms.iter().copied());
    let findings = Findings {
        columns,
        // With the columns they are asked there; of summaries nothing is known.
        doubts: Vec::new(),
        resting: (0..joints.len()).filter(rests).map(JointNumber::from_index).collect(),
        useless: judged.useless_joints(),
        not_finite: values.into_iter().any(|x| !x.is_finite()),
        indefinite: identified.indefinite,
    };
    findings.reasons()
}

// Logs prepared in the band of each joint.

/// Logs prepared in every band that a joint has, widest first, with the joints of that band, from 0: one band
/// at a time, as each takes many times the memory of its logs.
pub(crate) fn by_band<'a>(
    body: &'a RigidArm,
    logs: &'a [Log],
    joint_bands: &'a [f64],
    options: &'a DataOptions,
) -> impl Iterator<Item = Result<(Vec<usize>, Data<'a>), IdentifyError>> + 'a {
    let members = move |band: f64| -> Vec<usize> {
        (0..joint_bands.len()).filter(|j| joint_bands[*j] == band).collect()
    };
    let with = move |band: f64| DataOptions { cutoff: band, ..options.clone() };
    BANDS
        .iter()
        .map(move |band| (members(*band), *band))
        .filter(|(members, _)| !members.is_empty())
        .map(move |(members, band)| Ok((members, Data::new(body, logs, &with(band))?)))
}
