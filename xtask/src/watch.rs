//! How soon a watch sees a change and whether it names it right, how often it is wrong, and what it says of measured
//! logs.

use dyngen::{Arm, Model, SetKind};
use powerball::controller::change::{JointTest, ORDER, Shown, alarm};
use powerball::controller::friction::TanhFriction;
use powerball::explanation::torque_model::{Rows, TorqueModel};
use powerball::explanation::watch::{Event, Watch, WatchOptions};
use powerball::explanation::{ExplainOptions, explain};
use powerball::identification::excite::{Settings, optimise};
use powerball::identification::motion::Motion;
use powerball::logs::log::{LiveSample, Log, read_logs};
use powerball::logs::regression::{DataOptions, Recording, RigidArm};
use powerball::logs::signal::resample::median_step;
use powerball::virtual_arm::{Plant, PlantEffect, lwa4p};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What is asked.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Changes of each kind on the virtual arm
    #[arg(long, default_value_t = 40)]
    draws: usize,
    /// Size of a change: rms of its torque over that of its joint
    #[arg(long, default_value_t = 0.05)]
    size: f64,
    /// Hours of simulated noise
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Draws everything
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The folder with measured logs; without it none is asked
    #[arg(long)]
    data: Option<PathBuf>,
}

/// Prints all tables.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    if let Some(data) = &arguments.data {
        measured(data)?;
    }
    if arguments.draws > 0 {
        virtual_arm(arguments)?;
    }
    Ok(())
}

/// All events of a log.
fn events(body: &RigidArm, model: &TorqueModel, options: &WatchOptions, log: &Log) -> Vec<Event> {
    let Some(step) = median_step(&log.t) else { return Vec::new() };
    let mut watch = Watch::new(body, model, options, &log.file, 1.0 / step);
    let mut found = Vec::new();
    for piece in &log.pieces {
        for k in piece.clone() {
            let of = |x: &Vec<Vec<f64>>| x.iter().map(|x| x[k]).collect();
            found.extend(watch.push(&LiveSample { t: log.t[k], q: of(&log.q), torque: of(&log.torque) }));
        }
        found.extend(watch.finish());
    }
    for note in watch.notes() {
        println!("  note: {note}");
    }
    found
}

// Measured logs.

/// Which logs a model is made of, and which are watched.
struct Case {
    folder: &'static str,
    fit: &'static [&'static str],
    validate: &'static [&'static str],
    watched: &'static [&'static str],
}

const CASES: [Case; 2] = [
    Case {
        folder: "ur10e",
        fit: &["fourier_12a", "fourier_12b", "fourier_5", "fourier_7", "fourier_8"],
        validate: &["fourier_12c"],
        watched: &["fourier_14", "joint_1", "joint_2", "joint_3", "fourier_14_load"],
    },
    Case {
        folder: "ur5_pushes",
        fit: &["no6", "no7", "no8"],
        validate: &["no9"],
        watched: &["no9", "no9_pushed"],
    },
];

fn measured(data: &Path) -> Result<(), String> {
    for Case { folder, fit, validate, watched } in &CASES {
        let folder = data.join(folder);
        let arm = Arm::read(&folder.join("arm.toml")).map_err(|e| e.to_string())?;
        let read = |names: &[&str]| -> Result<Vec<Log>, String> {
            let files: Vec<PathBuf> = names.iter().map(|name| folder.join(format!("{name}.csv"))).collect();
            Ok(read_logs(&files, &arm).map_err(|e| e.to_string())?.0)
        };
        let (body, model) = explained(&arm, &read(fit)?, &read(validate)?)?;
        for log in read(watched)? {
            println!("{}: {:.0} s", log.file, log.t.last().unwrap_or(&0.0) - log.t.first().unwrap_or(&0.0));
            for event in events(&body, &model, &WatchOptions::default(), &log) {
                println!("  {} (left {:.2})", event.sentence(), event.evidence.left);
            }
        }
    }
    Ok(())
}

/// The model that `explain` makes of logs, and the arm with it.
fn explained(arm: &Arm, fit: &[Log], validate: &[Log]) -> Result<(RigidArm, TorqueModel), String> {
    let found = explain(arm, fit, validate, &ExplainOptions::default()).map_err(|e| e.to_string())?;
    let changed = found.model.additions.arm_changes.of(arm).map_err(|e| e.to_string())?;
    let body = RigidArm::new(&changed).map_err(|e| e.to_string())?;
    for (j, colour) in found.model.colour.iter().flat_map(|colour| colour.joints.iter().enumerate()) {
        match colour {
            Some(c) => println!("joint {}: σ {:.4} N·m, margin {:.3}", j + 1, c.deviation, c.margin),
            None => println!("joint {}: not watched", j + 1),
        }
    }
    Ok((body, found.model))
}

// The virtual arm, in the middle of whose run something changes.

