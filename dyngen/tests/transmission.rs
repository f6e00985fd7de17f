//! Motors that turn with several joints: every function is proven, and the torque is what finite differences
//! of the energy give, from numeric transforms that share nothing with the generator.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::arm::{Convention, JointKind};
use dyngen::exact::rational::to_f64;
use dyngen::{Arm, Evaluator, Function, Samples, SetKind};
use rand::{RngExt, SeedableRng};
use support::{State, evaluate, model, proven};

mod support;

/// A wrist whose last motor turns with the joint before, a shoulder whose two motors work on parallel axes,
/// and axes that point both ways.
const WRIST: &str = r#"
name = "wrist"
convention = "standard"
gravity = [0, 0.5, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = "pi/2", d = 0.3, theta = 0, rotor_ratio = 100 },
    { kind = "revolute", a = 0.4, alpha = "pi", d = 0, theta = "pi/2", rotor_ratio = 80 },
    { kind = "revolute", a = 0.1, alpha = "-pi/2", d = 0.05, theta = 0, rotor_ratio = 80 },
    { kind = "revolute", a = 0, alpha = "pi/2", d = 0.35, theta = 0, rotor_ratio = 50 },
    { kind = "revolute", a = 0, alpha = "-pi/2", d = 0, theta = 0, rotor_ratio = 60 },
    { kind = "revolute", a = 0.02, alpha = 0, d = 0.1, theta = 0, rotor_ratio = 40 },
]

[[transmission]]
joints = [5, 6]
matrix = [[1, 0], ["1/2", 1]]

[[transmission]]
joints = [2, 3]
matrix = [[1, -1], [0, 1]]
"#;

/// General twists, a sliding joint and a block of three whose motors turn with joints before and behind them.
const MIXED: &str = r#"
name = "mixed"
convention = "modified"
gravity = [1, 2, -9]
joint = [
    { kind = "revolute", a = 0.1, alpha = 0.3, d = 0.2, theta = 0.1, rotor_ratio = 9 },
    { kind = "prismatic", a = 0.2, alpha = "pi/2", d = 0.1, theta = "pi/6", rotor_ratio = 7 },
    { kind = "revolute", a = 0.3, alpha = 1.1, d = 0, theta = 0, rotor_ratio = 5 },
]

[[transmission]]
joints = [3, 1, 2]
matrix = [[1, 2, 0.5], [-1, 1, 0], [1, 0, 3]]
"#;

#[test]
fn every_function_is_proven() {
    for text in [WRIST, MIXED] {
        let model = model(text);
        for kind in [SetKind::Minimal, SetKind::Full, SetKind::Symbolic] {
            assert_eq!(proven(&model, kind).len(), model.functions(kind).count());
        }
    }
}

type Pose = [[f64; 4]; 4];

fn times(a: &Pose, b: &Pose) -> Pose {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn about_z(angle: f64, shift: f64) -> Pose {
    let (s, c) = angle.sin_cos();
    [[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, shift], [0.0, 0.0, 0.0, 1.0]]
}

fn about_x(angle: f64, shift: f64) -> Pose {
    let (s, c) = angle.sin_cos();
    [[1.0, 0.0, 0.0, shift], [0.0, c, -s, 0.0], [0.0, s, c, 0.0], [0.0, 0.0, 0.0, 1.0]]
}

/// Poses of all links, and of each joint's axis as its z in the link before.
fn poses(arm: &Arm, q: &[f64]) -> (Vec<Pose>, Vec<Pose>) {
    let mut pose = about_z(0.0, 0.0);
    let (mut links, mut axes) = (Vec::new(), Vec::new());
    for (joint, q) in arm.joints.iter().zip(q) {
        let (theta, d) = match joint.kind {
            JointKind::Revolute => (joint.theta.radians() + q, to_f64(&joint.d)),
            JointKind::Prismatic => (joint.theta.radians(), to_f64(&joint.d) + q),
        };
        let (z, x) = (about_z(theta, d), about_x(joint.alpha.radians(), to_f64(&joint.a)));
        if arm.convention == Convention::Modified {
            pose = times(&pose, &x);
        }
        axes.push(pose);
        pose = times(&pose, &z);
        if arm.convention == Convention::Standard {
            pose = times(&pose, &x);
        }
        links.push(pose);
    }
    (links, axes)
}

/// Kinetic less potential energy, from positions shortly before and after.
fn lagrangian(arm: &Arm, values: &[f64], q: &[f64], dq: &[f64]) -> f64 {
    const H: f64 = 1e-4;
    let at = |t: f64| poses(arm, &q.iter().zip(dq).map(|(q, v)| q + t * v).collect::<Vec<_>>());
    let ((links, axes), (before, _), (after, _)) = (at(0.0), at(-H), at(H));
    let rate = |k: usize, i: usize, j: usize| (after[k][i][j] - before[k][i][j]) / (2.0 * H);
    // ω from Ṙ·Rᵀ, in the base frame.
    let omega = |k: usize| -> [f64; 3] {
        let spin = |i: usize, j: usize| (0..3).map(|c| rate(k, i, c) * links[k][j][c]).sum::<f64>();
        [spin(2, 1), spin(0, 2), spin(1, 0)]
    };
    let matrix = arm.motor_velocity_matrix_f64();
    let mut total = 0.0;
    for (k, joint) in arm.joints.iter().enumerate() {
        let p = &values[11 * k..][..11];
        // In the link's own axes.
        let inside = |v: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| (0..3).map(|j| links[k][j][i] * v[j]).sum())
        };
        let (w, v) = (inside(omega(k)), inside(std::array::from_fn(|i| rate(k, i, 3))));
        let g: Vec<f64> = arm.gravity.iter().map(to_f64).collect();
        let height: f64 = (0..3).map(|i| g[i] * links[k][i][3]).sum();
        let g = inside([g[0], g[1], g[2]]);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let s = [p[1], p[2], p[3]];
        let inertia = [[p[4], -p[5], -p[6]], [-p[5], p[7], -p[8]], [-p[6], -p[8], p[9]]];
        let turning: f64 = (0..3).map(|i| w[i] * dot(inertia[i], w)).sum();
        total += 0.5 * p[0] * dot(v, v) + dot(s, cross(v, w)) + 0.5 * turning + p[0] * height + dot(s, g);
        if let Some(ratio) = &joint.rotor_ratio {
            let z: [f64; 3] = std::array::from_fn(|i| axes[k][i][2]);
            let carrier = if k == 0 { 0.0 } else { dot(omega(k - 1), z) };
            let spin = to_f64(ratio) * matrix[k].iter().zip(dq).map(|(m, v)| m * v).sum::<f64>();
            total += p[10] * (spin * carrier + 0.5 * spin * spin);
        }
    }
    total
}

