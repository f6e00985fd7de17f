//! Logs and summaries, taken in one after another: the sufficient statistics of each mounting of the base.
//!
//! The file also has arm and logs of one mounting, read at once; the samples of all logs of a computation,
//! read at once.

use super::result::IdentifyError;
use crate::conventions::{Conventions, conventions};
use crate::estimate::{Together, reduce_in_bands};
use crate::known::KnownModel;
use crate::mounting::Mounting;
use crate::source::{Input, Source, read_summary};
use crate::transmission::{JointTransmission, transmission};
use crate::usable;
use dyngen::Arm;
use powerball_controller::JointNumber;
use powerball_logs::Progress;
use powerball_logs::log::{ColumnMap, Log, LogError, common_clock, notes_of, read_log_as};
use powerball_logs::regression::{DataOptions, FEWEST_ROWS, RigidArm, inactive_joints, rest_note};
use powerball_logs::summary::{Bands, Octaves, Summary};
use std::path::Path;

/// An arm as its base stood for some logs.
#[derive(Debug)]
pub(crate) struct Mounted {
    pub mounting: Mounting,
    pub body: RigidArm,
    pub bands: Bands,
    /// The first samples of the logs as they were read, for figures; all where they were asked for.
    pub logs: Vec<Log>,
    /// The logs by which the fit is judged.
    pub held_out: Vec<Log>,
    /// What its logs say themselves against being used.
    pub doubts: Vec<String>,
}

impl Mounted {
    pub(crate) fn new(
        arm: &Arm,
        mounting: Mounting,
        options: &DataOptions,
    ) -> Result<Mounted, IdentifyError> {
        let mounted = mounting.of(arm).map_err(IdentifyError::Mounting)?;
        Ok(Mounted::of(RigidArm::mounted(&mounted, arm)?, mounting, options))
    }

    /// As [`Mounted::new`], for a body that is there already.
    pub(crate) fn of(body: RigidArm, mounting: Mounting, options: &DataOptions) -> Mounted {
        let bands = Bands::new(&body, options);
        Mounted { mounting, body, bands, logs: Vec::new(), held_out: Vec::new(), doubts: Vec::new() }
    }

    /// Whether the base stands so.
    fn is(&self, mounting: Mounting, arm: &Arm) -> bool {
        mounting.of(arm).is_ok_and(|mounted| mounted.gravity == self.body.arm().gravity)
    }
}

/// What logs came to.
#[derive(Debug)]
pub(crate) struct Gathered {
    /// The fitted logs by mounting, in the order in which the mountings came up; never empty.
    pub mounted: Vec<Mounted>,
    /// Mountings of which there are logs to judge by alone.
    pub elsewhere: Vec<Mounted>,
    /// All fitted logs, where there are several mountings.
    pub together: Option<Together>,
    /// What is to be reported about the logs.
    pub warnings: Vec<String>,
    /// What the columns are, where they were asked before something was taken out of them.
    pub conventions: Option<Conventions>,
    /// The transmissions, where they were asked before.
    pub transmission: Option<Vec<JointTransmission>>,
}

impl Gathered {
    fn of(
        mounted: Vec<Mounted>,
        warnings: Vec<String>,
        progress: Progress<'_>,
    ) -> Result<Gathered, IdentifyError> {
        let mut gathered = Gathered {
            mounted,
            elsewhere: Vec::new(),
            together: None,
            warnings,
            conventions: None,
            transmission: None,
        };
        if let [_, _, ..] = gathered.mounted.as_slice() {
            progress.say("deriving and proving what the mountings determine together");
            let parts: Vec<(&RigidArm, &Bands)> =
                gathered.mounted.iter().map(|m| (&m.body, &m.bands)).collect();
            gathered.together = Some(Together::new(&parts).map_err(IdentifyError::Together)?);
        }
        let kept: Vec<Log> = gathered.mounted.iter().flat_map(|m| m.logs.iter().cloned()).collect();
        let notes = rest_notes(gathered.body().arm(), gathered.bands().widest(), &kept);
        gathered.warnings.extend(notes);
        Ok(gathered)
    }

