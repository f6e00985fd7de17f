//! The model's file and what is done with a model, against what must stay the same.

use super::*;
use dyngen::Arm;
use powerball_controller::correction::Law;
use powerball_logs::log::Log;
use powerball_logs::regression::{Recording, RigidArm};
use std::f64::consts::TAU;

pub(crate) fn every_law() -> Vec<Law<f64>> {
    vec![
        Law::Constant,
        Law::VelocityMagnitude,
        Law::Load { steepness: 216.5 },
        Law::Stribeck { steepness: 80.0, velocity: 0.05 },
        Law::Power { steepness: 80.0, power: 0.5 },
        Law::Presliding { distance: 0.004 },
        Law::Position,
        Law::Cosine { order: 7.0 },
        Law::Sine { order: 161.25 },
        Law::CoolFriction { time_constant: 60.0 },
        Law::CoolVelocity { time_constant: 60.0 },
        Law::HotFriction { reference: 21.5 },
        Law::HotVelocity { reference: 21.5 },
        Law::OtherDirection { other: 3, steepness: 50.0 },
        Law::OtherVelocity { other: 3 },
        Law::OtherPosition { other: 0 },
        Law::PositionProduct { joints: [1, 2] },
        Law::CosineOfTwo { joints: [1, 2], orders: [1.0, -2.0] },
        Law::SineOfTwo { joints: [0, 3], orders: [2.0, 1.0] },
        Law::VelocityProduct { other: 2 },
        Law::VelocityByMagnitude { other: 3 },
        Law::OtherAcceleration { other: 3 },
        Law::SumDirection { other: 3, own: 1.0, theirs: -1.0, steepness: 50.0 },
        Law::SumVelocity { other: 3, own: 1.0, theirs: -1.0 },
        Law::SumAcceleration { other: 3, own: 1.0, theirs: -1.0 },
        Law::Torque,
        Law::TorqueMagnitude { scale: 64.0 },
        Law::TorqueSquare { scale: 64.0 },
        Law::Gap { gap: 0.002 },
        Law::Flight { reach: 0.002 },
        Law::Compliance,
        Law::DirectionCosine { order: 1.0, steepness: 50.0 },
        Law::DirectionSine { order: 2.0, steepness: 50.0 },
        Law::HangingBack { scale: 30.0 },
    ]
}

pub(crate) fn body() -> RigidArm {
    let mut arm = Arm::parse(include_str!("../../../lwa4p.toml"), "lwa4p.toml").unwrap();
    arm.groupings.clear();
    RigidArm::new(&arm).unwrap()
}

/// A model with the given laws at the second joint and values without meaning.
pub(crate) fn model(body: &RigidArm, laws: &[Law<f64>]) -> TorqueModel {
    let value = |k: usize| 0.3 + 0.1 * (k as f64 * 1.7).sin();
    let friction = (0..body.dof()).map(|joint| JointFriction::plain(joint, [4.5, 216.0, 2.0, 4.7, 15.0]));
    let term = |(k, law): (usize, &Law<f64>)| NamedTerm {
        effect: format!("effect_{k}"),
        std: (k % 2 == 0).then_some(1e-3),
        term: Term { joint: 1, coefficient: 0.01 * (k + 1) as f64, law: *law },
    };
    TorqueModel {
        arm: body.arm().name.clone(),
        set: "minimal".into(),
        parameters: body
            .names()
            .iter()
            .enumerate()
            .map(|(k, name)| ParameterEstimate::plain(name, value(k)))
            .collect(),
        friction: friction.collect(),
        joint_bands: Vec::new(),
        additions: Additions { terms: laws.iter().enumerate().map(term).collect(), ..Additions::default() },
        colour: None,
    }
}

pub(crate) fn recording(n: usize, shift: f64) -> Recording {
    let (rate, samples) = (100.0, 400);
    let wave = |k: usize, j: usize, d: usize| {
        let w = 1.0 + 0.3 * j as f64;
        let x = w * k as f64 / rate;
        match d {
            0 => 0.5 * x.sin() + if j == 1 { shift } else { 0.0 },
            1 => 0.5 * w * x.cos(),
            _ => -0.5 * w * w * x.sin(),
        }
    };
    let state = |d: usize| (0..samples * n).map(|i| wave(i / n, i % n, d)).collect();
    Recording {
        smoothing: 24.0,
        log: 0,
        start: 2.0,
        clock: 12.0,
        rate,
        q: state(0),
        v: state(1),
        a: state(2),
        torque: vec![vec![0.0; samples]; n],
        temperature: Some(vec![(0..samples).map(|k| 20.0 + 0.01 * k as f64).collect(); n]),
        dof: n,
    }
}

