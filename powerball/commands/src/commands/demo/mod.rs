//! The whole loop on the virtual arm: an effect that the model lacks, found again from the logs alone, and
//! the arm moved with the explained model.

mod driven;
mod session;
mod verdict;

use crate::procedure::{Envelope, record};
pub use driven::Driven;
use dyngen::Arm;
use powerball_bus::driver::Driver;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{Master, Memory};
use powerball_explanation::experiment::{self, TRAJECTORY};
use powerball_explanation::explain::Explained;
use powerball_explanation::{ExplainError, ExplainOptions, Prepared, effects, explain_body};
use powerball_identification::{IdentifyError, IdentifyOptions, identify};
use powerball_logs::Progress;
use powerball_logs::log::{LogError, read_logs};
use powerball_logs::motion::Motion;
use powerball_virtual_arm::PlantEffect as Effect;
use serde::Serialize;
pub use session::{Session, SessionError};
use std::path::{Path, PathBuf};
pub use verdict::{Judgement, Verdict, page};

/// The effect in the plant, the effects found, and whether they are right.
#[derive(Debug)]
pub struct Demo {
    /// The recording session with the truth.
    pub session: Session,
    /// The explanation of the logs, from the logs alone.
    pub explained: Explained,
    /// Both compared.
    pub verdict: Verdict,
    /// The arm moved with the base model and with the explained one, or why it was not.
    pub driven: Result<Driven, String>,
}

/// Why the demo broke.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// No session could be recorded.
    #[error("{0}")]
    Session(SessionError),
    /// The recorded files could not be read.
    #[error("{0}")]
    Read(String),
    /// The logs hold too little.
    #[error("{0}")]
    Explain(ExplainError),
    /// The logs hold too little for a base model.
    #[error("{0}")]
    Identify(IdentifyError),
    /// The arm was not moved with a model.
    #[error("{0}")]
    Drive(String),
}

impl From<SessionError> for DemoError {
    fn from(e: SessionError) -> Self {
        DemoError::Session(e)
    }
}

impl From<LogError> for DemoError {
    fn from(e: LogError) -> Self {
        DemoError::Read(e.to_string())
    }
}

impl From<IdentifyError> for DemoError {
    fn from(e: IdentifyError) -> Self {
        DemoError::Identify(e)
    }
}

impl From<ExplainError> for DemoError {
    fn from(e: ExplainError) -> Self {
        DemoError::Explain(e)
    }
}

/// The names that a demo draws from: effects that the plant has and the residual loop knows.
pub fn names<'a>() -> Vec<&'a str> {
    let known = effects::all();
    let chosen = Effect::chosen_by_seed().iter().copied();
    chosen.filter(|name| known.iter().any(|effect| effect.name() == *name)).collect()
}

/// Records a session with an effect drawn by `seed`, or with the one of the given name, into `folder`, and
/// explains it from the files alone, as a user would. Then the same arm is moved with the base model and with
/// the explained one. If names stay open, the trajectory that distinguishes them is written there as well,
/// and `with_experiment` runs it on the same arm and lets it decide.
///
/// # Errors
/// Only if a step failed; a wrong name is a result.
pub fn run(
    folder: &Path,
    seed: u64,
    name: Option<&str>,
    with_experiment: bool,
    progress: Progress<'_>,
) -> Result<Demo, DemoError> {
    progress.say("searching exciting paths and recording them");
    let names: Vec<&str> = name.map_or_else(names, |name| vec![name]);
    let session = Session::record(folder, seed, &names)?;
    progress.say("reading the logs");
    let arm = Arm::read(&session.arm_file).map_err(|e| DemoError::Read(e.to_string()))?;
    let files: Vec<_> = session.fit.iter().chain(&session.held_out).collect();
    let (mut logs, _) = read_logs(&files, &arm)?;
    let held_out = logs.split_off(session.fit.len());
    progress.say("identifying the base model");
    let base = driven::base_model(&arm, &identify(&arm, &logs, [], &IdentifyOptions::default())?)?;
    let base = save(folder, "base.json", &base)?;
    let options = ExplainOptions { progress, ..ExplainOptions::default() };
    let prepared = Prepared::new(&arm, &logs, &held_out, &options)?;
    let Prepared { body, logs, validate, .. } = &prepared;
    let mut explained = explain_body(body, logs, validate, &options)?;
    if let Some(motion) = experiment::propose(body, &mut explained, &options) {
        let next_file = folder.join(TRAJECTORY);
        write(&next_file, &motion.to_csv())?;
        if with_experiment {
            progress.say("recording the experiment");
            let log = carry_out(&session, &motion, &folder.join("experiment.csv"), seed)?;
            let (mut new, _) = read_logs(&[log], &arm)?;
            let Some(new) = new.pop() else {
                return Err(DemoError::Read("experiment.csv is missing".into()));
            };
            explained = experiment::learn(body, (logs, validate), new, &explained, &options)?;
            if let Some(next) = experiment::propose(body, &mut explained, &options) {
                write(&next_file, &next.to_csv())?;
            }
        }
    }
    let explained = prepared.with_known(explained);
    let model = save(folder, "model.json", &explained.model)?;
    let verdict = Verdict::new(&session.effect, &explained);
    progress.say("moving the arm with both models");
    let driven = driven::drive(&session, folder, [&base, &model], seed).map_err(|e| e.to_string());
    Ok(Demo { session, explained, verdict, driven })
}

/// Writes a result into the folder.
fn save(folder: &Path, name: &str, what: &impl Serialize) -> Result<PathBuf, DemoError> {
    let file = folder.join(name);
    let text = serde_json::to_string_pretty(what).map_err(|e| DemoError::Read(format!("{name}: {e}")))?;
    write(&file, &text)?;
    Ok(file)
}

fn write(file: &Path, text: &str) -> Result<(), DemoError> {
    Ok(std::fs::write(file, text).map_err(|e| SessionError::Write(file.to_path_buf(), e))?)
}

/// Runs a motion on the arm of a session, after it, and logs it.
fn carry_out(session: &Session, motion: &Motion, file: &Path, seed: u64) -> Result<PathBuf, DemoError> {
    let unwritten = |e| SessionError::Write(file.to_path_buf(), e);
    let arm = session.undeclared.arm([0.0; 6], seed.wrapping_add(1), false).map_err(SessionError::Arm)?;
    let driver = Driver::new(LWA4P).map_err(SessionError::Driver)?;
    let master = Master::new(driver, Memory::new(arm, LWA4P.bitrate));
    let mut log = std::fs::File::create(file).map_err(unwritten)?;
    record(master, motion, Envelope::new(|_| None), |_| (), &mut log).map_err(SessionError::Record)?;
    Ok(file.to_path_buf())
}
