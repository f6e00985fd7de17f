//! Current mode with things going wrong: a joint whose encoder, drive or brake does not do what it should
//! stops the arm before it has gone far, whatever law holds it. Makes the table of
//! docs/results/torque_mode.md:
//! `cargo test --release -p powerball --test torque_mode -- --ignored --nocapture`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test's helpers may stop the test")]

mod relay;
#[path = "../true_model/mod.rs"]
mod true_model;

use chacha20::ChaCha8Rng;
use powerball::bus::canopen::Micros;
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{Cause, Driver};
use powerball::bus::transport::{ArmError, Master, Memory};
use powerball::commands::model_arm::{self, ModelArm};
use powerball::controller::dynamics::{ArmModel, Reference};
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::controller::laws::{ComputedTorque, HandGuiding, JointImpedance, Softening};
use powerball::identification::motion::Motion;
use powerball::procedure::follow::{Law, Path, Run, Sample};
use powerball::procedure::torque_loop::TorqueLoop;
use powerball::procedure::{Envelope, RecordError, Recorder};
use powerball::virtual_arm::{PlantEffect, VirtualArm, lwa4p};
use rand::SeedableRng;
use relay::{Fault, Relay};
use serde_json::json;
use std::cell::Cell;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::rc::Rc;
use true_model::true_model;

const PERIOD: f64 = 0.005;

/// The virtual arm's true values; its friction by a factor.
fn model(name: &str, friction: f64) -> ModelArm {
    let arm = lwa4p::arm().unwrap();
    let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("torque_mode_{name}.json"));
    std::fs::write(&file, true_model(friction, json!([])).to_string()).unwrap();
    model_arm::read(&arm, &file, true).unwrap()
}

/// All joints swing, each with its own period, from rest to rest.
fn path(pace: f64) -> Path<6> {
    let mut motion = Motion::new(6, PERIOD);
    let seconds = 6.0 / pace;
    for k in 0..=(seconds / PERIOD) as usize {
        let t = k as f64 * PERIOD;
        motion.push((0..6).map(|j| {
            let w = TAU * (1 + j % 3) as f64 / seconds;
            [0.35 * (1.0 - (w * t).cos()), 0.0, 0.0]
        }));
    }
    Path::clear(&motion, &Envelope::new(|_| None), &LWA4P).unwrap()
}

fn law(name: &str, model: &ModelArm, path: &Path<6>) -> Law<6> {
    match name {
        "feedforward" => Law::Feedforward,
        "torque" => Law::Torque(ComputedTorque::for_period(PERIOD)),
        _ => Law::Impedance(JointImpedance::of_inertia(&model.numeric.mass_matrix(&path.start()), 8.0, 1.0)),
    }
}

/// A run with its bus.
struct Ran {
    bus: Memory<Relay>,
    done: Result<(), RecordError>,
    carried_on: u64,
}

/// Follows with a fault at a joint from a time of the path on, s.
fn follow(
    model: &ModelArm,
    path: &Path<6>,
    law: Law<6>,
    effects: &[PlantEffect],
    (fault, joint, from): (Fault, usize, f64),
) -> Ran {
    let parts = model_arm::parts(model, path, 0.0).unwrap();
    let mut setup = lwa4p::with_current_mode(lwa4p::setup(path.start().into(), 1).unwrap());
    setup.modules.iter_mut().for_each(|module| module.commutated = true);
    for effect in effects {
        setup.plant = setup.plant.with(effect.clone());
    }
    let begin = Rc::new(Cell::new(false));
    let relay = Relay::new(VirtualArm::new(setup).unwrap(), fault, joint, Rc::clone(&begin));
    let mut bus = Memory::new(relay, LWA4P.bitrate);
    let profile = if law == Law::Feedforward { LWA4P.with_torque_offset() } else { LWA4P };
    let run = Run {
        path,
        arm: &model.numeric,
        parts: Some(&parts),
        best: &parts,
        give: 0.0,
        guard: Some(model_arm::torque_guard(model)),
        law,
        contact: None,
        accept_unverified: true,
    };
    let master = Master::new(Driver::new(profile).unwrap(), &mut bus);
    let each = |sample: &Sample<6>, _: &Reference<f64, 6>| begin.set(begin.get() || sample.t >= from);
    // The master goes before its bus is looked at.
    let done = run.follow(master, Envelope::new(|_| None), None, each).map(|(_, track, _)| track.carried_on);
    let (done, carried_on) = done.map_or_else(|e| (Err(e), 0), |carried_on| (Ok(()), carried_on));
    Ran { bus, done, carried_on }
}