#[test]
fn every_law_comes_back_from_the_file() {
    let body = body();
    let mut written = model(&body, &every_law());
    written.additions.log_changes.delay = vec![0.0, 0.004, 0.0, 0.0, 0.0, 0.0];
    written.additions.arm_changes.not_zero = vec!["my3".into()];
    written.additions.payloads = vec![Payload {
        link: None,
        mass: 2.0,
        com: [0.0, 0.1, 0.2],
        logs: vec!["a.csv".into(), "b.csv".into()],
        start_time: vec![1.0, 2.0],
        end_time: vec![Some(9.0), None],
    }];
    let file = std::env::temp_dir().join(format!("powerball_model_{}.json", std::process::id()));
    std::fs::write(&file, serde_json::to_string_pretty(&written).unwrap()).unwrap();
    let read = TorqueModel::read(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert_eq!(read, written);
    // Joints count from 1 in the file.
    let json = serde_json::to_value(&written).unwrap();
    assert_eq!(json["terms"][13]["joint"], 2);
    assert_eq!(json["terms"][13]["law"], "other_direction");
    assert_eq!(json["terms"][13]["other"], 4);
}

/// A known delay is taken out of fast torques too: 20 Hz at 100 samples a second.
#[test]
fn a_known_delay_makes_a_torque_early_and_not_weaker() {
    let body = body();
    let mut known = model(&body, &[]);
    known.additions.log_changes.delay = vec![0.0045; body.dof()];
    let t: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
    let wave = |late: f64| -> Vec<f64> { t.iter().map(|t| (20.0 * TAU * (t - late)).sin()).collect() };
    let log = Log {
        file: "log.csv".into(),
        q: vec![vec![0.0; t.len()]; body.dof()],
        torque: vec![wave(0.0045); body.dof()],
        temperature: None,
        motor: None,
        pieces: vec![0..200, 200..400],
        doubts: Vec::new(),
        clock: 0.0,
        t: t.clone(),
    };
    let mut logs = [log];
    known.take_out(&body, &mut logs);
    let truth = wave(0.0);
    for k in (10..190).chain(210..390) {
        approx::assert_abs_diff_eq!(logs[0].torque[1][k], truth[k], epsilon = 6e-3);
    }
}

#[test]
fn a_model_of_another_arm_is_refused_with_the_reason() {
    let body = body();
    let whole = model(&body, &[Law::Position]);
    let refused = |change: &dyn Fn(&mut TorqueModel)| {
        let mut model = whole.clone();
        change(&mut model);
        let checked = model.checked(body.names(), body.dof(), std::path::Path::new("m.json"));
        checked.map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(refused(&|_| ()), Ok(()));
    let wrong = |change: &dyn Fn(&mut TorqueModel), words: &str| {
        let reason = refused(change).unwrap_err();
        assert!(reason.contains(words) && reason.starts_with("m.json: "), "{reason}");
    };
    wrong(&|m| m.parameters.truncate(3), "no value for the parameter");
    wrong(&|m| m.friction.truncate(5), "no friction for joint 6");
    wrong(&|m| m.additions.terms[0].term.joint = 6, "a joint that the arm does not have");
    wrong(
        &|m| m.additions.terms[0].term.law = Law::OtherVelocity { other: 9 },
        "a joint that the arm does not have",
    );
    wrong(&|m| m.additions.log_changes.delay = vec![0.1], "1 numbers for 6 joints");
    let changes = ArmChanges { not_zero: vec!["mx9".into()], gravity: None };
    assert!(changes.of(body.arm()).unwrap_err().to_string().contains("'mx9'"));
}

/// What `powerball identify` writes for logs without torque.
#[test]
fn servos_are_no_torque_model() {
    let text = r#"{"set": "servo", "parameters": [], "friction": [{"joint": 1, "coulomb": 0.1}]}"#;
    let why = TorqueModel::parse(text, std::path::Path::new("identified.json")).unwrap_err().to_string();
    assert!(
        why.starts_with("identified.json: is of position servos and has no torque model; dyngen"),
        "{why}"
    );
}

/// One arm: its logs shifted by an offset, its terms written for true positions.
#[test]
fn putting_a_zero_right_does_not_change_the_torque() {
    let body = body();
    // All but the rigid arm: that one is to see the true position in both.
    let mut logged = model(&body, &every_law());
    logged.additions.terms.retain(|t| !t.term.law.needs_torque());
    logged.parameters.iter_mut().for_each(|p| p.value = 0.0);
    let (offset, never) = (0.03, |_: f64| false);
    let mut right = logged.clone();
    right.additions.put_zero_right(powerball_controller::JointNumber::from_index(1), offset);
    right.additions.log_changes.encoder_offset = vec![0.0, offset, 0.0, 0.0, 0.0, 0.0];
    let recording = recording(6, offset);
    let (a, b) = (logged.torque(&body, &recording, &never), right.torque(&body, &recording, &never));
    a.iter().zip(&b).for_each(|(a, b)| approx::assert_abs_diff_eq!(a, b, epsilon = 1e-9));
    // And it is not that nothing depends on the position.
    let elsewhere = logged.torque(&body, &self::recording(6, 0.0), &never);
    assert!(a.iter().zip(&elsewhere).any(|(a, b)| (a - b).abs() > 1e-3));
}

/// A payload's torque is that of a point mass by its potential and kinetic energy: here, held still, its
/// weight's lever.
#[test]
fn a_payload_weighs_what_it_should() {
    let body = body();
    let mut loaded = model(&body, &[]);
    loaded.additions.payloads = vec![Payload {
        link: None,
        mass: 2.0,
        com: [0.1, 0.0, 0.05],
        logs: Vec::new(),
        start_time: Vec::new(),
        end_time: Vec::new(),
    }];
    let mut still = recording(6, 0.0);
    still.v.iter_mut().chain(&mut still.a).for_each(|x| *x = 0.0);
    let with = loaded.torque(&body, &still, &|_| true);
    let without = loaded.torque(&body, &still, &|_| false);
    // −∂/∂q of the work of the weight, from the pose of the last frame alone.
    let model = dyngen::Model::derive(body.arm().clone()).unwrap();
    let pose = dyngen::Evaluator::new(&model, dyngen::Function::ForwardKinematics, dyngen::SetKind::Minimal)
        .unwrap();
    let height = |q: &[f64]| {
        let mut t = vec![0.0; 16];
        pose.evaluate(q, &[], &[], &[], &mut t);
        t[8] * 0.1 + t[10] * 0.05 + t[11]
    };
    for k in [0usize, 100, 250] {
        let q = &still.q[6 * k..6 * (k + 1)];
        for j in 0..6 {
            let moved = |by: f64| {
                let mut q = q.to_vec();
                q[j] += by;
                height(&q)
            };
            let expected = 2.0 * 9.81 * (moved(1e-5) - moved(-1e-5)) / 2e-5;
            approx::assert_abs_diff_eq!(with[6 * k + j] - without[6 * k + j], expected, epsilon = 1e-6);
        }
    }
}

/// The lifted symmetry: one more parameter, the same torque for the same bodies.
#[test]
fn code_for_changed_arms_holds_what_was_changed() {
    let body = body();
    let mut changed = model(&body, &[Law::Compliance, Law::Position]);
    changed.additions.arm_changes =
        ArmChanges { gravity: Some([0.1, -0.2, -9.8]), not_zero: vec!["mx3".into()] };
    let arm = changed.additions.arm_changes.of(body.arm()).unwrap();
    let other = RigidArm::new(&arm).unwrap();
    assert!(other.names().len() > body.names().len());
    changed.parameters = model(&other, &[]).parameters;
    let source = changed.source(body.arm(), Scalar::F32, &[]).unwrap();
    assert!(source.contains("pub type Real = f32;") && source.contains("Law::Compliance"));
    assert!(source.contains("// Note: joint 2: gives way by 1e-2 rad for 1 N·m"));
    assert_eq!(source, changed.source(body.arm(), Scalar::F32, &[]).unwrap());
}
