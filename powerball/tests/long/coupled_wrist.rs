//! An arm whose last two motors both turn with both wrist joints, as the motors of a differential do: its
//! friction is on the motors, and what is identified, judged and generated is that.
//!
//! The logs are the virtual arm's, whose Newton–Euler recursion and friction on motors share no formula with
//! what is tested.

use chacha20::ChaCha8Rng;
use dyngen::Arm;
use powerball::controller::JointNumber;
use powerball::controller::correction::Law;
use powerball::controller::friction::TanhFriction;
use powerball::explanation::torque_model::{Scalar, TorqueModel};
use powerball::identification::chain::Chain;
use powerball::identification::estimate::friction_row;
use powerball::identification::excite::{Fourier, Harmonics};
use powerball::identification::motion::Motion;
use powerball::identification::{VerifyOptions, verify};
use powerball::virtual_arm::{Dynamics, Plant, Sensors, SimulatedLog, lwa4p};
use powerball::{ExplainOptions, Identified, IdentifyOptions, Log, explain, identify};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

/// The LWA 4P, its wrist a differential.
fn arm() -> Arm {
    let block = "\n[[transmission]]\njoints = [5, 6]\nmatrix = [[1, 1], [1, -1]]\n";
    let mut arm = Arm::parse(&(include_str!("../../lwa4p.toml").to_string() + block), "wrist.toml").unwrap();
    arm.groupings.clear();
    arm
}

fn friction() -> Vec<TanhFriction<f64>> {
    let mut laws = lwa4p::plant().unwrap().friction().to_vec();
    // The wrist's motors must not be alike, or it would not matter whose friction is whose.
    (laws[4].gamma1, laws[5].gamma1) = (1.4 * laws[4].gamma1, 0.5 * laws[5].gamma1);
    laws
}

fn plant(sensors: Sensors) -> Plant {
    Plant::new(Dynamics::new(Chain::new(&arm()), lwa4p::links()).unwrap(), friction(), sensors)
}

fn motion(plant: &Plant, seed: u64) -> Motion {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || -> Vec<f64> { (0..5).map(|_| 0.25 * rng.random_range(-1.0..1.0)).collect() };
    let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).collect();
    let path = Fourier { fundamental: TAU / 10.0, periods: 6, ramp: 1.0, joints };
    path.sample(plant.sensors().rate)
}

fn record(plant: &Plant, seed: u64) -> SimulatedLog {
    plant.record(&motion(plant, seed), 0.0, seed)
}

/// The standard error of a motor's friction torque at a velocity.
fn error_of(found: &Identified, motor: usize, velocity: f64) -> f64 {
    let law = &found.friction[motor];
    let row = friction_row([law.gamma2, law.gamma4], velocity);
    let place = |k: usize| found.uncertainty.friction(motor, k);
    let sum =
        |k: usize| -> f64 { (0..5).map(|l| row[l] * found.uncertainty.covariance(place(k), place(l))).sum() };
    (0..5).map(|k| row[k] * sum(k)).sum::<f64>().sqrt()
}

#[test]
fn friction_of_coupled_motors_is_found_and_judged_on_them() {
    let arm = arm();
    let plant = plant(lwa4p::plant().unwrap().sensors().clone());
    let logs: Vec<Log> = (0..4).map(|k| record(&plant, k).log(format!("fit {k}"))).collect();
    let other = record(&plant, 9).log("other");
    let found = identify(&arm, &logs, [&other], &IdentifyOptions::default()).unwrap();
    assert!(found.warnings.iter().any(|w| w.contains("couples joints 5, 6")), "{:?}", found.warnings);

    // What each motor spends, within its stated error.
    let (mut squares, mut count) = (0.0, 0);
    for (motor, truth) in friction().iter().enumerate() {
        let law = TanhFriction::new(found.friction[motor].gamma());
        for velocity in [0.05, 0.15, 0.4, 0.9] {
            let (is, std) = (truth.torque(velocity), error_of(&found, motor, velocity));
            let miss = (law.torque(velocity) - is) / std;
            println!("motor {}: {is:.3} ± {std:.4} N·m at {velocity}, {miss:+.1} errors off", motor + 1);
            assert!(std < 0.03 * is && miss.abs() < 4.0);
            (squares, count) = (squares + miss * miss, count + 1);
        }
    }
    let typical = (squares / f64::from(count)).sqrt();
    assert!(typical < 1.7, "{typical}");

    // On another path noise is left: that of the two joints' torques together, half of each, on a motor.
    let sensors = plant.sensors();
    let noise = |j: usize| sensors.white[j].hypot(sensors.coloured[j]);
    let left = &found.validate.as_ref().unwrap().rms;
    let judged = verify(&arm, &found.model(), [&other], &VerifyOptions::default()).unwrap();
    for (j, rms) in left.iter().enumerate() {
        let noise = if j < 4 { noise(j) } else { 0.5 * noise(4).hypot(noise(5)) };
        println!("motor {}: {rms:.4} N·m left, noise {noise:.4}", j + 1);
        assert!(*rms < noise);
        approx::assert_relative_eq!(judged.joints[j].rms, *rms, max_relative = 0.02);
    }

    // On the joints' velocities the same friction is not to be had.
    let mut uncoupled = arm.clone();
    uncoupled.transmissions.clear();
    let wrong = identify(&uncoupled, &logs, [&other], &IdentifyOptions::default()).unwrap();
    let wrong = wrong.validate.unwrap().rms;
    assert!(wrong[4] > 5.0 * left[4] && wrong[5] > 5.0 * left[5], "{wrong:?} {left:?}");
}

