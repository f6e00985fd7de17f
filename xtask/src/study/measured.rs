//! Effects put into measured logs: what the plant would add along the motion that was measured is added to
//! what was measured.

use super::arms::{LARGEST_FACTOR, places};
use super::case::{Case, Table};
use super::judge::{Named, Outcome, named};
use dyngen::Arm;
use powerball::controller::friction::TanhFriction;
use powerball::explanation::{ExplainOptions, Explained, explain_body};
use powerball::identification::chain::Chain;
use powerball::identification::estimate::{Folds, FrictionKind, consistent_fit, fit, solve_reduced};
use powerball::identification::motion::Motion;
use powerball::logs::log::{Log, common_clock, read_logs};
use powerball::logs::regression::{Data, DataOptions, Recording, RigidArm, Signals};
use powerball::logs::summary::Summary;
use powerball::virtual_arm::{Dynamics, Places, Plant, PlantEffect as Effect, Sensors, bodies, lwa4p};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The logs of a measured arm: those to fit and those held out are of other paths.
pub(super) struct Source {
    pub(super) folder: &'static str,
    fit: &'static [&'static str],
    held_out: &'static [&'static str],
    /// Further clean logs, which show what the arm has of itself.
    more: &'static [&'static str],
}

/// The logs of the tables that have this arm alone.
pub(super) const UR10E: Source = Source {
    folder: "ur10e",
    fit: &["fourier_12a", "fourier_12b", "fourier_12c", "fourier_7", "fourier_8"],
    held_out: &["fourier_5", "fourier_14"],
    more: &[],
};

/// A few minutes of each arm whose logs stand for more than one path.
pub(super) const SOURCES: [Source; 8] = [
    Source {
        folder: "ur10e",
        fit: &["fourier_12a", "fourier_7", "fourier_8"],
        held_out: &["fourier_5"],
        more: &[],
    },
    Source { folder: "ur5_pushes", fit: &["no7", "no8"], held_out: &["no9"], more: &["no6"] },
    Source { folder: "psm_masses", fit: &["clean"], held_out: &["other"], more: &[] },
    Source { folder: "tx40", fit: &["fit"], held_out: &["validate"], more: &[] },
    Source { folder: "panda", fit: &["fit"], held_out: &["validate"], more: &[] },
    Source {
        folder: "kinova_in_step",
        fit: &["trajectory_1", "trajectory_3", "trajectory_5"],
        held_out: &["trajectory_2", "trajectory_4"],
        more: &[],
    },
    Source { folder: "rokae", fit: &["part_1", "part_2"], held_out: &["part_3"], more: &[] },
    Source {
        folder: "pendulum_A",
        fit: &["sysid_1", "sysid_2", "sysid_3", "sysid_4", "sysid_5"],
        held_out: &["sysid_6", "sysid_7", "sysid_8"],
        more: &[],
    },
];

/// The grid on which the motion is followed, s, and its smoothing, Hz.
const STEP: f64 = 0.005;
const SMOOTHING: f64 = 8.0;
/// As [`SMOOTHING`], where a gear gives way: its way follows the torque, a second derivative, and is
/// differentiated twice itself. The paths end well below.
const SMOOTHING_OF_GEARS: f64 = 3.0;
/// Rounds in which an effect is scaled to its size.
const ROUNDS: usize = 3;
/// Draws until one is an effect that is not in the logs already.
const DRAWS: usize = 20;

/// The measured arm, a plant like it, and what is in its logs already.
pub(super) struct Measured {
    body: RigidArm,
    /// All logs, those to fit first.
    logs: Vec<Log>,
    fitted: usize,
    plant: Plant,
    places: Places,
    explained: Explained,
    known: Vec<Named>,
}