    /// Takes a log in to judge the fit by.
    pub(crate) fn hold_out(
        &mut self,
        log: Log,
        mounting: Mounting,
        options: &DataOptions,
    ) -> Result<(), IdentifyError> {
        let arm = self.mounted[0].body.filed();
        let mut all = self.mounted.iter_mut().chain(&mut self.elsewhere);
        match all.find(|m| m.is(mounting, &arm)) {
            Some(mounted) => mounted.held_out.push(log),
            None => {
                let mounted = Mounted::new(&arm, mounting, options)?;
                self.elsewhere.push(Mounted { held_out: vec![log], ..mounted });
            }
        }
        Ok(())
    }

    /// What the columns of the first mounting's logs are; `None` where there are summaries alone.
    pub(crate) fn conventions(&self, progress: Progress<'_>) -> Option<Conventions> {
        let Mounted { body, logs, held_out, .. } = self.mounted.iter().find(|m| !m.logs.is_empty())?;
        progress.say("asking what the columns are");
        Some(conventions(body, logs, held_out))
    }

    /// What the logs that hold two torques show about the transmissions, however the base stood.
    pub(crate) fn transmission(&self, progress: Progress<'_>) -> Option<Vec<JointTransmission>> {
        let all = || self.mounted.iter().chain(&self.elsewhere);
        let fitted: Vec<&Log> = all().flat_map(|m| &m.logs).collect();
        let held_out: Vec<&Log> = all().flat_map(|m| &m.held_out).collect();
        if fitted.iter().chain(&held_out).any(|log| log.motor.is_some()) {
            progress.say("comparing the motors' torques with the links'");
        }
        transmission(self.body().arm(), fitted, held_out)
    }

    /// The mountings of which there are logs to judge by.
    pub(crate) fn judging(&self) -> impl Iterator<Item = &Mounted> {
        self.mounted.iter().chain(&self.elsewhere).filter(|m| !m.held_out.is_empty())
    }

    /// The arm in whose minimal set the logs are fitted.
    pub(crate) fn body(&self) -> &RigidArm {
        self.together.as_ref().map_or(&self.mounted[0].body, |all| &all.body)
    }

    /// The sufficient statistics of all logs.
    pub(crate) fn bands(&self) -> &Bands {
        self.together.as_ref().map_or(&self.mounted[0].bands, |all| &all.bands)
    }
}

/// Samples of logs that are kept for figures.
const SHOWN: usize = 300_000;

/// Takes logs and summaries in, one after another; every one that is unusable is named at the end.
pub(crate) struct Gathering<'a> {
    arm: &'a Arm,
    options: &'a DataOptions,
    progress: Progress<'a>,
    /// Whether single samples are needed: a summary has none.
    needs_samples: bool,
    mounted: Vec<Mounted>,
    samples_kept: usize,
    warnings: Vec<String>,
    unusable: Vec<String>,
    refused: Vec<String>,
}

