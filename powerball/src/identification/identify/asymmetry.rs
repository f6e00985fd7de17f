//! Whether friction that differs with the direction is what a poor fit lacks.

use super::error::IdentifyError;
use super::fit::fit;
use super::gather::Gathered;
use super::judge;
use super::options::IdentifyOptions;
use super::result::Identified;
use crate::controller::JointNumber;
use crate::identification::estimate::{BaseModel, FrictionKind, ResidualStats, estimates, stats_of};
use crate::logs::Progress;
use crate::logs::summary::BANDS;

/// A joint of whose torque more is left than this share is fitted poorly.
const POOR: f64 = 0.5;
/// Friction of two directions helps a poor joint where its error falls to this share,
const HELPS: f64 = 0.7;
/// and does not where another joint's grows to so many times.
const HARMS: f64 = 1.1;

/// What `--friction asymmetric` would do to a fit that leaves more than half of a joint's torque; `None` where nothing is
/// that poor, or it would not help.
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
        "Friction that differs with the direction (--friction asymmetric) lowers the {which} of joint {} from {} to {} % \
         of the torque.",
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
    let held_out = judge::validate(gathered, &model, &bands, options)?;
    Ok(held_out.unwrap_or_else(|| stats_of(solution, &solution.theta)))
}
