//! What one set of parameters leaves of the logs of each mounting.

use super::error::IdentifyError;
use super::fit::Fitted;
use super::gather::{Gathered, Mounted};
use super::options::IdentifyOptions;
use crate::identification::estimate::{ResidualStats, exchanged, stats_of};
use crate::identification::mounting::Mounting;
use serde::Serialize;

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
    let spreads = match (&gathered.together, gathered.mounted.as_slice()) {
        (None, [only]) if only.mounting == Mounting::Filed => Vec::new(),
        (None, _) => vec![all.clone()],
        (Some(_), _) => spreads(gathered, fitted, options, warnings)?,
    };
    for (k, mounted) in gathered.mounted.iter().enumerate() {
        let errors = spreads.get(k).unwrap_or(&all);
        warnings.extend(exchanged(&mounted.body, &mounted.logs, &options.data, errors));
    }
    let of = |(fit, mounted): (ResidualStats, &Mounted)| MountedFit {
        mounting: mounted.mounting.to_string(),
        gravity: mounted.body.gravity(),
        logs: mounted.bands.widest().logs.iter().map(|(name, _)| name.clone()).collect(),
        fit,
    };
    Ok(spreads.into_iter().zip(&gathered.mounted).map(of).collect())
}

/// Several mountings: what the common parameters leave of each, and which logs contradict the others.
fn spreads(
    gathered: &Gathered,
    fitted: &Fitted,
    options: &IdentifyOptions<'_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<ResidualStats>, IdentifyError> {
    let Some(together) = &gathered.together else { return Ok(Vec::new()) };
    let spreads = together
        .spreads(&fitted.solution, &fitted.bands)
        .map_err(|e| IdentifyError::Together(e.to_string()))?;
    let contradictions = together.contradictions(&spreads, &fitted.bands, options.friction);
    for (joints, mounted) in contradictions.iter().zip(&gathered.mounted).filter(|(j, _)| !j.is_empty()) {
        let joints: Vec<String> = joints.iter().map(ToString::to_string).collect();
        warnings.push(format!(
            "one set of parameters leaves more than twice as much of the logs with the base {} on joint {} \
                as a set of their own: is the mounting of each log told right, and was it one arm with one \
                load?",
            mounted.mounting,
            joints.join(", ")
        ));
    }
    Ok(spreads)
}
