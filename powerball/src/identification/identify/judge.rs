//! What a model leaves of the validation set, each joint in the band in which it was fitted.

use super::along::Along;
use super::by_band::by_band;
use super::error::IdentifyError;
use super::gather::{Gathered, Mounted};
use super::options::IdentifyOptions;
use crate::identification::estimate::{BaseModel, ResidualStats, residual_stats};
use crate::logs::regression::DataOptions;

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
    for (members, data) in by_band(body, &mounted.held_out, joint_bands, options)? {
        let own = residual_stats(&data, &model.residual(body, &data));
        let (all, rows) = judged.get_or_insert_with(|| (own.clone(), vec![0; body.dof()]));
        for j in members {
            (all.rms[j], all.relative[j]) = (own.rms[j], own.relative[j]);
            all.of_deviation[j] = own.of_deviation[j];
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
