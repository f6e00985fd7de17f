//! Logs of the virtual arm along exciting paths, with a truth scaled to a wanted size.

use super::alike;
use super::arms::{DRAWS, Drawn, LARGEST_FACTOR};
use super::case::{Case, Table};
use super::judge::{Named, Outcome};
use super::law::{ExtraTorque, Misfit, OtherFriction, OtherLaw, Outside, OutsideLaw};
use chacha20::ChaCha8Rng;
use dyngen::{Arm, Model, SetKind};
use powerball::controller::friction::TanhFriction;
use powerball::explanation::{ExplainOptions, explain_body};
use powerball::identification::estimate::{Folds, fit, residual_stats};
use powerball::identification::excite::{ExcitationSettings, optimise};
use powerball::identification::motion::Motion;
use powerball::logs::log::{Log, common_clock};
use powerball::logs::regression::{Data, DataOptions, RigidArm, Signals};
use powerball::virtual_arm::{Plant, PlantEffect as Effect, Sensors, lwa4p};
use rand::RngExt;
use std::f64::consts::TAU;
use std::path::Path;
use std::time::Instant;

/// The usual torque of a drawn arm's joint over its white noise.
const USUAL: f64 = 100.0;
/// Paths of a session: those to fit, then those held out. Periods, s.
const FIT: [f64; 5] = [10.0, 11.0, 9.5, 10.5, 9.0];
const HELD_OUT: [f64; 2] = [12.0, 11.5];
/// Between two logs, s.
const PAUSE: f64 = 5.0;
/// The search for a path: enough for a condition number near the best.
const EVALUATIONS: usize = 60;
/// Logs that leave names open: on paths that leave this share of range, velocity and acceleration unused.
const NARROW: f64 = 0.7;
/// Rounds in which a truth is scaled to its size.
const ROUNDS: usize = 4;
/// The band in which a size is measured, without noise: wide enough for the ripple of gears.
const WIDE: DataOptions = DataOptions { cutoff: 60.0, smoothing: 60.0, block: 2.0 };

/// What every case needs.
pub(super) struct Bench {
    model: Model,
    body: RigidArm,
    plant: Plant,
    /// Where the arm was drawn by lot.
    drawn: Option<Drawn>,
}

/// What is in the plant in addition to what its model knows.
#[derive(Clone, Debug)]
enum Truth {
    Effect(Effect),
    Law(OutsideLaw),
}

impl Truth {
    fn scaled(&self, factor: f64) -> Truth {
        match self {
            Truth::Effect(effect) => Truth::Effect(effect.scaled(factor)),
            Truth::Law(law) => Truth::Law(law.scaled(factor)),
        }
    }

    /// The joint of the effect, from 0, where it is of one alone.
    fn joint(&self) -> Option<usize> {
        match self {
            Truth::Effect(effect) => match effect.joints()[..] {
                [joint] => Some(joint - 1),
                _ => None,
            },
            Truth::Law(law) => Some(law.joint),
        }
    }

    fn words(&self) -> String {
        match self {
            Truth::Effect(effect) => {
                let joints: Vec<String> = effect.joints().iter().map(ToString::to_string).collect();
                format!("joint {}: {}", joints.join(","), effect.describe())
            }
            Truth::Law(law) => {
                format!("joint {}: {} of {:.2} N·m", law.joint + 1, law.kind.name(), law.amplitude)
            }
        }
    }
}

/// A session on one arm: its paths, and what of its logs is not the plant's.
struct Session {
    plant: Plant,
    friction: Option<OtherLaw>,
    misfit: Option<Misfit>,
    /// What the torque sensors tell where there is no torque, N·m by joint.
    zeros: Vec<f64>,
    motions: Vec<Motion>,
    starts: Vec<f64>,
    /// Logs that are fitted; the others are held out.
    fitted: usize,
    /// Whether truths stay as large as they were drawn.
    as_drawn: bool,
    seed: u64,
}

/// What a case's logs are made of.
struct Recorded {
    session: Session,
    truths: Vec<Truth>,
    sizes: Vec<f64>,
}

/// What is in logs that were written.
pub(super) struct Written {
    /// Each truth in words.
    pub(super) words: Vec<String>,
    /// The visible size of each truth.
    pub(super) sizes: Vec<f64>,
    /// Held-out errors without it, by joint, N·m.
    pub(super) clean: Vec<f64>,
}

