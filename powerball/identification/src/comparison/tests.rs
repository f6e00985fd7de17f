//! Simulated pairs: the virtual arm with its own dynamics, sensors and noise, recorded twice.

mod bars;

use super::strokes::{changes, strokes};
use super::{Cause, CompareOptions, Comparison, Side, compare};
use crate::estimate::{
    FrictionKind, Uncertainty, estimates, reduce_in_bands, solve_in_band, standard_errors,
};
use crate::excite::{Fourier, Harmonics};
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use powerball_controller::friction::TanhFriction;
use powerball_logs::chain::Chain;
use powerball_logs::log::Log;
use powerball_logs::regression::{DataOptions, RigidArm};
use powerball_logs::summary::Bands;
use powerball_virtual_arm::{Body, Dynamics, Plant, PlantEffect, lwa4p};
use rand::{RngExt, SeedableRng};
use std::sync::LazyLock;

/// A fit of three logs of 20 s.
fn fitted(body: &RigidArm, links: Vec<Body>, friction: Vec<TanhFriction<f64>>, seed: u64) -> Side {
    let chain = Chain::new(&lwa4p::arm().unwrap());
    let sensors = lwa4p::plant().unwrap().sensors().clone();
    let plant = Plant::new(Dynamics::new(chain, links).unwrap(), friction, sensors);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let logs = (0..3).map(|log| {
        let mut draw = || (0..5).map(|_| 0.25 * rng.random_range(-1.0..1.0)).collect();
        let joints = (0..6).map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).collect();
        let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods: 2, ramp: 1.0, joints };
        plant.record(&path.sample(plant.sensors().rate), 0.0, 1000 * seed + log).log("virtual")
    });
    fitted_to(body, logs, seed)
}

/// A fit of some logs.
fn fitted_to(body: &RigidArm, logs: impl Iterator<Item = Log>, seed: u64) -> Side {
    let options = DataOptions::default();
    let mut bands = Bands::new(body, &options);
    for log in logs {
        bands.merge(&reduce_in_bands(body, &log, &options).unwrap().0).unwrap();
    }
    let solution = solve_in_band(&bands, FrictionKind::Symmetric).solution;
    let errors = standard_errors(&solution);
    let found = estimates(body.names(), &solution, &errors);
    let uncertainty = Some(Uncertainty::of(body.names(), &solution, &errors));
    let (parameters, friction) = (found.parameters, found.friction);
    Side {
        name: format!("seed {seed}"),
        arm: "virtual".into(),
        bars: body.arm().bars.iter().map(|bar| bar.name.clone()).collect(),
        parameters,
        friction,
        uncertainty,
        strokes: Vec::new(),
        unusable: Vec::new(),
    }
}

/// The usual arm, which every other one is compared with.
fn usual() -> &'static Side {
    static USUAL: LazyLock<Side> = LazyLock::new(|| {
        let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
        fitted(&body, lwa4p::links(), table(), 1)
    });
    &USUAL
}

fn table() -> Vec<TanhFriction<f64>> {
    lwa4p::plant().unwrap().friction().to_vec()
}

/// Viscous friction of the third joint `factor` times as large.
fn viscous(factor: f64) -> Vec<TanhFriction<f64>> {
    let mut friction = table();
    let [g1, g2, g3, g4, g5] = powerball_controller::friction::TABLE_2[2];
    friction[2] = TanhFriction::new([g1, g2, g3, g4, factor * g5]);
    friction
}

fn compared(a: &Side, b: &Side) -> Comparison {
    compare(a, b, &CompareOptions::default()).unwrap()
}

#[test]
fn equal_arms_are_equal_and_five_per_cent_of_viscous_friction_is_seen() {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let a = usual();
    for seed in 2..4 {
        let same = compared(a, &fitted(&body, lwa4p::links(), table(), seed));
        assert!(!same.differ && same.sentence.starts_with("Same arm"), "{}", same.sentence);
        // What differs in torque is what the errors of both make.
        for t in &same.torque_difference {
            assert!(t.rms < 3.0 * t.expected && t.relative < 0.02, "{t:?}");
        }
        let changed = fitted(&body, lwa4p::links(), viscous(1.05), 10 + seed);
        let other = compared(a, &changed);
        assert!(other.differ);
        let [Cause::Friction { joint: 3, change: [low, high] }] = other.causes[..] else {
            panic!("{}", other.sentence)
        };
        // Viscous friction is a part of it all.
        assert!(low > 0.0 && high < 0.1, "{low} {high}");
        assert!(other.sentence.starts_with("Friction of joint 3 is higher by"), "{}", other.sentence);
        // The other way round it is the other way round.
        let back = compared(&changed, a);
        assert!(back.differ && back.friction[2].change[1] < 0.0);
        assert_eq!(back.parameters[0].difference, -other.parameters[0].difference);
    }
}