/// What came of a fault.
#[derive(Clone, Copy, Debug)]
struct Stop {
    /// From the fault to the quick stop of its joint, s; infinite where none came.
    after: f64,
    /// How far the joint was from where it would have been without the fault, at most, until then, rad.
    off: f64,
    cause: Option<Cause>,
}

impl Stop {
    fn of(ran: &Ran, calm: &Relay, joint: usize) -> Stop {
        let relay = ran.bus.peer();
        let began = relay.began.unwrap();
        let end = relay.stopped.unwrap_or(Micros::MAX);
        let pairs = relay.truth.iter().zip(&calm.truth).filter(|((at, _), _)| (began..=end).contains(at));
        let off = pairs.fold(0.0f64, |most, ((_, a), (_, b))| most.max((a[joint] - b[joint]).abs()));
        let cause = match &ran.done {
            Err(RecordError::Arm(ArmError::Stopped(cause, _))) => Some(*cause),
            _ => None,
        };
        let after = if end == Micros::MAX { f64::INFINITY } else { (end - began) as f64 * 1e-6 };
        Stop { after, off, cause }
    }

    fn worse(self, other: Stop) -> Stop {
        Stop {
            after: self.after.max(other.after),
            off: self.off.max(other.off),
            // One that was not seen is the worst.
            cause: self.cause.and(other.cause),
        }
    }

    fn words(self) -> String {
        let off = format!("{:.0} mrad", 1e3 * self.off);
        match self.cause {
            Some(_) => format!("{:.0} ms, {off}", 1e3 * self.after),
            None => format!("not seen, {off}"),
        }
    }
}

/// The arm in one of the ways in which it is driven, and how it moves where nothing is wrong.
struct Bench {
    name: &'static str,
    model: ModelArm,
    path: Path<6>,
    calm: Ran,
}

impl Bench {
    fn new(name: &'static str) -> Bench {
        let (model, path) = (model(name, 1.0), path(1.0));
        let calm = drive(name, &model, &path, (Fault::None, 0, 1.0));
        assert!(calm.done.is_ok(), "{name}: {:?}", calm.done);
        Bench { name, model, path, calm }
    }

    fn stop(&self, fault: Fault, joint: usize, from: f64) -> Stop {
        let ran = drive(self.name, &self.model, &self.path, (fault, joint, from));
        Stop::of(&ran, self.calm.bus.peer(), joint)
    }
}

fn drive(name: &str, model: &ModelArm, path: &Path<6>, fault: (Fault, usize, f64)) -> Ran {
    match name {
        "float" => float(model, fault),
        _ => follow(model, path, law(name, model, path), &[], fault),
    }
}

/// Where the arm floats: joint 2 carries the arm, and all are loose.
const TILTED: [f64; 6] = [0.0, 0.7, 0.6, 0.0, 0.5, 0.0];