impl Measured {
    /// The arm of a table's logs in a folder below `data`; `None` where they are not there.
    pub(super) fn read(data: &Path, table: Table, folder: &str) -> Result<Option<Measured>, String> {
        let alone = table != Table::MeasuredArms;
        let own = SOURCES.iter().find(|source| source.folder == folder);
        let source = if alone { &UR10E } else { own.ok_or("no such arm")? };
        let folder = data.join(folder);
        let file = folder.join("arm.toml");
        if !file.exists() {
            eprintln!("skipped: no measured logs in {}", folder.display());
            return Ok(None);
        }
        let arm = Arm::read(&file).map_err(|e| e.to_string())?;
        let files: Vec<PathBuf> =
            source.fit.iter().chain(source.held_out).map(|name| folder.join(format!("{name}.csv"))).collect();
        let (mut logs, _) = read_logs(&files, &arm).map_err(|e| e.to_string())?;
        common_clock(&mut logs);
        let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
        let fitted = source.fit.len();
        let options = DataOptions::default();
        let explain = |fit: &[Log], held_out: &[Log]| {
            explain_body(&body, fit, held_out, &ExplainOptions::default()).map_err(|e| e.to_string())
        };
        let (to_fit, held_out) = logs.split_at(fitted);
        let explained = explain(to_fit, held_out)?;
        let plant = {
            let data = Data::new(&body, &logs[..fitted], &options).map_err(|e| e.to_string())?;
            let base = fit(&data, &Folds::new(&data), &[], None);
            let mut summary = Summary::new(&body, &options);
            for log in &logs[..fitted] {
                summary.push(&body, log, &options).map_err(|e| e.to_string())?;
            }
            let reduced = solve_reduced(&summary, FrictionKind::Symmetric);
            let possible = consistent_fit(&body, &reduced).map_err(|e| e.to_string())?;
            let links = bodies(&possible.consistent.all).ok_or("the arm has no bodies")?;
            let dynamics = Dynamics::new(Chain::new(&arm), links).ok_or("the arm is no chain of bodies")?;
            let friction = (0..data.dof()).map(|j| TanhFriction::new(base.friction(j))).collect();
            let sensors = Sensors {
                rate: 1.0 / STEP,
                encoder_step: 0.0,
                white: explained.after.fit.rms.clone(),
                coloured: vec![0.0; data.dof()],
                colour_time: 1.0,
            };
            Plant::new(dynamics, friction, sensors)
        };
        let places = if alone { lwa4p::places() } else { places(&plant, &usual(&logs), None) };
        let mut known = named(&explained);
        if !alone {
            // What the arm has of itself is more than one way of splitting its logs shows.
            let more: Vec<PathBuf> =
                source.more.iter().map(|name| folder.join(format!("{name}.csv"))).collect();
            let (more, _) = read_logs(&more, &arm).map_err(|e| e.to_string())?;
            let mut all: Vec<Log> = logs.iter().cloned().chain(more).collect();
            common_clock(&mut all);
            let mut others = named(&explain(held_out, to_fit)?);
            for _ in 0..all.len() {
                all.rotate_left(1);
                others.extend(named(&explain(&all[1..], &all[..1])?));
            }
            for other in others {
                match known.iter_mut().find(|name| name.effect == other.effect) {
                    Some(name) => name.joints.extend(other.joints),
                    None => known.push(other),
                }
            }
        }
        Ok(Some(Measured { body, logs, fitted, plant, places, explained, known }))
    }