#[test]
fn a_payload_is_reported_with_its_mass() {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let a = usual();
    let mut links = lwa4p::links();
    let last = links.last_mut().unwrap();
    let load = Body::even_box(1.0, [0.02, 0.0, 0.1], [0.05; 3], 0.0);
    (last.mass, last.moment, last.inertia) =
        (last.mass + load.mass, last.moment + load.moment, last.inertia + load.inertia);
    let loaded = compared(a, &fitted(&body, links, table(), 5));
    let Some(Cause::Payload { link: 6, mass: Some([mass, std]), body: None, .. }) = loaded.causes.first()
    else {
        panic!("{}", loaded.sentence)
    };
    assert!((mass - 1.0).abs() < 4.0 * std && *std < 0.2, "{mass} ± {std}");
    assert!(!loaded.friction.iter().any(|f| f.differs), "{}", loaded.sentence);
}

/// The built-in arm's last link has declared symmetries, which a load need not have: without them the whole
/// body is determined.
#[test]
fn a_payload_of_an_arm_without_symmetries_is_a_whole_body() {
    let text = include_str!("../../../lwa4p.toml");
    let symmetries = "zero = [\"mx\", \"my\", \"Ixy\", \"Ixz\", \"Iyz\"]";
    assert_eq!(text.matches(symmetries).count(), 1);
    let body = RigidArm::new(&Arm::parse(&text.replace(symmetries, ""), "lwa4p.toml").unwrap()).unwrap();
    let mut links = lwa4p::links();
    let last = links.last_mut().unwrap();
    let load = Body::even_box(1.0, [0.02, -0.03, 0.1], [0.05, 0.1, 0.2], 0.0);
    (last.mass, last.moment, last.inertia) =
        (last.mass + load.mass, last.moment + load.moment, last.inertia + load.inertia);
    let [a, b] = [(lwa4p::links(), 1), (links, 5)].map(|(links, seed)| fitted(&body, links, table(), seed));
    let loaded = compared(&a, &b);
    let Some(Cause::Payload { link: 6, body: Some(found), .. }) = loaded.causes.first() else {
        panic!("{} {:?}", loaded.sentence, loaded.causes)
    };
    assert!((found.mass - 1.0).abs() < 4.0 * found.mass_std && found.mass_std < 0.2, "{found:?}");
    for (found, truth) in found.com.iter().zip([0.02, -0.03, 0.1]) {
        approx::assert_relative_eq!(*found, truth, epsilon = 0.01);
    }
    // A box about its centre: m·(b² + c²)/12.
    let [x, y, z] = [0.05f64, 0.1, 0.2].map(|side| side.powi(2) / 12.0);
    let truth = [y + z, 0.0, 0.0, x + z, 0.0, x + y];
    let (elements, errors) = (found.inertia.unwrap(), found.inertia_std.unwrap());
    for ((element, std), truth) in elements.iter().zip(errors).zip(truth) {
        assert!((element - truth).abs() < 4.0 * std && std < 0.01, "{element} ± {std}: {truth}");
    }
}

/// An arm whose friction differs by a tenth between the halves of its own log is not reported to differ by a
/// twentieth from another one; halves that are alike change nothing to speak of.
#[test]
fn what_varies_within_a_log_is_no_difference_of_arms() {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let (a, other) = (usual(), fitted(&body, lwa4p::links(), viscous(1.05), 12));
    let [same, warm] =
        [(2, 1.0), (3, 1.1)].map(|(seed, factor)| fitted(&body, lwa4p::links(), viscous(factor), seed));
    assert!(compared(&a.clone().repeated([a, &same]), &other).differ);
    let varies = compared(&a.clone().repeated([a, &warm]), &other);
    assert!(!varies.differ, "{}", varies.sentence);
}

#[test]
fn what_cannot_be_compared_is_reported() {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let a = usual();
    let mut other = a.clone();
    other.parameters.pop();
    let refused = compare(a, &other, &CompareOptions::default()).unwrap_err().to_string();
    assert!(refused.contains("one arm file"), "{refused}");
    let level = compare(a, a, &CompareOptions { level: 1.5 }).unwrap_err().to_string();
    assert!(level.contains("--level"), "{level}");
    // Without the covariance less is known, never more.
    let bare = Side { uncertainty: None, ..a.clone() };
    let b = fitted(&body, lwa4p::links(), viscous(1.05), 12);
    let alone = compared(&bare, &b);
    assert!(alone.warnings[0].contains("covariance.json"));
    for (with, without) in compared(a, &b).friction.iter().zip(&alone.friction) {
        let width = |[low, high]: [f64; 2]| high - low;
        assert!(width(without.interval[0]) >= 0.9 * width(with.interval[0]));
    }
}

