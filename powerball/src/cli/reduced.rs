//! Logs and summaries of logs, read one after another into one summary.

use super::Failure;
use super::inputs::same_file;
use super::output::Progress;
use crate::estimate::reduce_in_bands;
use crate::log::{Log, LogError, read_log};
use crate::regression::{DataOptions, RigidBody, silent_joints};
use crate::signal::rest;
use crate::summary::{Bands, Summary};
use dyngen::Arm;
use std::io::Read;
use std::path::{Path, PathBuf};

/// What files came to.
pub(crate) struct Reduced {
    pub body: RigidBody,
    pub bands: Bands,
    /// The first logs as they were read, for figures; all where they were asked for.
    pub logs: Vec<Log>,
    pub warnings: Vec<String>,
}

/// Samples of logs that are kept for figures.
const SHOWN: usize = 300_000;

/// The arm of a file, and its functions.
pub(crate) fn body(arm: &Path, progress: &Progress) -> Result<(RigidBody, Vec<String>), Failure> {
    let arm = Arm::read(arm).map_err(|e| Failure::Unusable(e.to_string()))?;
    progress.say("deriving and proving the arm's dynamics");
    let body = RigidBody::new(&arm).map_err(|e| Failure::Refused(e.to_string()))?;
    Ok((body, arm.notes()))
}

/// Reads and reduces files, each a log or a summary; every file that is unusable is named. Where logs are needed `whole`,
/// all are kept and a summary is none.
pub(crate) fn reduce(
    arm: &Path,
    files: &[PathBuf],
    options: &DataOptions,
    whole: bool,
    progress: &Progress,
) -> Result<Reduced, Failure> {
    let (body, mut warnings) = body(arm, progress)?;
    let mut bands = Bands::new(&body, options);
    let (mut shown, mut shown_samples): (Vec<Log>, usize) = (Vec::new(), 0);
    let (mut unusable, mut refused) = (Vec::new(), Vec::new());
    for (k, file) in files.iter().enumerate() {
        let name = file.display();
        if files[..k].iter().any(|other| same_file(other, file)) {
            unusable.push(format!("{name}: given twice"));
            continue;
        }
        progress.say(&format!("reading {name}"));
        match read_summary(file) {
            Ok(None) => {}
            Ok(Some(_)) if whole => {
                unusable.push(format!(
                    "{name}: is a summary, and this estimator looks at single samples: give the log itself"
                ));
                continue;
            }
            Ok(Some(read)) => {
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
            Err(reason) => {
                unusable.push(format!("{name}: {reason}"));
                continue;
            }
        }
        let mut findings = Vec::new();
        match read_log(file, body.arm(), &mut findings) {
            Err(LogError(reasons)) => unusable.extend(reasons.iter().map(ToString::to_string)),
            Ok(log) => {
                warnings.extend(findings.iter().map(ToString::to_string));
                // A log and its summary must come to the same.
                match reduce_in_bands(&body, &log, options) {
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
                    shown.push(log);
                }
            }
        }
    }
    if !unusable.is_empty() {
        return Err(Failure::Unusable(unusable.join("\n")));
    }
    if bands.widest().logs.is_empty() {
        return Err(Failure::Refused(refused.join("\n")));
    }
    warnings.extend(refused.into_iter().map(|r| format!("{r}; the log was left out")));
    warnings.extend(rests(&body, bands.widest(), &shown));
    Ok(Reduced { body, bands, logs: shown, warnings })
}

/// Reduces logs that were read already.
pub(crate) fn in_memory(
    body: RigidBody,
    logs: Vec<Log>,
    mut warnings: Vec<String>,
    options: &DataOptions,
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
    warnings.extend(rests(&body, bands.widest(), &logs));
    Ok(Reduced { body, bands, logs, warnings })
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
                    "joint {} rests in these logs: neither its friction nor any effect on it can be judged; record paths on which it \
                     swings (powerball excite)",
                    j + 1
                )
            };
            let why = silent.get(j).cloned().flatten().or_else(|| summary.silent[j].clone());
            notes.push(why.unwrap_or_else(rests));
        } else if rested * 4 > summary.samples {
            notes.push(format!(
                "joint {} rests in {:.0} % of the samples ({} s or longer, or at an end of a log); they were left out",
                j + 1,
                100.0 * rested as f64 / summary.samples as f64,
                rest::LONGEST_REVERSAL
            ));
        }
    }
    notes
}