/// d/dt ∂L/∂q̇ − ∂L/∂q by central differences of second order.
fn torque(arm: &Arm, values: &[f64], q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
    const H: f64 = 1e-3;
    let n = q.len();
    let shifted = |x: &[f64], j: usize, h: f64| -> Vec<f64> {
        x.iter().enumerate().map(|(k, x)| if k == j { x + h } else { *x }).collect()
    };
    let momentum = |q: &[f64], dq: &[f64], j: usize| {
        (lagrangian(arm, values, q, &shifted(dq, j, H)) - lagrangian(arm, values, q, &shifted(dq, j, -H)))
            / (2.0 * H)
    };
    (0..n)
        .map(|j| {
            let along = |t: f64| {
                let later: Vec<f64> = (0..n).map(|k| q[k] + t * dq[k] + 0.5 * t * t * ddq[k]).collect();
                let velocities: Vec<f64> = (0..n).map(|k| dq[k] + t * ddq[k]).collect();
                momentum(&later, &velocities, j)
            };
            let rate = (along(H) - along(-H)) / (2.0 * H);
            let by_position = (lagrangian(arm, values, &shifted(q, j, H), dq)
                - lagrangian(arm, values, &shifted(q, j, -H), dq))
                / (2.0 * H);
            rate - by_position
        })
        .collect()
}

#[test]
fn the_torque_is_that_of_the_energy() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for text in [WRIST, MIXED] {
        let model = model(text);
        let (arm, n) = (model.arm(), model.arm().dof());
        let set = model.set(SetKind::Minimal).unwrap();
        let evaluator = Evaluator::new(&model, Function::InverseDynamics, SetKind::Minimal).unwrap();
        for _ in 0..5 {
            let state = State::draw(&mut rng, n, 1.0);
            // Right round.
            let q: Vec<f64> = state.q.iter().map(|q| 3.0 * q).collect();
            let all: Vec<f64> = (0..11 * n)
                .map(
                    |k| if k % 11 == 10 { rng.random_range(1e-4..1e-3) } else { rng.random_range(-1.0..1.0) },
                )
                .collect();
            let values = model.set_values(set, &all);
            let found = evaluate(&evaluator, &Samples { q: &q, ..state.samples(&values) });
            let expected = torque(arm, &all, &q, &state.dq, &state.ddq);
            let scale = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (j, (a, b)) in found.iter().zip(&expected).enumerate() {
                // Differences of second order with steps of 1e-3.
                assert!((a - b).abs() < 2e-5 * scale, "{} joint {}: {a} {b}", arm.name, j + 1);
            }
        }
    }
}

#[test]
fn the_matrix_is_that_of_the_file() {
    let arm = Arm::parse(MIXED, "arm.toml").unwrap();
    assert_eq!(arm.motor_velocity_matrix_f64(), [[1.0, 0.0, -1.0], [0.0, 3.0, 1.0], [2.0, 0.5, 1.0]]);
    assert!(arm.coupled_motor(0).is_some());
    let wrist = Arm::parse(WRIST, "arm.toml").unwrap();
    assert_eq!(wrist.coupled_motor(4), None);
    assert_eq!(to_f64(&wrist.motor_velocity_matrix()[5][4]), 0.5);
}