impl Bench {
    pub(super) fn new() -> Result<Bench, String> {
        let arm = lwa4p::arm().map_err(|e| e.to_string())?;
        Bench::of(arm, lwa4p::plant().map_err(|e| e.to_string())?, None)
    }

    fn of(arm: Arm, plant: Plant, drawn: Option<Drawn>) -> Result<Bench, String> {
        let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
        let model = Model::derive(arm).map_err(|e| e.to_string())?;
        Ok(Bench { model, body, plant, drawn })
    }

    /// The bench of a case: another one where the arm is drawn by lot.
    fn drawn(case: &Case) -> Result<Option<Bench>, String> {
        if !case.table.draws_arms() {
            return Ok(None);
        }
        let drawn = Drawn::new(&mut case.rng())?;
        Bench::of(drawn.arm.clone(), drawn.plant.clone(), Some(drawn)).map(Some)
    }

    /// Runs a case of simulated logs; `None` where no truth of its kind can be seen on the arm that was
    /// drawn.
    pub(super) fn run(&self, case: &Case) -> Result<Option<Outcome>, String> {
        let drawn = Bench::drawn(case)?;
        drawn.as_ref().unwrap_or(self).run_here(case)
    }

    fn run_here(&self, case: &Case) -> Result<Option<Outcome>, String> {
        let Some(Recorded { session, truths, sizes }) = self.recorded(case)? else { return Ok(None) };
        let logs = session.logs(&truths, true);
        let (to_fit, held_out) = logs.split_at(session.fitted);
        let start = Instant::now();
        let explained = explain_body(&self.body, to_fit, held_out, &ExplainOptions::default())
            .map_err(|e| e.to_string())?;
        let (explained, refined) = if case.table == Table::Alike {
            let record = |motion: &Motion| session.new_log(motion, &truths);
            let (again, refined) = alike::refine(&self.body, (to_fit, held_out), explained, record)?;
            (again, Some(refined))
        } else {
            (explained, None)
        };
        let seconds = start.elapsed().as_secs_f64();
        let clean = self.clean_errors(&session)?;
        let over = explained.after.validate.rms.iter().zip(&clean).map(|(a, c)| a / c).fold(0.0, f64::max);
        let words = truths.iter().map(Truth::words).collect();
        let outcome =
            Outcome::new(case, words, sizes, &explained, &session.known(&case.kinds), over, seconds);
        Ok(Some(Outcome { refined, ..outcome }))
    }

    /// What a case's logs are made of; `None` where no truth of its kind can be seen on the arm that was
    /// drawn.
    fn recorded(&self, case: &Case) -> Result<Option<Recorded>, String> {
        let mut rng = case.rng();
        let mut session = self.session(case, &mut rng)?;
        if case.table == Table::Misfit {
            session.misfit = Some(self.misfit(&session, &mut rng)?);
        }
        let (mut truths, mut sizes) = (Vec::new(), Vec::new());
        for (kind, size) in case.kinds.iter().zip(&case.sizes) {
            // Half of them where the one before is.
            let together = case.table == Table::Drawn && rng.random_bool(0.5);
            let on = if together { truths.last().and_then(Truth::joint) } else { None };
            let Some((truth, reached)) = self.truth(&session, kind, on, *size, &mut rng)? else {
                return Ok(None);
            };
            truths.push(truth);
            sizes.push(reached);
        }
        Ok(Some(Recorded { session, truths, sizes }))
    }

    /// Held-out errors of the base model where nothing is missing, by joint, N·m.
    fn clean_errors(&self, session: &Session) -> Result<Vec<f64>, String> {
        let clean = session.logs(&[], true);
        self.errors(&clean[..session.fitted], &clean[session.fitted..], &DataOptions::default())
    }

    /// Writes a case as files: the arm, logs to fit and logs to judge on. Returns what is in them; `None` as
    /// for [`Bench::run`].
    pub(super) fn write(&self, case: &Case, folder: &Path) -> Result<Option<Written>, String> {
        let drawn = Bench::drawn(case)?;
        drawn.as_ref().unwrap_or(self).write_here(case, folder)
    }