impl<'a> Gathering<'a> {
    pub(crate) fn new(
        arm: &'a Arm,
        options: &'a DataOptions,
        needs_samples: bool,
        progress: Progress<'a>,
    ) -> Gathering<'a> {
        Gathering {
            arm,
            options,
            progress,
            needs_samples,
            mounted: Vec::new(),
            samples_kept: 0,
            warnings: Vec::new(),
            unusable: Vec::new(),
            refused: Vec::new(),
        }
    }

    /// Begins with a mounting whose body is there already.
    pub(crate) fn with(mut self, mounted: Mounted) -> Gathering<'a> {
        self.mounted.push(mounted);
        self
    }

    /// Warnings that come first.
    pub(crate) fn said(mut self, warnings: Vec<String>) -> Gathering<'a> {
        self.warnings.extend(warnings);
        self
    }

    /// Takes all sources in, in their order.
    pub(crate) fn all(mut self, sources: &[Source<'_>]) -> Result<Gathered, IdentifyError> {
        for (k, source) in sources.iter().enumerate() {
            match sources[..k].iter().any(|other| other.same_file(source)) {
                true => self.unusable.push(format!("{}: given twice", source.name())),
                false => self.take(source)?,
            }
        }
        self.finish()
    }

    fn take(&mut self, source: &Source<'_>) -> Result<(), IdentifyError> {
        let said = source.mounting;
        match &source.input {
            Input::Log(log) => self.take_log(&source.name(), log.as_ref().clone(), said),
            Input::Summary(summary) => self.take_summary(&source.name(), summary, said),
            Input::Servos(_) => {
                self.unusable.push(of_servos(source));
                Ok(())
            }
            Input::File(path) => self.take_file(&source.name(), path, &source.map, said),
        }
    }

    fn take_file(
        &mut self,
        name: &str,
        path: &Path,
        map: &ColumnMap,
        said: Option<Mounting>,
    ) -> Result<(), IdentifyError> {
        self.progress.say(&format!("reading {name}"));
        match read_summary(path) {
            Ok(Some(summary)) => self.take_summary(name, &summary, said),
            Ok(None) => self.take_samples(name, path, map, said),
            Err(reason) => {
                self.unusable.push(format!("{name}: {reason}"));
                Ok(())
            }
        }
    }

    fn take_samples(
        &mut self,
        name: &str,
        path: &Path,
        map: &ColumnMap,
        said: Option<Mounting>,
    ) -> Result<(), IdentifyError> {
        let mut findings = Vec::new();
        match read_log_as(path, self.arm, map, &mut findings) {
            Err(LogError(reasons)) => {
                self.unusable.extend(reasons.iter().map(ToString::to_string));
                Ok(())
            }
            Ok(log) => {
                self.warnings.extend(findings.iter().map(ToString::to_string));
                self.take_log(name, log, said)
            }
        }
    }

    fn take_summary(
        &mut self,
        name: &str,
        read: &Bands,
        said: Option<Mounting>,
    ) -> Result<(), IdentifyError> {
        if self.needs_samples {
            self.unusable.push(format!(
                "{name}: is a summary, and this estimator looks at single samples: give the log itself"
            ));
            return Ok(());
        }
        let own = Mounting::with(read.widest().identity.gravity, self.arm);
        let place = self.place(own)?;
        if let Some(said) = said.filter(|said| !self.mounted[place].is(*said, self.arm)) {
            self.unusable.push(format!("{name}: was recorded with the base {own}, not {said}"));
            return Ok(());
        }
        let bands = &mut self.mounted[place].bands;
        for (log, _) in &read.widest().logs {
            if bands.widest().logs.iter().any(|(other, _)| other == log) {
                self.warnings.push(format!("{name}: holds {log}, which is in already: it counts twice"));
            }
        }
        if let Err(error) = bands.merge(read) {
            self.unusable.push(format!("{name}: {error}"));
        }
        Ok(())
    }

    fn take_log(&mut self, name: &str, log: Log, said: Option<Mounting>) -> Result<(), IdentifyError> {
        let place = self.place(said.unwrap_or_default())?;
        let Mounted { body, bands, logs, doubts, .. } = &mut self.mounted[place];
        doubts.extend(
            usable::doubts(&body.filed(), [&log])
                .into_iter()
                .filter(|doubt| !doubts.contains(doubt))
                .collect::<Vec<_>>(),
        );
        // A log and its summary must come to the same.
        match reduce_in_bands(body, &log, self.options) {
            Ok((one, notes)) => {
                self.warnings.extend(notes);
                if let Err(error) = bands.merge(&one) {
                    self.unusable.push(format!("{name}: {error}"));
                }
            }
            Err(error) => self.refused.push(format!("{name}: {error}")),
        }
        let room = if self.needs_samples { usize::MAX } else { SHOWN.saturating_sub(self.samples_kept) };
        if room > 0 {
            if log.t.len() > room {
                self.warnings.push(format!(
                    "{name}: figures, and what its columns are, are of its first {room} samples of {}; the \
                    fit is of all",
                    log.t.len()
                ));
            }
            let log = log.cut(room);
            self.samples_kept += log.t.len();
            logs.push(log);
        }
        Ok(())
    }

    /// Where logs of a mounting go.
    fn place(&mut self, mounting: Mounting) -> Result<usize, IdentifyError> {
        if let Some(place) = self.mounted.iter().position(|m| m.is(mounting, self.arm)) {
            return Ok(place);
        }
        self.progress.say("deriving and proving the arm's dynamics");
        self.mounted.push(Mounted::new(self.arm, mounting, self.options)?);
        Ok(self.mounted.len() - 1)
    }

    fn finish(mut self) -> Result<Gathered, IdentifyError> {
        if !self.unusable.is_empty() {
            return Err(IdentifyError::Unusable(self.unusable));
        }
        self.mounted.retain(|m| !m.bands.widest().logs.is_empty());
        if self.mounted.is_empty() {
            return Err(IdentifyError::NothingUsable(self.refused));
        }
        self.warnings.extend(self.refused.into_iter().map(|r| format!("{r}; the log was left out")));
        Gathered::of(self.mounted, self.warnings, self.progress)
    }
}

