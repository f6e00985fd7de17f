//! Logs as sufficient statistics, which [`identify`](super::identify) takes in their place.

use super::identify::{Gathering, IdentifyError};
use super::mounting::Mounting;
use super::source::Source;
use crate::logs::Progress;
use crate::logs::log::notes_of;
use crate::logs::regression::DataOptions;
use crate::logs::summary::Bands;
use dyngen::Arm;

/// The R factors of logs of one mounting.
#[derive(Clone, Debug)]
pub struct Summarized {
    /// How the base stood.
    pub mounting: Mounting,
    /// The factors: [`Bands::to_bytes`] writes them.
    pub bands: Bands,
    /// What is to be said of the logs and the arm file.
    pub warnings: Vec<String>,
}

/// Reduces logs to their sufficient statistics, of one size however long they were, and joins summaries with
/// them.
///
/// # Errors
/// [`IdentifyError`]: logs that cannot be used, or are of several mountings of the base.
pub fn summarize<'a, S: Into<Source<'a>>>(
    arm: &Arm,
    logs: impl IntoIterator<Item = S>,
    options: &DataOptions,
    progress: Progress<'_>,
) -> Result<Summarized, IdentifyError> {
    let logs: Vec<Source<'a>> = logs.into_iter().map(Into::into).collect();
    let gathered = Gathering::new(arm, options, false, progress).said(notes_of(arm)).all(&logs)?;
    let mountings: Vec<String> = gathered.mounted.iter().map(|m| m.mounting.to_string()).collect();
    let mut mounted = gathered.mounted.into_iter();
    match (mounted.next(), mounted.next()) {
        (Some(only), None) => {
            Ok(Summarized { mounting: only.mounting, bands: only.bands, warnings: gathered.warnings })
        }
        _ => Err(IdentifyError::Unusable(vec![format!(
            "these are of several mountings of the base ({}): a summary has one; give them to identify as \
                they are",
            mountings.join("; ")
        )])),
    }
}