    fn write_here(&self, case: &Case, folder: &Path) -> Result<Option<Written>, String> {
        let Some(Recorded { session, truths, sizes }) = self.recorded(case)? else { return Ok(None) };
        let failed = |path: &Path, e: std::io::Error| format!("{}: {e}", path.display());
        std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
        let arm = folder.join("arm.toml");
        let text = self.drawn.as_ref().map_or(lwa4p::ARM_FILE, |drawn| &drawn.text);
        std::fs::write(&arm, text).map_err(|e| failed(&arm, e))?;
        for (k, mut log) in session.logs(&truths, true).into_iter().enumerate() {
            let kind = if k < session.fitted { "fit" } else { "validate" };
            let path = folder.join(format!("{kind}{k}.csv"));
            let clock = log.clock;
            log.t.iter_mut().for_each(|t| *t += clock);
            log.write(&path).map_err(|e| failed(&path, e))?;
        }
        let words = truths.iter().map(Truth::words).collect();
        Ok(Some(Written { words, sizes, clean: self.clean_errors(&session)? }))
    }

    fn session(&self, case: &Case, rng: &mut ChaCha8Rng) -> Result<Session, String> {
        let mut plant = self.plant.clone();
        let friction: Vec<TanhFriction<f64>> = (plant.friction().iter())
            .map(|f| {
                let mut share = || rng.random_range(0.6..1.5);
                TanhFriction::new([
                    f.gamma1 * share(),
                    f.gamma2 * share(),
                    f.gamma3 * share(),
                    f.gamma4 * share(),
                    f.gamma5 * share(),
                ])
            })
            .collect();
        let mut sensors = plant.sensors().clone();
        match case.table {
            Table::Coloured | Table::ColouredEffect => draw_colour(&mut sensors, rng),
            Table::Drawn | Table::CleanDrawn => draw_sensors(&mut sensors, rng),
            _ => sensors.coloured.fill(0.0),
        }
        let mut zeros = vec![0.0; friction.len()];
        let mut periods: Vec<f64> = FIT.iter().chain(&HELD_OUT).copied().collect();
        let mut fitted = FIT.len();
        if case.table.draws_logs() {
            let usual = sensors.white.iter().map(|white| USUAL * white);
            zeros = usual.map(|usual| usual * rng.random_range(-0.2..0.2)).collect();
            fitted = rng.random_range(3..=5);
            periods = (0..fitted + HELD_OUT.len()).map(|_| rng.random_range(2.5..10.0)).collect();
        }
        plant = Plant::new(plant.dynamics().clone(), friction, sensors);
        let mut motions = Vec::new();
        for period in periods {
            let settings = ExcitationSettings {
                harmonics: 5,
                fundamental: TAU / period,
                evaluations: EVALUATIONS,
                seed: rng.random(),
                margin: if case.table == Table::Alike {
                    NARROW
                } else {
                    ExcitationSettings::default().margin
                },
                ..ExcitationSettings::default()
            };
            let found = optimise(&self.model, SetKind::Minimal, &settings).map_err(|e| e.to_string())?;
            motions.push(found.paths[0].sample(plant.sensors().rate));
        }
        let mut starts = Vec::new();
        let mut now = 0.0;
        for motion in &motions {
            starts.push(now);
            now += motion.duration() + PAUSE;
        }
        let other = case.table == Table::Friction || case.table.draws_logs() && rng.random_bool(0.5);
        let friction = other.then(|| OtherLaw::draw(rng));
        Ok(Session {
            plant,
            friction,
            misfit: None,
            zeros,
            motions,
            starts,
            fitted,
            as_drawn: case.table.draws_logs(),
            seed: rng.random(),
        })
    }

    /// A misfit that is as large on every joint as the noise allows: 0.3 of it, after the base was refitted.
    fn misfit(&self, session: &Session, rng: &mut ChaCha8Rng) -> Result<Misfit, String> {
        let mut misfit = Misfit::draw(session.plant.friction().len(), rng);
        let plain = self.base(session, &[])?;
        for _ in 0..2 {
            let with = Session { misfit: Some(misfit.clone()), ..session.alone() };
            let left = self.visible(&with, &[], &plain)?;
            misfit.amplitude.iter_mut().zip(left).for_each(|(a, left)| *a *= 0.3 / left);
        }
        Ok(misfit)
    }