/// A tenth of a joint's friction is seen between two logs of one path, with its sign, also where the other
/// arm holds a body; the same arm on the same path again is the same.
#[test]
fn a_tenth_of_friction_is_seen_along_one_path() {
    let chain = Chain::new(&lwa4p::arm().unwrap());
    let sensors = lwa4p::plant().unwrap().sensors().clone();
    let harmonics = |j: usize| {
        let swing = if j == 1 || j == 2 { 0.6 } else { 0.0 };
        Harmonics { middle: 0.2, a: vec![0.0, swing, 0.3 * swing], b: vec![0.2 * swing, 0.0, 0.0] }
    };
    let joints = (0..6).map(harmonics).collect();
    let path = Fourier { fundamental: std::f64::consts::TAU / 6.0, periods: 6, ramp: 1.0, joints };
    let strokes_of = |factor: f64, links: Vec<Body>, seed: u64| {
        let mut friction = table();
        let f = friction[2];
        friction[2] =
            TanhFriction::new([factor * f.gamma1, f.gamma2, factor * f.gamma3, f.gamma4, factor * f.gamma5]);
        let plant = Plant::new(Dynamics::new(chain.clone(), links).unwrap(), friction, sensors.clone());
        strokes(&plant.record(&path.sample(plant.sensors().rate), 0.0, seed).log("virtual"))
    };
    let mut loaded = lwa4p::links();
    let (last, load) = (loaded.last_mut().unwrap(), Body::even_box(0.5, [0.0, 0.0, 0.1], [0.05; 3], 0.0));
    (last.mass, last.moment, last.inertia) =
        (last.mass + load.mass, last.moment + load.moment, last.inertia + load.inertia);
    let usual = strokes_of(1.0, lwa4p::links(), 1);
    for (factor, links, seed) in [
        (1.1, lwa4p::links(), 2),
        (0.9, lwa4p::links(), 3),
        (1.1, loaded.clone(), 4),
        (1.0, lwa4p::links(), 5),
        (1.0, loaded, 6),
    ] {
        let changes = changes(&usual, &strokes_of(factor, links, seed));
        assert!([0, 3, 4, 5].iter().all(|j: &usize| changes[*j].is_none()), "{changes:?}");
        let [other, own] = [1, 2].map(|j: usize| changes[j].unwrap());
        assert!(other.p_value() > 0.01 && (own.p_value() < 1e-3) == (factor != 1.0), "{factor} {changes:?}");
        let [low, high] = own.interval(0.01);
        assert!(low < factor - 1.0 + 0.01 && high > factor - 1.0 - 0.01 && high - low < 0.08, "{low} {high}");
    }
    // Logs of another path are not compared so.
    let other = Fourier { fundamental: std::f64::consts::TAU / 5.0, ..path.clone() };
    let plant = lwa4p::plant().unwrap();
    let elsewhere = strokes(&plant.record(&other.sample(plant.sensors().rate), 0.0, 7).log("virtual"));
    assert!(changes(&usual, &elsewhere).iter().all(Option::is_none));
}

/// Friction that is higher at low velocity alone is seen along one path, where the fast part of every stroke
/// is the same; the same arm on that path again is the same arm.
#[test]
fn friction_at_low_velocity_is_seen_along_one_path() {
    let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
    let plant = lwa4p::plant().unwrap();
    let harmonics = |j: usize| {
        let turn = j as f64;
        Harmonics { middle: 0.0, a: vec![0.5, 0.2 * turn.cos()], b: vec![0.2 * turn.sin(), 0.3] }
    };
    let joints = (0..6).map(harmonics).collect();
    let path = Fourier { fundamental: std::f64::consts::TAU / 10.0, periods: 6, ramp: 1.0, joints };
    let side = |plant: &Plant, seed: u64| {
        let log = plant.record(&path.sample(plant.sensors().rate), 0.0, seed).log("virtual");
        fitted_to(&body, std::iter::once(log.clone()), seed).along(&log)
    };
    let usual = side(&plant, 1);
    let slow = PlantEffect::Stribeck { joint: 2, level: 6.0, velocity: 0.08 };
    let found = compared(&usual, &side(&plant.clone().with(slow), 2));
    let differ: Vec<usize> = found.friction.iter().filter(|f| f.differs).map(|f| f.joint).collect();
    assert_eq!(differ, [3], "{}", found.sentence);
    assert!(changes(&usual.strokes, &usual.strokes)[2].is_some());
    for seed in 3..6 {
        let same = compared(&usual, &side(&plant, seed));
        assert!(!same.differ, "{}", same.sentence);
    }
}
