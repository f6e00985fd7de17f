//! Logs and summaries of logs, read one after another into one summary.

use super::Failure;
use super::inputs::same_file;
use super::mounted::MountedFile;
use super::output::Progress;
use crate::identification::estimate::{Together, reduce_in_bands};
use crate::identification::mounting::Mounting;
use crate::logs::log::{Log, LogError, read_log};
use crate::logs::regression::{DataOptions, RigidBody, silent_joints};
use crate::logs::signal::rest;
use crate::logs::summary::{Bands, Summary};
use dyngen::Arm;
use std::io::Read;
use std::path::Path;

/// What files came to.
pub(crate) struct Reduced {
    /// The fitted logs by mounting, in the order in which the mountings came up; never empty.
    pub standing: Vec<Standing>,
    /// Mountings of which there are logs to judge by alone.
    pub elsewhere: Vec<Standing>,
    /// All fitted logs, where there are several mountings.
    pub together: Option<Together>,
    pub warnings: Vec<String>,
}

/// An arm as its base stood for some logs.
pub(crate) struct Standing {
    pub mounting: Mounting,
    pub body: RigidBody,
    pub bands: Bands,
    /// The first logs as they were read, for figures; all where they were asked for.
    pub logs: Vec<Log>,
    /// The logs by which the fit is judged.
    pub held_out: Vec<Log>,
}

/// Samples of logs that are kept for figures.
const SHOWN: usize = 300_000;

impl Standing {
    pub(crate) fn new(arm: &Arm, mounting: Mounting, options: &DataOptions) -> Result<Standing, Failure> {
        let mounted = mounting.of(arm).map_err(Failure::Unusable)?;
        let body = RigidBody::mounted(&mounted, arm).map_err(|e| Failure::Refused(e.to_string()))?;
        Ok(Standing {
            mounting,
            bands: Bands::new(&body, options),
            body,
            logs: Vec::new(),
            held_out: Vec::new(),
        })
    }

    /// Whether the base stands so.
    pub(crate) fn is(&self, mounting: Mounting, arm: &Arm) -> bool {
        mounting.of(arm).is_ok_and(|mounted| mounted.gravity == self.body.arm().gravity)
    }
}

impl Reduced {
    fn of(standing: Vec<Standing>, warnings: Vec<String>, progress: &Progress) -> Result<Reduced, Failure> {
        let mut reduced = Reduced { standing, elsewhere: Vec::new(), together: None, warnings };
        if let [_, _, ..] = reduced.standing.as_slice() {
            progress.say("deriving and proving what the mountings determine together");
            let parts: Vec<(&RigidBody, &Bands)> =
                reduced.standing.iter().map(|s| (&s.body, &s.bands)).collect();
            reduced.together = Some(Together::new(&parts).map_err(Failure::Refused)?);
        }
        let notes = match reduced.standing.as_slice() {
            [only] => rests(&only.body, only.bands.widest(), &only.logs),
            all => {
                let shown: Vec<Log> = all.iter().flat_map(|s| s.logs.iter().cloned()).collect();
                rests(reduced.body(), reduced.bands().widest(), &shown)
            }
        };
        reduced.warnings.extend(notes);
        Ok(reduced)
    }

    /// Takes a log in to judge the fit by.
    pub(crate) fn hold_out(
        &mut self,
        log: Log,
        mounting: Mounting,
        options: &DataOptions,
    ) -> Result<(), Failure> {
        let arm = self.standing[0].body.filed();
        let mut all = self.standing.iter_mut().chain(&mut self.elsewhere);
        match all.find(|s| s.is(mounting, &arm)) {
            Some(standing) => standing.held_out.push(log),
            None => {
                let standing = Standing::new(&arm, mounting, options)?;
                self.elsewhere.push(Standing { held_out: vec![log], ..standing });
            }
        }
        Ok(())
    }

    /// The mountings of which there are logs to judge by.
    pub(crate) fn judging(&self) -> impl Iterator<Item = &Standing> {
        self.standing.iter().chain(&self.elsewhere).filter(|s| !s.held_out.is_empty())
    }

    /// The arm in whose minimal set the logs are fitted.
    pub(crate) fn body(&self) -> &RigidBody {
        self.together.as_ref().map_or(&self.standing[0].body, |all| &all.body)
    }

    /// All logs.
    pub(crate) fn bands(&self) -> &Bands {
        self.together.as_ref().map_or(&self.standing[0].bands, |all| &all.bands)
    }
}