    /// A truth of that kind and the size that it reached: visible size `size`, or at least that where it
    /// stays as it was drawn. `None` where the arm has none. It sits on joint `on` where an arm that was
    /// drawn is given one and the kind is of one joint.
    fn truth(
        &self,
        session: &Session,
        kind: &str,
        on: Option<usize>,
        size: f64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<(Truth, f64)>, String> {
        let end = session.starts.last().copied().unwrap_or(0.0)
            + session.motions.last().map_or(0.0, Motion::duration);
        let middle = session.fitted / 2;
        let (start, length) = (session.starts[middle], session.motions[middle].duration());
        let aside = f64::min(3.0, 0.2 * length);
        let begins = start + aside..start + length - aside;
        let quiet = session.alone();
        let plain = self.base(&quiet, &[])?;
        for _ in 0..DRAWS {
            let truth = match Outside::ALL.into_iter().find(|law| law.name() == kind) {
                Some(law) => Truth::Law(OutsideLaw::draw(law, &session.plant, rng)),
                None => {
                    let places = self.drawn.as_ref().map_or_else(lwa4p::places, |drawn| drawn.places(on));
                    match Effect::draw(kind, &session.plant, &places, end, begins.clone(), rng) {
                        Some(effect) => Truth::Effect(effect),
                        None if self.drawn.is_some() => return Ok(None),
                        None => return Err(format!("no effect is called {kind}")),
                    }
                }
            };
            if session.as_drawn {
                let reached = self
                    .visible(&quiet, std::slice::from_ref(&truth), &plain)?
                    .into_iter()
                    .fold(0.0, f64::max);
                if reached >= size {
                    return Ok(Some((truth, reached)));
                }
                continue;
            }
            let (truth, reached, factor) = self.scaled(&quiet, truth, size, &plain)?;
            // On an arm of any kind many a truth is a part of the base model, or next to nothing compared
            // with it.
            if self.drawn.is_none() || ((0.8..1.25).contains(&(reached / size)) && factor < LARGEST_FACTOR) {
                return Ok(Some((truth, reached)));
            }
        }
        Ok(None)
    }

    /// A truth scaled until its visible size is `size`, the size that it reached, and by how much it was
    /// scaled.
    fn scaled(
        &self,
        quiet: &Session,
        mut truth: Truth,
        size: f64,
        plain: &[Vec<f64>],
    ) -> Result<(Truth, f64, f64), String> {
        let (mut reached, mut factor) = (0.0, 1.0);
        for _ in 0..ROUNDS {
            reached =
                self.visible(quiet, std::slice::from_ref(&truth), plain)?.into_iter().fold(0.0, f64::max);
            if (reached / size - 1.0).abs() < 0.03 || reached <= 0.0 {
                break;
            }
            truth = truth.scaled(size / reached);
            factor *= size / reached;
        }
        Ok((truth, reached, factor))
    }

    /// What of truths is left on the fitted logs when the base model was refitted, without noise and in a
    /// wide band, over the noise of a sample, by joint; `plain` is what the model leaves without them.
    fn visible(&self, session: &Session, truths: &[Truth], plain: &[Vec<f64>]) -> Result<Vec<f64>, String> {
        let with = self.base(session, truths)?;
        let sensors = session.plant.sensors();
        let noise = sensors.white.iter().zip(&sensors.coloured).map(|(w, c)| w.hypot(*c));
        let change = with.iter().zip(plain).map(|(with, without)| {
            let squares = with.iter().zip(without).map(|(a, b)| (a - b).powi(2));
            (squares.sum::<f64>() / without.len().max(1) as f64).sqrt()
        });
        Ok(change.zip(noise).map(|(change, noise)| change / noise).collect())
    }

    /// The residual of the base model on the fitted logs, without noise and in a wide band.
    fn base(&self, session: &Session, truths: &[Truth]) -> Result<Signals, String> {
        let logs = session.logs(truths, false);
        let data = Data::new(&self.body, &logs[..session.fitted], &WIDE).map_err(|e| e.to_string())?;
        Ok(fit(&data, &Folds::new(&data), &[], None).residual)
    }

    /// Errors of the base model held out.
    fn errors(&self, to_fit: &[Log], held_out: &[Log], options: &DataOptions) -> Result<Vec<f64>, String> {
        let data = Data::new(&self.body, to_fit, options).map_err(|e| e.to_string())?;
        let other = Data::new(&self.body, held_out, options).map_err(|e| e.to_string())?;
        let base = fit(&data, &Folds::new(&data), &[], None);
        Ok(residual_stats(&other, &base.residual_on(&other, &[])).rms)
    }
}

impl Session {
    /// This session with nothing in addition to the plant that the model knows.
    fn alone(&self) -> Session {
        Session {
            plant: self.plant.clone(),
            friction: None,
            misfit: None,
            zeros: vec![0.0; self.zeros.len()],
            motions: self.motions.clone(),
            starts: self.starts.clone(),
            fitted: self.fitted,
            as_drawn: self.as_drawn,
            seed: self.seed,
        }
    }

