//! An arm of two joints that move in one plane: it feels nothing across it, and few logs are enough.

use crate::excite::{Fourier, Harmonics};
use crate::explain::{Explained, explain};
use crate::friction::TanhFriction;
use crate::log::{Log, common_clock};
use crate::regression::{DataOptions, RigidBody};
use crate::virtual_arm::{Body, Chain, Dynamics, Effect, Plant, Sensors};
use dyngen::Arm;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const PAYLOAD: f64 = 0.2;
/// The first logs are fitted, the rest judges.
const FITTED: usize = 4;
const LOGS: usize = 6;

fn arm() -> Arm {
    Arm::parse(include_str!("../../../../tests/arms/planar2r.toml"), "planar2r.toml").unwrap()
}

fn plant(arm: &Arm) -> Plant {
    let bodies = vec![
        Body::even_box(4.0, [-0.2, 0.01, 0.0], [0.4, 0.08, 0.08], 4e-5),
        Body::even_box(2.0, [-0.15, 0.0, 0.02], [0.3, 0.06, 0.06], 4e-5),
    ];
    let friction = [4.0, 2.0].map(|level| TanhFriction::new([0.7 * level, 60.0, 0.3 * level, 4.0, level]));
    let sensors = Sensors {
        rate: 200.0,
        encoder_step: 0.001f64.to_radians(),
        white: vec![0.2, 0.06],
        coloured: vec![0.0; 2],
        colour_time: 0.15,
    };
    Plant::new(Dynamics::new(Chain::new(arm), bodies).unwrap(), friction.to_vec(), sensors)
}

/// Logs of `usual`, but for those that are listed, which are of `changed`.
fn record(usual: &Plant, changed: &Plant, listed: &[usize], seed: u64) -> Vec<Log> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut logs: Vec<Log> = (0..LOGS)
        .map(|k| {
            let mut draw = || (0..5).map(|l| rng.random_range(-0.6..0.6) / f64::from(l + 1)).collect();
            let joints = (0..2).map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).collect();
            let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints };
            let plant = if listed.contains(&k) { changed } else { usual };
            plant.record(&path.sample(200.0), 0.0, seed + k as u64).log(format!("log{k}"))
        })
        .collect();
    common_clock(&mut logs);
    logs
}

fn explained(changed: Effect, listed: &[usize]) -> Explained {
    let arm = arm();
    let plant = plant(&arm);
    let logs = record(&plant, &plant.clone().with(changed), listed, 7);
    let (fit, validate) = logs.split_at(FITTED);
    let body = RigidBody::new(&arm).unwrap();
    explain(&body, fit, validate, &DataOptions::default(), &|_| ()).unwrap()
}

fn at_the_floor(explained: &Explained) {
    for (after, floor) in explained.after.validate.rms.iter().zip(&explained.noise_floor) {
        assert!(*after < 1.15 * floor, "{:?} {:?}", explained.after.validate.rms, explained.noise_floor);
    }
}

#[test]
fn logs_say_whether_a_payload_is_held_in_them() {
    // Put on in the last fitted log, so that by the clock it stays; taken off before the others, or before one of them.
    for listed in [&[3][..], &[3, 5], &[3, 4, 5], &[1], &[1, 4]] {
        let payload = Effect::Payload { mass: PAYLOAD, centre: [0.05, 0.02, 0.0], start: 0.0 };
        let explained = explained(payload, listed);
        let names: Vec<&str> = explained.effects.iter().map(|e| e.effect.as_str()).collect();
        assert_eq!(names, ["payload"], "{listed:?}");
        let found = &explained.effects[0];
        let mass = found.parameters["mass"].as_f64().unwrap();
        approx::assert_relative_eq!(mass, PAYLOAD, max_relative = 0.1);
        let logs: Vec<String> = listed.iter().map(|k| format!("log{k}")).collect();
        assert_eq!(found.logs, logs);
        at_the_floor(&explained);
    }
}

#[test]
fn a_push_is_found_by_what_the_arm_feels_of_it() {
    let push = Effect::ContactWrench { force: [1.5, 3.0, 20.0], start: 6.0, length: 4.0, every: 1e3 };
    let explained = explained(push, &[2]);
    let names: Vec<&str> = explained.effects.iter().map(|e| e.effect.as_str()).collect();
    assert_eq!(names, ["contact_wrench"]);
    let force: Vec<f64> = explained.effects[0].parameters["force"][0]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f.as_f64().unwrap())
        .collect();
    // Across its plane the arm feels nothing.
    approx::assert_relative_eq!(force[0], 1.5, epsilon = 0.3);
    approx::assert_relative_eq!(force[1], 3.0, epsilon = 0.3);
    assert_eq!(force[2], 0.0);
    at_the_floor(&explained);
}
