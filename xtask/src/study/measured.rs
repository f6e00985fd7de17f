//! Effects put into measured logs: what the plant would add along the motion that was measured is added to
//! what was measured.

use super::case::Case;
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
use powerball::virtual_arm::{Dynamics, Plant, PlantEffect as Effect, Sensors, bodies, lwa4p};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Logs to fit and logs held out: other paths.
const FIT: [&str; 5] = ["12a", "12b", "12c", "7", "8"];
const HELD_OUT: [&str; 2] = ["5", "14"];
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
    logs: Vec<Log>,
    plant: Plant,
    explained: Explained,
    known: Vec<Named>,
}

impl Measured {
    /// `None` where the logs are not there.
    pub(super) fn read(folder: &Path) -> Result<Option<Measured>, String> {
        let file = folder.join("arm.toml");
        if !file.exists() {
            eprintln!("skipped: no measured logs in {}", folder.display());
            return Ok(None);
        }
        let arm = Arm::read(&file).map_err(|e| e.to_string())?;
        let files: Vec<PathBuf> =
            FIT.iter().chain(&HELD_OUT).map(|name| folder.join(format!("fourier_{name}.csv"))).collect();
        let (mut logs, _) = read_logs(&files, &arm).map_err(|e| e.to_string())?;
        common_clock(&mut logs);
        let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
        let options = DataOptions::default();
        let explained =
            explain_body(&body, &logs[..FIT.len()], &logs[FIT.len()..], &ExplainOptions::default())
                .map_err(|e| e.to_string())?;
        let plant = {
            let data = Data::new(&body, &logs[..FIT.len()], &options).map_err(|e| e.to_string())?;
            let base = fit(&data, &Folds::new(&data), &[], None);
            let mut summary = Summary::new(&body, &options);
            for log in &logs[..FIT.len()] {
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
        let known = named(&explained);
        Ok(Some(Measured { body, logs, plant, explained, known }))
    }

    /// Runs a case; `None` where every draw is in the logs already.
    pub(super) fn run(&self, case: &Case) -> Result<Option<Outcome>, String> {
        let (Some(kind), Some(size)) = (case.kinds.first(), case.sizes.first()) else { return Ok(None) };
        let mut rng = case.rng();
        let clock = |log: &Log, k: usize| log.t.get(k).copied().unwrap_or(0.0) + log.clock;
        let end = self.logs.iter().map(|log| clock(log, log.t.len().saturating_sub(1))).fold(0.0, f64::max);
        let third = &self.logs[2];
        let length = third.t.last().copied().unwrap_or(0.0) - third.t.first().copied().unwrap_or(0.0);
        let begins = clock(third, 0) + 0.3 * length..clock(third, 0) + 0.6 * length;
        let known = |effect: &Effect| {
            let joints = effect.joints();
            let same = |n: &Named| n.effect == effect.name() && joints.iter().all(|j| n.joints.contains(j));
            self.known.iter().any(same)
        };
        let drawn = (0..DRAWS)
            .filter_map(|_| lwa4p::draw_effect(kind, &self.plant, end, begins.clone(), &mut rng))
            .find(|effect| !known(effect));
        let Some(mut effect) = drawn else { return Ok(None) };
        let mut reached = 0.0;
        for _ in 0..ROUNDS {
            reached = self.visible(&self.with(&effect)?)?;
            if (reached / size - 1.0).abs() < 0.03 {
                break;
            }
            effect = effect.scaled(size / reached);
        }
        // Some effects cannot be made that large on this arm.
        if !(0.7..1.4).contains(&(reached / size)) {
            return Ok(None);
        }
        let logs = self.with(&effect)?;
        let start = Instant::now();
        let (to_fit, held_out) = logs.split_at(FIT.len());
        let explained = explain_body(&self.body, to_fit, held_out, &ExplainOptions::default())
            .map_err(|e| e.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let before = &self.explained.after.validate.rms;
        let over = explained.after.validate.rms.iter().zip(before).map(|(a, b)| a / b).fold(0.0, f64::max);
        let joints: Vec<String> = effect.joints().iter().map(ToString::to_string).collect();
        let words = vec![format!("joint {}: {}", joints.join(","), effect.describe())];
        Ok(Some(Outcome::new(case, words, vec![reached], &explained, &self.known, over, seconds)))
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
            let data = Data::new(&self.body, &logs[..FIT.len()], &DataOptions::default())
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