    /// Runs a case; `None` where every draw is in the logs already.
    pub(super) fn run(&self, case: &Case) -> Result<Option<Outcome>, String> {
        let (Some(kind), Some(size)) = (case.kinds.first(), case.sizes.first()) else { return Ok(None) };
        let mut rng = case.rng();
        let clock = |log: &Log, k: usize| log.t.get(k).copied().unwrap_or(0.0) + log.clock;
        let end = self.logs.iter().map(|log| clock(log, log.t.len().saturating_sub(1))).fold(0.0, f64::max);
        let last = &self.logs[(self.fitted - 1).min(2)];
        let length = last.t.last().copied().unwrap_or(0.0) - last.t.first().copied().unwrap_or(0.0);
        let begins = clock(last, 0) + 0.3 * length..clock(last, 0) + 0.6 * length;
        let known = |effect: &Effect| {
            let joints = effect.joints();
            let same = |n: &Named| n.effect == effect.name() && joints.iter().all(|j| n.joints.contains(j));
            self.known.iter().any(same)
        };
        let drawn = (0..DRAWS)
            .filter_map(|_| Effect::draw(kind, &self.plant, &self.places, end, begins.clone(), &mut rng))
            .find(|effect| !known(effect));
        let Some(mut effect) = drawn else { return Ok(None) };
        let (mut reached, mut factor) = (0.0, 1.0);
        for _ in 0..ROUNDS {
            reached = self.visible(&self.with(&effect)?)?;
            if (reached / size - 1.0).abs() < 0.03 {
                break;
            }
            effect = effect.scaled(size / reached);
            factor *= size / reached;
        }
        // Some effects cannot be made that large on this arm, or would be larger than any that occurs.
        let too_large = case.table == Table::MeasuredArms && factor > LARGEST_FACTOR;
        if too_large || !(0.7..1.4).contains(&(reached / size)) {
            return Ok(None);
        }
        let logs = self.with(&effect)?;
        let start = Instant::now();
        let (to_fit, held_out) = logs.split_at(self.fitted);
        let explained = explain_body(&self.body, to_fit, held_out, &ExplainOptions::default())
            .map_err(|e| e.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let before = &self.explained.after.validate.rms;
        let over = explained.after.validate.rms.iter().zip(before).map(|(a, b)| a / b).fold(0.0, f64::max);
        let joints: Vec<String> = effect.joints().iter().map(ToString::to_string).collect();
        let words = vec![format!("joint {}: {}", joints.join(","), effect.describe())];
        let outcome = Outcome::new(case, words, vec![reached], &explained, &self.known, over, seconds);
        Ok(Some(Outcome { truth_joints: effect.joints(), ..outcome }))
    }

    /// The logs as they would be with an effect.
    fn with(&self, effect: &Effect) -> Result<Vec<Log>, String> {
        let plant = self.plant.clone();
        let mut sensors = plant.sensors().clone();
        sensors.white.fill(0.0);
        let quiet = Plant::new(plant.dynamics().clone(), plant.friction().to_vec(), sensors);
        let with = quiet.clone().with(effect.clone());
        let of_gear = matches!(effect, Effect::JointElasticity { .. } | Effect::Backlash { .. });
        let smoothing = if of_gear { SMOOTHING_OF_GEARS } else { SMOOTHING };
        let mut logs = self.logs.clone();
        for log in &mut logs {
            for piece in log.pieces.clone() {
                let Some(measured) = Recording::new(log, 0, piece.clone(), STEP, smoothing) else { continue };
                let n = measured.dof;
                let mut motion = Motion::new(n, STEP);
                (motion.q, motion.dq, motion.ddq) =
                    (measured.q.clone(), measured.v.clone(), measured.a.clone());
                let (a, b) =
                    (with.record(&motion, measured.clock, 0), quiet.record(&motion, measured.clock, 0));
                let last = motion.len().saturating_sub(2);
                for k in piece {
                    let place = ((log.t[k] - measured.start) / STEP).max(0.0);
                    let low = (place as usize).min(last);
                    let share = (place - low as f64).min(1.0);
                    let at =
                        |x: &[f64], j: usize| (1.0 - share) * x[low * n + j] + share * x[(low + 1) * n + j];
                    for j in 0..n {
                        log.q[j][k] += at(&a.q, j) - at(&b.q, j);
                        log.torque[j][k] += at(&a.tau, j) - at(&b.tau, j);
                    }
                }
            }
        }
        Ok(logs)
    }

    /// What of the change is left when the base model was refitted, over what is left after all that is
    /// known, worst joint.
    fn visible(&self, logs: &[Log]) -> Result<f64, String> {
        let residual = |logs: &[Log]| -> Result<Signals, String> {
            let data = Data::new(&self.body, &logs[..self.fitted], &DataOptions::default())
                .map_err(|e| e.to_string())?;
            Ok(fit(&data, &Folds::new(&data), &[], None).residual)
        };
        let (with, without) = (residual(logs)?, residual(&self.logs)?);
        let rms = |r: &[f64]| (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt();
        let left = with.iter().zip(&without).map(|(a, b)| {
            if a.len() == b.len() {
                rms(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>())
            } else {
                // Positions changed, and with them what counts as rest.
                (rms(a).powi(2) - rms(b).powi(2)).max(0.0).sqrt()
            }
        });
        Ok(left.zip(&self.explained.after.fit.rms).map(|(l, r)| l / r).fold(0.0, f64::max))
    }
}

/// The rms of each joint's torque over all logs, N·m or N.
fn usual(logs: &[Log]) -> Vec<f64> {
    let joint = |j: usize| {
        let samples = || logs.iter().flat_map(|log| log.torque[j].iter().filter(|tau| tau.is_finite()));
        (samples().map(|tau| tau * tau).sum::<f64>() / samples().count().max(1) as f64).sqrt()
    };
    (0..logs.first().map_or(0, |log| log.torque.len())).map(joint).collect()
}