/// The generated controller gives the joints' torques, friction on motors among them, and so does the model
/// of which it was made: both against the noise-free arm.
#[test]
fn the_controllers_torques_are_those_of_the_joints() {
    let quiet = Sensors {
        encoder_step: 0.0,
        white: vec![0.0; 6],
        coloured: vec![0.0; 6],
        ..lwa4p::plant().unwrap().sensors().clone()
    };
    let (arm, plant) = (arm(), plant(quiet));
    let logs: Vec<Log> = (0..2).map(|k| record(&plant, k).log(format!("fit {k}"))).collect();
    let found = identify(&arm, &logs, [], &IdentifyOptions::default()).unwrap();
    let text = serde_json::to_string(&found).unwrap();
    let mut model = TorqueModel::parse(&text, Path::new("identified.json")).unwrap();
    // What the encoders of the wrist's motors show too much: a joint's is half their sum, half their
    // difference.
    let [fifth, sixth] = [0.03, -0.01];
    model.additions.log_changes.encoder_offset = vec![0.0, 0.0, 0.0, 0.0, fifth, sixth];
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("coupled_wrist");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("controller.rs"), model.source(&arm, Scalar::F64, &[]).unwrap()).unwrap();
    let program = crate::generated::controller(&folder);

    let motion = motion(&plant, 9);
    let truth = plant.record(&motion, 0.0, 9);
    let (mut input, mut expected) = (String::new(), Vec::new());
    for (k, [q, dq, ddq]) in motion.samples().enumerate().step_by(50) {
        let shown: [f64; 6] = std::array::from_fn(|j| match j {
            4 => q[4] + 0.5 * (fifth + sixth),
            5 => q[5] + 0.5 * (fifth - sixth),
            _ => q[j],
        });
        shown.iter().chain(dq).chain(ddq).for_each(|x| write!(input, "{x:?},").unwrap());
        writeln!(input, "0").unwrap();
        expected.push(&truth.tau[6 * k..6 * (k + 1)]);
    }
    let torques = crate::generated::run(&program, input);
    assert_eq!(torques.len(), expected.len());
    for j in 0..6 {
        let rms = |of: &dyn Fn(usize) -> f64| {
            (torques.iter().enumerate().map(|(k, _)| of(k).powi(2)).sum::<f64>() / torques.len() as f64)
                .sqrt()
        };
        let (error, all) = (rms(&|k| torques[k][j] - expected[k][j]), rms(&|k| expected[k][j]));
        println!("joint {}: {error:.4} of {all:.3} N·m", j + 1);
        assert!(error < 1e-3 * all, "joint {}: {error} of {all}", j + 1);
    }
}

/// Ripple of a motor that turns with two joints is on both joints' torques, and is reported as that motor's.
#[test]
fn ripple_of_a_coupled_motor_is_named_on_it() {
    let arm = arm();
    let plant = plant(lwa4p::plant().unwrap().sensors().clone());
    let (order, size) = (7.0, 0.08);
    let rippled = |seed: u64| {
        let mut log = record(&plant, seed).log(format!("log {seed}"));
        // Half of it is enough, and half the time.
        log.pieces = std::iter::once(0..log.t.len() / 2).collect();
        for k in 0..log.t.len() {
            // Motor 6 turns with the difference.
            let torque = size * (order * (log.q[4][k] - log.q[5][k])).sin();
            log.torque[4][k] += torque;
            log.torque[5][k] -= torque;
        }
        log
    };
    let logs: Vec<Log> = (0..2).map(rippled).collect();
    let explained = explain(&arm, &logs, &[rippled(9)], &ExplainOptions::default()).unwrap();
    let found: Vec<_> = explained.effects.iter().map(|e| (e.effect.as_str(), e.joints.clone())).collect();
    assert_eq!(found, [("position_ripple", vec![JointNumber::from_index(5)])]);
    let said = serde_json::to_value(&explained.effects[0]).unwrap();
    let number = |key: &str| said["parameters"][key][0].as_f64().unwrap();
    approx::assert_relative_eq!(number("orders"), order, max_relative = 1e-3);
    approx::assert_relative_eq!(number("amplitudes"), size, max_relative = 0.03);
    // Its terms are within their standard errors, which are reported.
    for t in &explained.model.additions.terms {
        let truth = match t.term.law {
            Law::Sine { .. } => size,
            Law::Cosine { .. } => 0.0,
            other => panic!("{other:?}"),
        };
        let std = t.std.unwrap();
        println!("{:?}: {} ± {std}", t.term.law, t.term.coefficient);
        assert!(std < 0.02 * size && (t.term.coefficient - truth).abs() < 4.0 * std);
    }
}