    /// What is there in addition to the truths: zeros of torque sensors, which are called `asymmetry`.
    fn known(&self, kinds: &[String]) -> Vec<Named> {
        const NAME: &str = "asymmetry";
        let off = (0..self.zeros.len()).filter(|joint| self.zeros[*joint] != 0.0);
        // Where it is a truth as well, one name says both.
        match kinds.iter().any(|kind| kind == NAME) {
            true => Vec::new(),
            false => vec![Named::additional(NAME, off.map(|joint| joint + 1).collect())],
        }
    }

    /// The log of one more motion after all others.
    fn new_log(&self, motion: &Motion, truths: &[Truth]) -> Log {
        let end = self.starts.iter().zip(&self.motions).map(|(s, m)| s + m.duration()).fold(0.0, f64::max);
        let next = Session {
            motions: vec![motion.clone()],
            starts: vec![end + PAUSE],
            seed: self.seed.wrapping_add(1000),
            ..self.alone()
        };
        let mut log = next.logs(truths, true).swap_remove(0);
        log.file = "experiment.csv".into();
        log
    }

    /// The logs, with noise or without.
    fn logs(&self, truths: &[Truth], noisy: bool) -> Vec<Log> {
        let mut sensors = self.plant.sensors().clone();
        if !noisy {
            sensors.encoder_step = 0.0;
            sensors.white.fill(0.0);
            sensors.coloured.fill(0.0);
        }
        let mut plant = Plant::new(self.plant.dynamics().clone(), self.plant.friction().to_vec(), sensors);
        for truth in truths {
            if let Truth::Effect(effect) = truth {
                plant = plant.with(effect.clone());
            }
        }
        let mut logs: Vec<Log> = Vec::new();
        for (k, (motion, start)) in self.motions.iter().zip(&self.starts).enumerate() {
            let mut recording = plant.record(motion, *start, self.seed.wrapping_add(k as u64));
            let mut add = |law: &dyn ExtraTorque| {
                let torques = law.torques(motion, *start);
                recording.tau.iter_mut().zip(torques).for_each(|(tau, t)| *tau += t);
            };
            for truth in truths {
                if let Truth::Law(law) = truth {
                    add(law);
                }
            }
            if let Some(misfit) = &self.misfit {
                add(misfit);
            }
            if let Some(law) = self.friction {
                add(&OtherFriction { law, plant: &self.plant });
            }
            let rows = recording.tau.chunks_exact_mut(self.zeros.len());
            rows.for_each(|row| row.iter_mut().zip(&self.zeros).for_each(|(tau, zero)| *tau += zero));
            logs.push(recording.log(format!("log{k}.csv")));
        }
        common_clock(&mut logs);
        logs
    }
}

/// Noise and rate as on arms that people have.
fn draw_sensors(sensors: &mut Sensors, rng: &mut ChaCha8Rng) {
    sensors.rate = [100.0, 125.0, 200.0, 250.0, 500.0][rng.random_range(0..5)];
    draw_colour(sensors, rng);
}

fn draw_colour(sensors: &mut Sensors, rng: &mut ChaCha8Rng) {
    let share = rng.random_range(0.3..1.0);
    sensors.coloured = sensors.white.iter().map(|w| share * w).collect();
    sensors.colour_time = rng.random_range(0.05..1.0);
}