const RATE: f64 = 200.0;
/// A change is to be seen within this, s.
const SOON: f64 = 2.0;
const KINDS: [&str; 5] = ["contact_wrench", "payload", "temperature", "encoder_offset", "time_delay"];

fn virtual_arm(arguments: &Arguments) -> Result<(), String> {
    let arm = lwa4p::arm().map_err(|e| e.to_string())?;
    let plant = lwa4p::plant().map_err(|e| e.to_string())?;
    let derived = Model::derive(arm.clone()).map_err(|e| e.to_string())?;
    let motion = |k: u64| -> Result<Motion, String> {
        let settings = Settings { evaluations: 200, seed: 97 * arguments.seed + k, ..Settings::default() };
        let found = optimise(&derived, SetKind::Minimal, &settings).map_err(|e| e.to_string())?;
        Ok(found.paths[0].sample(RATE))
    };
    let motions: Vec<Motion> = (0..8).map(motion).collect::<Result<_, _>>()?;
    let recorded: Vec<Log> =
        (0..5).map(|k| plant.record(&motions[k], 0.0, k as u64).log(format!("{k}"))).collect();
    let (body, model) = explained(&arm, &recorded[..3], &recorded[3..])?;
    let options = WatchOptions::default();
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.seed);
    let mut tally: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    let mut confused: BTreeMap<(String, String), usize> = BTreeMap::new();
    let mut delays = Vec::new();
    for kind in KINDS {
        for draw in 0..arguments.draws {
            let motion = &motions[5 + draw % 3];
            let (log, at, joint) = changed(&plant, motion, kind, arguments.size, &mut rng);
            let found = events(&body, &model, &options, &log);
            let early = found.iter().filter(|e| e.time < at).count();
            let first = found.iter().find(|e| e.time >= at);
            let count = tally.entry(kind).or_default();
            count[0] += 1;
            count[3] += early;
            if let Some(event) = first {
                delays.push(event.time - at);
                count[1] += usize::from(event.time - at <= SOON);
                count[2] += usize::from(event.what == kind);
                *confused.entry((kind.to_string(), event.what.clone())).or_default() += 1;
                if event.what != kind {
                    println!(
                        "  {kind} on {joint} at {at:.2}: {} rivals {:?} left {:.2}",
                        event.sentence(),
                        event.evidence.rivals,
                        event.evidence.left
                    );
                }
            } else {
                println!("  {kind} on {joint} at {at:.2}: not seen");
                *confused.entry((kind.to_string(), "not seen".to_string())).or_default() += 1;
            }
        }
    }
    println!("kind: draws, seen within {SOON} s, named right, events before the change");
    tally.iter().for_each(|(kind, count)| println!("{kind}: {count:?}"));
    delays.sort_by(f64::total_cmp);
    println!("median delay {:.2} s; {confused:?}", delays.get(delays.len() / 2).unwrap_or(&f64::NAN));
    false_alarms(arguments, &body, &model, &recorded[3]);
    Ok(())
}

/// A log in which something changes at a time; with that time and the joint of which it is a share of the torque.
fn changed(plant: &Plant, motion: &Motion, kind: &str, size: f64, rng: &mut ChaCha8Rng) -> (Log, f64, usize) {
    let n = motion.dof();
    let seed = rng.random();
    let log = |effect: Option<PlantEffect>, scaled: Option<(usize, f64)>| {
        let mut friction = plant.friction().to_vec();
        if let Some((j, by)) = scaled {
            let TanhFriction { gamma1, gamma2, gamma3, gamma4, gamma5 } = friction[j];
            friction[j] = TanhFriction::new([gamma1 * by, gamma2, gamma3 * by, gamma4, gamma5 * by]);
        }
        let plant = Plant::new(plant.dynamics().clone(), friction, plant.sensors().clone());
        let plant = if let Some(effect) = effect { plant.with(effect) } else { plant };
        plant.record(motion, 0.0, seed).log("run")
    };
    let clean = log(None, None);
    // The zero of an upright first joint shows in no torque.
    let joint = rng.random_range(usize::from(kind == "encoder_offset")..n);
    let direction: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(rng));
    let length = direction.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
    let centre = std::array::from_fn(|k| if k == 2 { 0.1 } else { rng.random_range(-0.05..0.05) });
    let sign = if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
    let make = |by: f64| match kind {
        "contact_wrench" => {
            let force = direction.map(|x| by * x / length);
            log(Some(PlantEffect::ContactWrench { force, start: 0.0, length: 1e6, every: 1e6 }), None)
        }
        "payload" => log(Some(PlantEffect::Payload { mass: by, centre, start: 0.0 }), None),
        "temperature" => log(None, Some((joint, 1.0 + sign * by))),
        "encoder_offset" => log(Some(PlantEffect::EncoderOffset { joint, offset: sign * by }), None),
        _ => log(Some(PlantEffect::TimeDelay { delay: by }), None),
    };
    let start = if kind == "contact_wrench" { 5.0 } else { 0.05 };
    // A zero is another one after a start, and does not jump on the way.
    let place = rng.random_range(0.3..0.6);
    let from = if kind == "encoder_offset" { 0 } else { (clean.t.len() as f64 * place) as usize };
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt();
    // The rms of the change over that of the torque, on the joint on which it is largest.
    let share = |log: &Log| {
        let of = |j: usize| {
            let change: Vec<f64> =
                (from..log.t.len()).map(|k| log.torque[j][k] - clean.torque[j][k]).collect();
            rms(&change) / rms(&clean.torque[j])
        };
        (0..n).map(|j| (j, of(j))).fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a })
    };
    let by = if kind == "encoder_offset" {
        // The log shows the true torque at another place: the same size of torque as that place's would differ by.
        offset_of_size(plant, motion, joint, size)
    } else {
        let mut by = start;
        for _ in 0..3 {
            by *= size / share(&make(by)).1.max(1e-9);
        }
        by
    };
    let changed = make(by);
    let most = if kind == "encoder_offset" { joint } else { share(&changed).0 };
    let splice = |a: &[Vec<f64>], b: &[Vec<f64>]| -> Vec<Vec<f64>> {
        a.iter().zip(b).map(|(a, b)| [&a[..from], &b[from..]].concat()).collect()
    };
    let log = Log {
        q: splice(&clean.q, &changed.q),
        torque: splice(&clean.torque, &changed.torque),
        ..clean.clone()
    };
    (log, clean.t[from], most + 1)
}