/// Reads and reduces files, each a log or a summary; every file that is unusable is named. Where logs are
/// needed `whole`, all are kept and a summary is none.
pub(crate) fn reduce(
    arm: &Path,
    files: &[MountedFile],
    options: &DataOptions,
    whole: bool,
    progress: &Progress,
) -> Result<Reduced, Failure> {
    let arm = Arm::read(arm).map_err(|e| Failure::Unusable(e.to_string()))?;
    let mut warnings = arm.notes();
    let (mut standing, mut shown_samples): (Vec<Standing>, usize) = (Vec::new(), 0);
    let (mut unusable, mut refused) = (Vec::new(), Vec::new());
    for (k, MountedFile { file, mounting: said }) in files.iter().enumerate() {
        let name = file.display();
        if files[..k].iter().any(|other| same_file(&other.file, file)) {
            unusable.push(format!("{name}: given twice"));
            continue;
        }
        progress.say(&format!("reading {name}"));
        let summary = match read_summary(file) {
            Ok(Some(_)) if whole => {
                unusable.push(format!(
                    "{name}: is a summary, and this estimator looks at single samples: give the log itself"
                ));
                continue;
            }
            Ok(summary) => summary,
            Err(reason) => {
                unusable.push(format!("{name}: {reason}"));
                continue;
            }
        };
        let own = summary.as_ref().map(|read| Mounting::with(read.widest().identity.gravity, &arm));
        let mounting = own.or(*said).unwrap_or_default();
        let place = match standing.iter().position(|s| s.is(mounting, &arm)) {
            Some(place) => place,
            None => {
                progress.say("deriving and proving the arm's dynamics");
                standing.push(Standing::new(&arm, mounting, options)?);
                standing.len() - 1
            }
        };
        if let (Some(own), Some(said)) = (own, said.filter(|said| !standing[place].is(*said, &arm))) {
            unusable.push(format!("{name}: was recorded with the base {own}, not {said}"));
            continue;
        }
        let Standing { body, bands, logs, .. } = &mut standing[place];
        if let Some(read) = summary {
            for (log, _) in &read.widest().logs {
                if bands.widest().logs.iter().any(|(other, _)| other == log) {
                    warnings.push(format!("{name}: holds {log}, which is in already: it counts twice"));
                }
            }
            if let Err(error) = bands.merge(&read) {
                unusable.push(format!("{name}: {error}"));
            }
            continue;
        }
        let mut findings = Vec::new();
        match read_log(file, &arm, &mut findings) {
            Err(LogError(reasons)) => unusable.extend(reasons.iter().map(ToString::to_string)),
            Ok(log) => {
                warnings.extend(findings.iter().map(ToString::to_string));
                // A log and its summary must come to the same.
                match reduce_in_bands(body, &log, options) {
                    Ok((one, notes)) => {
                        warnings.extend(notes);
                        if let Err(error) = bands.merge(&one) {
                            unusable.push(format!("{name}: {error}"));
                        }
                    }
                    Err(error) => refused.push(format!("{name}: {error}")),
                }
                if whole || shown_samples < SHOWN {
                    shown_samples += log.t.len();
                    logs.push(log);
                }
            }
        }
    }
    if !unusable.is_empty() {
        return Err(Failure::Unusable(unusable.join("\n")));
    }
    standing.retain(|s| !s.bands.widest().logs.is_empty());
    if standing.is_empty() {
        return Err(Failure::Refused(refused.join("\n")));
    }
    warnings.extend(refused.into_iter().map(|r| format!("{r}; the log was left out")));
    Reduced::of(standing, warnings, progress)
}

/// Reduces logs of one mounting that were read already.
pub(crate) fn in_memory(
    body: RigidBody,
    logs: Vec<Log>,
    held_out: Vec<Log>,
    mut warnings: Vec<String>,
    options: &DataOptions,
    mounting: Mounting,
    progress: &Progress,
) -> Result<Reduced, Failure> {
    let mut bands = Bands::new(&body, options);
    let mut refused = Vec::new();
    for log in &logs {
        match reduce_in_bands(&body, log, options) {
            Ok((one, notes)) => {
                warnings.extend(notes);
                bands.merge(&one).map_err(|e| Failure::Unusable(format!("{}: {e}", log.file)))?;
            }
            Err(error) => refused.push(format!("{}: {error}", log.file)),
        }
    }
    if bands.widest().logs.is_empty() {
        return Err(Failure::Refused(refused.join("\n")));
    }
    warnings.extend(refused.into_iter().map(|r| format!("{r}; the log was left out")));
    Reduced::of(vec![Standing { mounting, body, bands, logs, held_out }], warnings, progress)
}

/// A file's summary; `None` where the file is something else.
fn read_summary(file: &Path) -> Result<Option<Bands>, String> {
    let read = |mut f: std::fs::File| {
        let mut head = vec![0; 64];
        let count = f.read(&mut head)?;
        head.truncate(count);
        if Summary::is_summary(&head) {
            f.read_to_end(&mut head)?;
            return Ok(Some(head));
        }
        Ok(None)
    };
    let bytes = std::fs::File::open(file).and_then(read).map_err(|e| format!("cannot be read: {e}"))?;
    bytes.map(|bytes| Bands::from_bytes(&bytes).map_err(|e| e.to_string())).transpose()
}

/// What is to be said of joints that rested.
fn rests(body: &RigidBody, summary: &Summary, shown: &[Log]) -> Vec<String> {
    let mut notes = Vec::new();
    let silent = if shown.is_empty() { Vec::new() } else { silent_joints(body.arm(), shown) };
    for (j, octaves) in summary.joints.iter().enumerate() {
        let rested = summary.samples.saturating_sub(octaves.rows());
        if octaves.rows() < 20 {
            let rests = || {
                format!(
                    "joint {} rests in these logs: neither its friction nor any effect on it can be judged; \
                        record paths on which it \
                     swings (powerball excite)",
                    j + 1
                )
            };
            let why = silent.get(j).cloned().flatten().or_else(|| summary.silent[j].clone());
            notes.push(why.unwrap_or_else(rests));
        } else if rested * 4 > summary.samples {
            notes.push(format!(
                "joint {} rests in {:.0} % of the samples ({} s or longer, or at an end of a log); they were \
                    left out",
                j + 1,
                100.0 * rested as f64 / summary.samples as f64,
                rest::LONGEST_REVERSAL
            ));
        }
    }
    notes
}
