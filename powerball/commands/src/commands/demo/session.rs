//! A recording session on the virtual arm: several exciting paths, some to fit and some to hold out, with an
//! effect that the model does not know. The arm is on a CAN bus in memory and is driven and recorded as the
//! real one is.

use crate::procedure::{Columns, Envelope, LogTime, RecordError, Recorder, way};
use chacha20::ChaCha8Rng;
use dyngen::{Model, SetKind};
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::driver::{Driver, Refusal};
use powerball_bus::transport::{ArmError, Master, Memory};
use powerball_identification::excite::{self, ExcitationSettings};
use powerball_logs::motion::Motion;
use powerball_virtual_arm::slave::Setup;
use powerball_virtual_arm::{Plant, PlantEffect as Effect, Undeclared, VirtualArm, lwa4p};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;
use std::io;
use std::path::{Path, PathBuf};

/// The paths in the order in which they are recorded: whether one is held out, and its period in s. Held-out
/// paths lie between the others, so that what begins at some time is seen in both, and have a frequency of
/// their own.
const PATHS: [(bool, f64); 8] = [
    (false, 10.0),
    (false, 11.0),
    (true, 9.0),
    (false, 10.0),
    (true, 12.0),
    (false, 9.5),
    (false, 10.5),
    (true, 11.5),
];
/// The path, one to fit, during which something may begin.
const BEGINS_IN: usize = 3;
/// Between two logs the arm goes to where the next one begins: in this many seconds at least, and at this
/// share of its velocity.
const PAUSE: f64 = 3.0;
const SHARE: f64 = 0.5;
/// Paths tried for each log: enough for a condition number near the best, in a fraction of a second.
const EVALUATIONS: usize = 300;
/// Paths are drawn this many times where the arm is stopped on them.
const ATTEMPTS: u64 = 6;

/// The recorded logs, with the effect in the plant.
#[derive(Clone, Debug)]
pub struct Session {
    /// The plant with its effect.
    pub plant: Plant,
    /// The effect in the plant that the model does not have.
    pub effect: Effect,
    /// The effect as a file, with the arm's age at the end of the session.
    pub undeclared: Undeclared,
    /// The arm file as the model knows it.
    pub arm_file: PathBuf,
    /// Logs to fit.
    pub fit: Vec<PathBuf>,
    /// Logs of other paths, held out.
    pub held_out: Vec<PathBuf>,
    /// Condition number of the regressor along each path, in the order of recording.
    pub conditions: Vec<f64>,
    /// Time recorded, s.
    pub recorded: f64,
}

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// No path could be found.
    #[error("{0}")]
    Excitation(excite::Error),
    /// The built-in arm file has errors.
    #[error("{0}")]
    Arm(dyngen::Diagnostics),
    /// No effect has this name.
    #[error("no effect is called {}; there are {}", .0, Effect::NAMES.join(", "))]
    UnknownEffect(String),
    /// A file could not be written.
    #[error("{} cannot be written: {}", .0.display(), .1)]
    Write(PathBuf, io::Error),
    /// The driver refuses its own profile.
    #[error("{0}")]
    Driver(Refusal),
    /// A recording failed.
    #[error("{0}")]
    Record(RecordError),
}

impl From<excite::Error> for SessionError {
    fn from(e: excite::Error) -> Self {
        SessionError::Excitation(e)
    }
}

impl From<dyngen::Diagnostics> for SessionError {
    fn from(e: dyngen::Diagnostics) -> Self {
        SessionError::Arm(e)
    }
}

impl From<RecordError> for SessionError {
    fn from(e: RecordError) -> Self {
        SessionError::Record(e)
    }
}

impl Session {
    /// Draws an effect by `seed` among those `named`, records all paths, and writes the logs, the arm file
    /// and the undeclared effect into `folder`, which must exist.
    ///
    /// # Errors
    /// A name that no effect has, a file that cannot be written.
    pub fn record(folder: &Path, seed: u64, named: &[&str]) -> Result<Session, SessionError> {
        let mut attempt = 0;
        loop {
            match Self::record_along(folder, seed, attempt, named) {
                // What the model lacks may be too much for a joint on these paths; others need less.
                Err(SessionError::Record(RecordError::Arm(ArmError::Stopped(..))))
                    if attempt + 1 < ATTEMPTS =>
                {
                    attempt += 1;
                }
                done => return done,
            }
        }
    }

