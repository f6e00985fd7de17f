//! A recording session on the virtual arm: several exciting paths, some to fit and some to hold out, with an effect
//! that nobody tells the model.

use crate::excite::{self, Settings};
use crate::virtual_arm::{Effect, Plant, lwa4p};
use dyngen::{Model, SetKind};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::io;
use std::path::{Path, PathBuf};

/// The paths in the order in which they are recorded: whether one is held out, and its period in s. Held-out paths
/// lie between the others, so that what begins at some time is seen in both, and have a frequency of their own.
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
/// Between two logs, s.
const PAUSE: f64 = 3.0;
/// Paths tried for each log: enough for a condition number near the best, in a fraction of a second.
const EVALUATIONS: usize = 300;

/// What was recorded.
#[derive(Clone, Debug)]
pub struct Session {
    /// The plant with its effect.
    pub plant: Plant,
    /// What is in the plant and not in the model.
    pub effect: Effect,
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
#[derive(Debug)]
pub enum SessionError {
    /// No path could be found.
    Excitation(excite::Error),
    /// The built-in arm file has errors.
    Arm(dyngen::Diagnostics),
    /// No effect has this name.
    UnknownEffect(String),
    /// A file could not be written.
    Write(PathBuf, io::Error),
}

impl std::fmt::Display for SessionError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            SessionError::Excitation(e) => e.fmt(f),
            SessionError::Arm(e) => e.fmt(f),
            SessionError::UnknownEffect(name) => {
                write!(f, "no effect is called {name}; there are {}", Effect::NAMES.join(", "))
            }
            SessionError::Write(path, e) => write!(f, "{} cannot be written: {e}", path.display()),
        }
    }
}

impl std::error::Error for SessionError {}

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

impl Session {
    /// Draws an effect by `seed` among those `named`, records all paths, and writes the logs and the arm file into
    /// `folder`, which must exist.
    ///
    /// # Errors
    /// A name that no effect has, a file that cannot be written.
    pub fn record(folder: &Path, seed: u64, named: &[&str]) -> Result<Session, SessionError> {
        let arm_file = folder.join("arm.toml");
        save(&arm_file, lwa4p::ARM_FILE)?;
        let model = Model::derive(lwa4p::arm()?).map_err(excite::Error::Model)?;

        let mut found = Vec::new();
        for (k, (_, period)) in PATHS.iter().enumerate() {
            let settings = Settings {
                harmonics: 5,
                fundamental: TAU / period,
                evaluations: EVALUATIONS,
                seed: seed.wrapping_mul(PATHS.len() as u64).wrapping_add(k as u64),
                ..Settings::default()
            };
            found.push(excite::optimise(&model, SetKind::Minimal, &settings)?);
        }

        let plant = lwa4p::plant()?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let session: f64 = found.iter().map(|f| f.path.duration() + PAUSE).sum();
        let name = named.choose(&mut rng).copied().unwrap_or_default();
        let starts = found.iter().scan(0.0, |end, f| {
            let start = *end;
            *end += f.path.duration() + PAUSE;
            Some(start)
        });
        let starts: Vec<f64> = starts.collect();
        // What begins at some time begins while a log is recorded that will be fitted, with logs before and after.
        let begins = starts[BEGINS_IN] + PAUSE..starts[BEGINS_IN + 1] - 2.0 * PAUSE;
        let effect = Effect::draw_named(name, &plant, session, begins, &mut rng)
            .ok_or_else(|| SessionError::UnknownEffect(name.to_string()))?;
        let plant = plant.with(effect.clone());

        let (mut fit, mut held_out) = (Vec::new(), Vec::new());
        for (((is_held_out, _), found), start) in PATHS.iter().zip(&found).zip(&starts) {
            let (list, word) = if *is_held_out { (&mut held_out, "held_out") } else { (&mut fit, "fit") };
            let log = plant.record(&found.path.sample(plant.sensors().rate), *start, rng.random());
            let path = folder.join(format!("{word}_{}.csv", list.len() + 1));
            save(&path, &log.to_csv())?;
            list.push(path);
        }
        let recorded = found.iter().map(|f| f.path.duration()).sum();
        let conditions = found.iter().map(|f| f.figures.condition).collect();
        Ok(Session { plant, effect, arm_file, fit, held_out, conditions, recorded })
    }
}

fn save(path: &Path, text: &str) -> Result<(), SessionError> {
    std::fs::write(path, text).map_err(|e| SessionError::Write(path.to_path_buf(), e))
}