/// The offset of a joint's zero by which the torque at the place that is logged differs by a share of a joint's.
fn offset_of_size(plant: &Plant, motion: &Motion, joint: usize, size: f64) -> f64 {
    let n = motion.dof();
    let torques = |by: f64| -> Vec<Vec<f64>> {
        let moved = motion.samples().map(|[q, dq, ddq]| {
            let mut q = q.to_vec();
            q[joint] += by;
            plant.dynamics().inverse(&q, dq, ddq)
        });
        moved.collect()
    };
    let (at, beside) = (torques(0.0), torques(0.01));
    let of = |j: usize| {
        let change: f64 = at.iter().zip(&beside).map(|(a, b)| (a[j] - b[j]).powi(2)).sum();
        let whole: f64 = motion
            .samples()
            .zip(&at)
            .map(|([_, dq, _], a)| (a[j] + plant.friction()[j].torque(dq[j])).powi(2))
            .sum();
        (change / whole).sqrt()
    };
    let most = (0..n).map(of).fold(0.0, f64::max);
    (0.01 * size / most.max(1e-6)).min(0.3)
}

// False alarms: noise of the model's colour along the rows of a log, again and again, with friction that wanders.

fn false_alarms(arguments: &Arguments, body: &RigidArm, model: &TorqueModel, log: &Log) {
    let Some(colour) = &model.colour else { return };
    let options = WatchOptions::default();
    let recording =
        Recording::new(log, 0, 0..log.t.len(), 1.0 / colour.rate, DataOptions::default().smoothing);
    let Some(recording) = recording else { return };
    let rows = Rows::new(model, &recording, &model.torque(body, &recording, &|_| false));
    let a_second = powerball::explanation::torque_model::rows_a_second(colour.rate);
    let count = (arguments.hours * 3600.0 * a_second) as u64;
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.seed ^ 0x5eed);
    for range in [0.0, options.friction_range] {
        let fresh = || -> Vec<(usize, JointTest<f64>)> {
            let joints = colour.joints.iter().enumerate();
            joints
                .filter_map(|(j, c)| {
                    Some((j, JointTest::new(c.as_ref()?.for_test(), options.friction_range)))
                })
                .collect()
        };
        let mut tests = fresh();
        let mut past = vec![[0.0; ORDER]; colour.joints.len()];
        let mut alarms = 0;
        for number in 0..count {
            let k = (number % rows.t.len() as u64) as usize;
            let wander = range * (number as f64 / a_second / 600.0 * std::f64::consts::TAU).sin();
            for (j, test) in &mut tests {
                let Some(own) = &colour.joints[*j] else { continue };
                let e: f64 = StandardNormal.sample(&mut rng);
                let told: f64 = own.coefficients.iter().zip(&past[*j]).map(|(a, x)| a * x).sum();
                let noise = told + own.deviation * e;
                past[*j].copy_within(..ORDER - 1, 1);
                past[*j][0] = noise;
                match rows.joints[*j][k] {
                    Some(Shown { columns, .. }) => {
                        test.update(Shown { residual: noise + wander * columns[0], columns }, number);
                    }
                    None => test.interrupt(),
                }
            }
            if alarm(tests.iter().map(|(j, test)| (*j, test)), options.level(colour.rate)).is_some() {
                alarms += 1;
                tests = fresh();
            }
        }
        println!(
            "{alarms} alarms in {} h of noise of the model's colour, friction wandering by {:.0} % of itself",
            arguments.hours,
            100.0 * range
        );
    }
}