/// What is to be reported about joints that rested.
fn rest_notes(arm: &Arm, summary: &Summary, kept: &[Log]) -> Vec<String> {
    let inactive = if kept.is_empty() { Vec::new() } else { inactive_joints(arm, kept) };
    let note = |(j, octaves): (usize, &Octaves)| {
        let (joint, rows) = (JointNumber::from_index(j), octaves.rows() as usize);
        let why = || inactive.get(j).cloned().flatten().or_else(|| summary.inactive[j].clone());
        let hardly = rows < FEWEST_ROWS;
        let why = if hardly { why() } else { None };
        why.or_else(|| rest_note(joint, rows, summary.samples as usize, None))
    };
    summary.joints.iter().enumerate().filter_map(note).collect()
}

// Arm and logs of one mounting, read at once: what a known model is applied to.

/// An arm, as a model has it, and its logs on one clock.
#[derive(Debug)]
pub(crate) struct InMemory {
    /// The arm of the file with the model's changes.
    pub arm: Arm,
    /// That arm, mounted as for the logs.
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

// The samples of all logs of a computation, read at once.

/// Logs to fit and logs to judge by, on a common clock, and what was found in them.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Logs to fit.
    pub fit: Vec<Log>,
    /// Logs of other paths.
    pub validate: Vec<Log>,
    /// What is odd about the files.
    pub warnings: Vec<String>,
}

impl Recorded {
    /// Reads logs of an arm, each from its file or as it is.
    ///
    /// # Errors
    /// Every log that cannot be read or is a summary, and a file that is to be fitted and to judge.
    pub fn read(arm: &Arm, logs: &[Source<'_>], validate: &[Source<'_>]) -> Result<Recorded, IdentifyError> {
        no_log_in_both(logs, validate)?;
        let (mut all, mut warnings, mut unusable) = (Vec::new(), Vec::new(), Vec::new());
        for source in logs.iter().chain(validate) {
            match samples(source, arm, &mut warnings) {
                Ok(log) => all.push(log),
                Err(reasons) => unusable.extend(reasons),
            }
        }
        if !unusable.is_empty() {
            return Err(IdentifyError::Unusable(unusable));
        }
        common_clock(&mut all);
        let validate = all.split_off(logs.len());
        Ok(Recorded { fit: all, validate, warnings })
    }
}

/// There is a log to fit, and none that is fitted judges.
///
/// # Errors
/// [`IdentifyError::Setting`] and [`IdentifyError::JudgesItself`].
pub(crate) fn no_log_in_both(logs: &[Source<'_>], validate: &[Source<'_>]) -> Result<(), IdentifyError> {
    if logs.is_empty() {
        return Err(IdentifyError::Setting("there is no log to fit: give at least one".to_string()));
    }
    match validate.iter().find(|file| logs.iter().any(|log| log.same_file(file))) {
        Some(both) => Err(IdentifyError::JudgesItself(both.name())),
        None => Ok(()),
    }
}

/// Why a log of position servos is not taken.
fn of_servos(source: &Source<'_>) -> String {
    format!("{}: is of position servos (goal1 … and no torque): logs with torques are needed", source.name())
}

/// The samples of a source; what is odd about a file is added to `warnings`.
pub(super) fn samples(
    source: &Source<'_>,
    arm: &Arm,
    warnings: &mut Vec<String>,
) -> Result<Log, Vec<String>> {
    match &source.input {
        Input::Log(log) => Ok(log.as_ref().clone()),
        Input::Summary(_) => {
            Err(vec![format!("{}: single samples are needed: give the log itself", source.name())])
        }
        Input::Servos(_) => Err(vec![of_servos(source)]),
        Input::File(path) => {
            let mut findings = Vec::new();
            let read = read_log_as(path, arm, &source.map, &mut findings);
            warnings.extend(findings.iter().map(ToString::to_string));
            read.map_err(|LogError(reasons)| reasons.iter().map(ToString::to_string).collect())
        }
    }
}