/// Hand guiding at a tilted pose, hands off.
fn float(model: &ModelArm, (fault, joint, from): (Fault, usize, f64)) -> Ran {
    let mut setup = lwa4p::with_current_mode(lwa4p::setup(TILTED, 1).unwrap());
    setup.modules.iter_mut().for_each(|module| module.commutated = true);
    let begin = Rc::new(Cell::new(false));
    let relay = Relay::new(VirtualArm::new(setup).unwrap(), fault, joint, Rc::clone(&begin));
    let mut bus = Memory::new(relay, LWA4P.bitrate);
    let master = Master::new(Driver::new(LWA4P).unwrap(), &mut bus);
    let laws: [TanhFriction<f64>; 6] = TABLE_2.map(TanhFriction::new);
    let mut law = HandGuiding::new(laws, laws.each_ref().map(Softening::of));
    let mut floats = |master| -> Result<(), RecordError> {
        let master = Recorder::enable(master, Envelope::new(|_| None)).and_then(Recorder::finish)?;
        let mut arm = TorqueLoop::bring_up(master, true)?;
        arm.guard(model_arm::torque_guard(model).with_push(0.4));
        arm.run(None, |measured| {
            let t = measured.cycle as f64 * PERIOD;
            begin.set(begin.get() || t >= from);
            (t < 5.0).then(|| law.torque(&model.numeric, &measured.state))
        })?;
        arm.finish().map(|_| ())
    };
    let done = floats(master);
    Ran { bus, done, carried_on: 0 }
}

/// Moments of the path, s, at which the joints move.
const MOMENTS: [f64; 3] = [2.2, 3.7, 4.9];

/// How far a joint may get, rad.
fn allowed(bench: &Bench, fault: Fault) -> f64 {
    match fault {
        Fault::Drift | Fault::HalfScale => 0.2,
        // Who floats cannot tell it from a hand that pulls, until the joint is too fast.
        Fault::Powerless if bench.name == "float" => 1.0,
        _ => 0.05,
    }
}

fn check(bench: &Bench, fault: Fault, words: &str, joint: usize, stop: Stop) {
    let what = format!("{}, {words}, joint {}: {}", bench.name, joint + 1, stop.words());
    assert!(stop.off <= allowed(bench, fault), "{what}");
    let Some(cause) = stop.cause.filter(|_| fault != Fault::Powerless || bench.name != "float") else {
        // An arm that floats at rest and is informed that it does stays where it is.
        assert!(bench.name == "float", "{what}");
        return;
    };
    assert_eq!(cause.node(), Some(LWA4P.joints[joint].node), "{what}: {cause}");
    // What changes nothing at once is seen when it does.
    let slow = matches!(fault, Fault::SetpointsLost | Fault::Drift | Fault::HalfScale | Fault::Powerless);
    assert!(slow || stop.after <= 0.1 || stop.off <= 0.02, "{what}: {cause}");
}

#[test]
fn every_fault_stops_the_arm_before_a_joint_has_gone_far() {
    for (name, joint, from) in [("torque", 2, 2.2), ("impedance", 4, 3.7), ("float", 1, 1.0)] {
        let bench = Bench::new(name);
        for (fault, words) in Fault::ALL {
            check(&bench, fault, words, joint, bench.stop(fault, joint, from));
        }
    }
}

#[test]
#[ignore = "at length: the one above guards it, and makes no table"]
fn every_fault_at_every_moment() {
    let benches = ["feedforward", "torque", "impedance", "float"].map(Bench::new);
    let mut table = vec![
        "| fault | feedforward | torque | impedance | float, at rest |".to_string(),
        "|---|---|---|---|---|".to_string(),
    ];
    for (fault, words) in Fault::ALL {
        let cell = |bench: &Bench| -> String {
            if bench.name == "feedforward" && !Relay::is_of_positions(fault) {
                return "–".to_string();
            }
            let (joints, moments): (&[usize], &[f64]) =
                if bench.name == "float" { (&[1], &[1.0]) } else { (&[1, 2, 4], &MOMENTS) };
            let runs = joints.iter().flat_map(|joint| moments.iter().map(move |from| (*joint, *from)));
            let stops = runs.map(|(joint, from)| {
                let stop = bench.stop(fault, joint, from);
                if bench.name != "feedforward" {
                    check(bench, fault, words, joint, stop);
                }
                stop
            });
            stops.reduce(Stop::worse).unwrap().words()
        };
        let cells: Vec<String> = benches.iter().map(cell).collect();
        println!("| {words} | {} |", cells.join(" | "));
        table.push(format!("| {words} | {} |", cells.join(" | ")));
    }
    the_page_holds(&table.join("\n"));
}

