//! Arm and logs of one mounting, read at once: what a known model is applied to.

use super::error::IdentifyError;
use super::recorded::{Recorded, samples};
use crate::identification::known::KnownModel;
use crate::identification::mounting::Mounting;
use crate::identification::source::Source;
use crate::logs::Progress;
use crate::logs::log::{Log, notes_of};
use crate::logs::regression::RigidArm;
use dyngen::Arm;

/// An arm, as a model has it, and its logs on one clock.
#[derive(Debug)]
pub(crate) struct InMemory {
    /// The arm of the file with the model's changes.
    pub arm: Arm,
    /// The same, mounted as for the logs.
    pub body: RigidArm,
    pub fit: Vec<Log>,
    pub validate: Vec<Log>,
    /// The model in the set of the body.
    pub known: Box<dyn KnownModel>,
    pub warnings: Vec<String>,
}

/// The one mounting of all logs; `what` takes no others.
///
/// # Errors
/// [`IdentifyError::SeveralMountings`].
pub(crate) fn one_mounting<'s>(
    sources: impl IntoIterator<Item = &'s Source<'s>>,
    what: &'static str,
) -> Result<Mounting, IdentifyError> {
    let mut mountings = sources.into_iter().map(|s| s.mounting.unwrap_or_default());
    let mounting = mountings.next().unwrap_or_default();
    match mountings.any(|other| other != mounting) {
        true => Err(IdentifyError::SeveralMountings(what)),
        false => Ok(mounting),
    }
}

impl InMemory {
    /// Reads and checks everything before any work is done. The logs are as they are: nothing is taken out.
    ///
    /// # Errors
    /// A model of another arm, logs that cannot be read, summaries.
    pub(crate) fn read(
        arm: &Arm,
        known: &dyn KnownModel,
        [fit, validate]: [&[Source<'_>]; 2],
        mounting: Mounting,
        progress: Progress<'_>,
    ) -> Result<InMemory, IdentifyError> {
        let arm = known.arm(arm, mounting).map_err(IdentifyError::Known)?;
        let mounted = mounting.of(&arm).map_err(IdentifyError::Mounting)?;
        let mut warnings = notes_of(&mounted);
        progress.say("reading logs");
        let Recorded { fit, validate, warnings: found } = Recorded::read(&arm, fit, validate)?;
        warnings.extend(found);
        progress.say("deriving and proving the arm's dynamics");
        let body = RigidArm::mounted(&mounted, &arm)?;
        let known = known.in_set_of(&body).map_err(IdentifyError::Known)?;
        Ok(InMemory { arm, body, fit, validate, known, warnings })
    }
}

/// The log of each source to judge by, with its mounting.
///
/// # Errors
/// [`IdentifyError::Unusable`] with every reason.
pub(crate) fn held_out(
    sources: &[Source<'_>],
    arm: &Arm,
    warnings: &mut Vec<String>,
) -> Result<Vec<(Log, Mounting)>, IdentifyError> {
    let (mut logs, mut unusable) = (Vec::new(), Vec::new());
    for source in sources {
        match samples(source, arm, warnings) {
            Ok(log) => logs.push((log, source.mounting.unwrap_or_default())),
            Err(reasons) => unusable.extend(reasons),
        }
    }
    if unusable.is_empty() { Ok(logs) } else { Err(IdentifyError::Unusable(unusable)) }
}
