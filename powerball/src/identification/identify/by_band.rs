//! Logs prepared in the band of each joint.

use super::error::IdentifyError;
use crate::logs::log::Log;
use crate::logs::regression::{Data, DataOptions, RigidArm};
use crate::logs::summary::BANDS;

/// Logs prepared in every band that a joint has, widest first, with the joints of that band, from 0.
pub(crate) fn by_band<'a>(
    body: &'a RigidArm,
    logs: &[Log],
    joint_bands: &[f64],
    options: &DataOptions,
) -> Result<Vec<(Vec<usize>, Data<'a>)>, IdentifyError> {
    let members =
        |band: f64| -> Vec<usize> { (0..joint_bands.len()).filter(|j| joint_bands[*j] == band).collect() };
    let with = |band: f64| DataOptions { cutoff: band, ..options.clone() };
    BANDS
        .iter()
        .map(|band| (members(*band), *band))
        .filter(|(members, _)| !members.is_empty())
        .map(|(members, band)| Ok((members, Data::new(body, logs, &with(band))?)))
        .collect()
}