/// Where `docs/results/torque_mode.md` shows the table.
const BEGIN: &str = "<!-- table -->\n";
const END: &str = "\n<!-- end of table -->";

/// The page shows this table. With `POWERBALL_BLESS` set, it is written there.
fn the_page_holds(table: &str) {
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results/torque_mode.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let (head, rest) = text.split_once(BEGIN).unwrap();
    let (shown, tail) = rest.split_once(END).unwrap();
    if std::env::var_os("POWERBALL_BLESS").is_some() {
        std::fs::write(&page, format!("{head}{BEGIN}{table}{END}{tail}")).unwrap();
    } else {
        assert!(
            shown == table,
            "{} shows another table; run this test with POWERBALL_BLESS=1",
            page.display()
        );
    }
}

/// A tenth of a joint's data is lost, or one velocity is no velocity: the run goes on to its end, near its
/// path.
#[test]
fn lost_data_is_carried_on_and_one_impossible_velocity_is_not_used() {
    for name in ["torque", "impedance"] {
        let bench = Bench::new(name);
        for fault in [Fault::Lossy, Fault::VelocityHugeOnce] {
            let ran = drive(name, &bench.model, &bench.path, (fault, 2, 1.0));
            assert!(ran.done.is_ok(), "{name}, {fault:?}: {:?}", ran.done);
            let pairs = ran.bus.peer().truth.iter().zip(&bench.calm.bus.peer().truth);
            let off = pairs.fold(0.0f64, |most, ((_, a), (_, b))| most.max((a[2] - b[2]).abs()));
            assert!(off < 5e-3, "{name}, {fault:?}: {off}");
            if fault == Fault::Lossy {
                assert!(ran.carried_on > 100, "{}", ran.carried_on);
            }
        }
    }
}

/// Drives with effects of `names` that the model lacks, `seeds` times each, and a model whose friction is
/// wrong by a fifth: how many runs, and which of them were stopped.
fn false_stops(law_name: &str, names: &[&str], seeds: u64) -> (usize, Vec<String>) {
    let (path, plant) = (path(1.0), lwa4p::plant().unwrap());
    let (mut runs, mut stops) = (0, Vec::new());
    for friction in [1.0, 0.8, 1.2] {
        let model = model(&format!("{law_name}_{friction}_{seeds}"), friction);
        let law = law(law_name, &model, &path);
        let drawn = names.iter().enumerate().flat_map(|(k, name)| {
            let draw = |seed| {
                let mut rng = ChaCha8Rng::seed_from_u64(2000 + 100 * k as u64 + seed);
                lwa4p::draw_effect(name, &plant, 60.0, 5.0..20.0, &mut rng)
            };
            (0..seeds).filter_map(draw).collect::<Vec<_>>()
        });
        for effect in drawn.map(Some).chain([None]) {
            runs += 1;
            if let Err(e) = follow(&model, &path, law, effect.as_slice(), (Fault::None, 0, 1.0)).done {
                stops.push(format!("{law_name}, friction × {friction}, {effect:?}: {e}"));
            }
        }
    }
    (runs, stops)
}

#[test]
fn friction_that_is_wrong_by_a_fifth_stops_nothing() {
    for law in ["torque", "impedance"] {
        let (runs, stops) = false_stops(law, &["payload", "spring"], 1);
        assert!(runs == 9 && stops.is_empty(), "of {runs}:\n{}", stops.join("\n"));
    }
}

#[test]
#[ignore = "at length; the one above guards it"]
fn no_effect_stops_the_arm_at_length() {
    // Somebody who pushes the arm is no false stop.
    let names: Vec<&str> = PlantEffect::NAMES.into_iter().filter(|name| *name != "contact_wrench").collect();
    for law in ["torque", "impedance"] {
        let (runs, stops) = false_stops(law, &names, 2);
        println!("{law}: {} of {runs}\n{}", stops.len(), stops.join("\n"));
        assert!(runs > 100 && stops.len() <= 1);
    }
}