    /// Like [`Self::record`], along the paths of one attempt.
    fn record_along(folder: &Path, seed: u64, attempt: u64, named: &[&str]) -> Result<Session, SessionError> {
        let arm_file = folder.join("arm.toml");
        save(&arm_file, lwa4p::ARM_FILE)?;
        let model = Model::derive(lwa4p::arm()?).map_err(excite::Error::Model)?;

        let settings: Vec<ExcitationSettings> = (PATHS.iter().enumerate())
            .map(|(k, (_, period))| ExcitationSettings {
                harmonics: 5,
                fundamental: TAU / period,
                evaluations: EVALUATIONS,
                seed: seed.wrapping_mul(PATHS.len() as u64).wrapping_add(k as u64 + (attempt << 48)),
                ..ExcitationSettings::default()
            })
            .collect();
        let found = powerball_logs::parallel::map(&settings, |settings| {
            excite::optimise(&model, SetKind::Minimal, settings)
        });
        let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;

        let plant = lwa4p::plant()?;
        let motions: Vec<Motion> =
            found.iter().flat_map(|f| &f.paths).map(|path| path.sample(plant.sensors().rate)).collect();
        let ends: Vec<[[f64; 6]; 2]> = motions.iter().map(ends).collect();
        let starts = starts(&motions, &ends);
        let session = starts.last().map_or(0.0, |last| last + motions.last().map_or(0.0, Motion::duration));
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let name = named.choose(&mut rng).copied().unwrap_or_default();
        // What begins at some time begins while a log is recorded that will be fitted, with logs before and
        // after.
        let begins = starts[BEGINS_IN] + PAUSE..starts[BEGINS_IN] + motions[BEGINS_IN].duration() - PAUSE;
        let effect = lwa4p::draw_effect(name, &plant, session, begins, &mut rng)
            .ok_or_else(|| SessionError::UnknownEffect(name.to_string()))?;
        let plant = plant.with(effect.clone());

        let setup = Setup { plant: plant.clone(), ..lwa4p::setup(ends[0][0], rng.random())? };
        let arm = VirtualArm::new(setup).ok_or_else(|| {
            SessionError::Arm(dyngen::Diagnostics::whole_file("lwa4p.toml", "six joints are needed"))
        })?;
        let driver = Driver::new(LWA4P).map_err(SessionError::Driver)?;
        let bus = Memory::new(arm, LWA4P.bitrate);
        // Nothing stands around a simulated arm.
        let mut recorder = Recorder::enable(Master::new(driver, bus), Envelope::new(|_| None))?;
        recorder.go(&ends[0][0], SHARE, PAUSE)?;
        recorder.master_mut().bus_mut().peer_mut().set_age(0.0);

        let (mut fit, mut held_out) = (Vec::new(), Vec::new());
        for (k, (is_held_out, _)) in PATHS.iter().enumerate() {
            let (list, word) = if *is_held_out { (&mut held_out, "held_out") } else { (&mut fit, "fit") };
            let path = folder.join(format!("{word}_{}.csv", list.len() + 1));
            if k > 0 {
                recorder.go(&ends[k][0], SHARE, PAUSE)?;
            }
            let unwritten = |e| SessionError::Write(path.clone(), e);
            let mut file = std::fs::File::create(&path).map_err(unwritten)?;
            let motion = recorder.clear(motions[k].clone())?;
            match recorder.record(&motion, &mut LogTime::from(starts[k]), Columns::Torques, &mut file) {
                Err(RecordError::Write(e)) => return Err(unwritten(e)),
                done => done?,
            };
            list.push(path);
        }
        recorder.finish()?;
        let recorded = found.iter().flat_map(|f| &f.paths).map(|path| path.duration()).sum();
        let undeclared = Undeclared { effect: effect.clone(), age: session };
        let text = serde_json::to_string_pretty(&undeclared).unwrap_or_default();
        save(&folder.join(Undeclared::FILE), &text)?;
        let conditions = found.iter().map(|f| f.figures.condition).collect();
        Ok(Session { plant, effect, undeclared, arm_file, fit, held_out, conditions, recorded })
    }
}

/// The first and the last position of a motion.
fn ends(motion: &Motion) -> [[f64; 6]; 2] {
    let at = |place: usize| std::array::from_fn(|i| motion.q.get(place + i).copied().unwrap_or(0.0));
    [at(0), at(motion.q.len().saturating_sub(6))]
}

/// When each motion begins, s after the first, with the ways between them. A motion of n samples takes n + 1
/// cycles.
fn starts(motions: &[Motion], ends: &[[[f64; 6]; 2]]) -> Vec<f64> {
    let mut cycles = 0;
    let mut starts = Vec::new();
    for (k, motion) in motions.iter().enumerate() {
        if k > 0 {
            cycles += way(&LWA4P, &ends[k - 1][1], &ends[k][0], SHARE, PAUSE).len() + 1;
        }
        starts.push(cycles as f64 * LWA4P.period_seconds());
        cycles += motion.len() + 1;
    }
    starts
}

fn save(path: &Path, text: &str) -> Result<(), SessionError> {
    std::fs::write(path, text).map_err(|e| SessionError::Write(path.to_path_buf(), e))
}
