//! Payloads, second derivatives, the whole arm's mass and momentum, and the forms of the Jacobian: each
//! function is proven against the Lagrangian as it is built; here it is compared with other functions at
//! states drawn by lot.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use dyngen::{Function, SetKind};
use support::valued::{Arm, Matrix, arms, close};

/// The arms that carry their tool where their last link's frame is.
fn without_tool() -> Vec<(String, String)> {
    arms().into_iter().filter(|(_, text)| !text.contains("[tool]")).collect()
}

#[test]
fn a_payload_is_as_if_the_last_link_were_heavier() {
    for (seed, (name, text)) in without_tool().iter().enumerate() {
        let arm = Arm::of_set(text, SetKind::Full, 300 + seed as u64);
        // Where symmetries leave every parameter of the last link.
        let last = 10 * (arm.model.arm().links() - 1);
        let names = arm.model.set(SetKind::Full).unwrap().names();
        let own =
            |i: usize| names.iter().position(|n| *n == PARTS[i].to_string() + &format!("{}", last / 10 + 1));
        let Some(places) = (0..10).map(own).collect::<Option<Vec<usize>>>() else { continue };
        let mut heavier = Arm::of_set(text, SetKind::Full, 300 + seed as u64);
        for (place, value) in places.iter().zip(&arm.state.payload) {
            heavier.values[*place] += value;
        }
        for (with, without) in [
            (Function::InverseDynamicsWithPayload, Function::InverseDynamics),
            (Function::MassMatrixWithPayload, Function::MassMatrix),
            (Function::CoriolisMatrixWithPayload, Function::CoriolisMatrix),
            (Function::GravityWithPayload, Function::Gravity),
        ] {
            close(name, with.name(), &arm.of(with), &heavier.of(without), 1e-12);
        }
        let carried = arm.of(Function::PayloadRegressor).times(&Matrix::column(&arm.state.payload));
        let expected = heavier.of(Function::InverseDynamics).plus(&arm.of(Function::InverseDynamics), -1.0);
        close(name, "Y·payload", &carried, &expected, 1e-12);
    }
}

const PARTS: [&str; 10] = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];

#[test]
fn a_payload_on_a_tool_gives_its_torques_back() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let text = format!("{text}\n[tool]\nxyz = [0.1, -0.2, 0.3]\nrpy = [\"pi/4\", 0.3, -0.8]\n");
        let mut arm = Arm::new(&text, 320 + seed as u64);
        // A ball of 2 kg, whose inertia keeps B positive definite.
        arm.state.payload = vec![2.0, 0.1, -0.06, 0.08, 0.05, 0.0, 0.0, 0.05, 0.0, 0.05];
        let payload = arm.of(Function::PayloadRegressor).times(&Matrix::column(&arm.state.payload));
        let torque = arm.of(Function::InverseDynamics).plus(&payload, 1.0);
        close(name, "τ", &arm.of(Function::InverseDynamicsWithPayload), &torque, 1e-12);
        arm.state.tau = torque.values;
        let accelerations = arm.of(Function::ForwardDynamicsWithPayload);
        close(name, "q̈", &accelerations, &Matrix::column(&arm.state.ddq), 1e-8);
        // A mass at the tool's origin weighs Jᵀ·m·g.
        arm.state.payload = vec![3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let base = arm.model.arm().base.is_some();
        if !base {
            let gravity = &arm.model.arm().gravity;
            let weight = |axis: usize| -3.0 * dyngen::exact::rational::to_f64(&gravity[axis]);
            arm.state.f = vec![weight(0), weight(1), weight(2), 0.0, 0.0, 0.0];
            let expected = arm.of(Function::Gravity).plus(&arm.of(Function::JacobianTransposeTimes), 1.0);
            close(name, "g", &arm.of(Function::GravityWithPayload), &expected, 1e-12);
        }
    }
}

#[test]
fn the_hessian_is_that_of_differences() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, 340 + seed as u64);
        let errors = Matrix::column(&arm.state.e);
        let (q, dq) = (arm.state.q.clone(), arm.state.dq.clone());
        // The gradient of eᵀτ at a step along the direction.
        let gradient = |step: f64| {
            let mut moved = Arm::new(text, 340 + seed as u64);
            let along = |x: &[f64], v: &[f64]| x.iter().zip(v).map(|(x, v)| x + step * v).collect();
            moved.state.q = along(&q, &arm.state.vq);
            moved.state.dq = along(&dq, &arm.state.vdq);
            let by = |function| moved.of(function).transpose().times(&errors);
            [by(Function::TorqueByPosition), by(Function::TorqueByVelocity)]
        };
        let difference = |step: f64| {
            let (ahead, behind) = (gradient(step), gradient(-step));
            let n = q.len();
            Matrix::of(n, 2, |i, j| (ahead[j].values[i] - behind[j].values[i]) / (2.0 * step))
        };
        let expected = difference(1e-3).times_number(4.0 / 3.0).plus(&difference(2e-3), -1.0 / 3.0);
        close(name, "Hessian", &arm.of(Function::TorqueHessianTimes), &expected, 1e-8);
    }
}

#[test]
fn the_whole_arm_is_one_body() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::of_set(text, SetKind::Full, 360 + seed as u64);
        let velocities = Matrix::column(&arm.state.dq);
        let momentum = arm.of(Function::TotalMomentum);
        close(name, "A·q̇", &arm.of(Function::TotalMomentumMatrix).times(&velocities), &momentum, 1e-12);
        let jacobian = arm.of(Function::CentreOfMassJacobian);
        close(name, "∂c/∂q", &jacobian, &arm.differences(Function::CentreOfMass, |s| &mut s.q), 1e-8);
        let names = arm.model.set(SetKind::Full).unwrap().names();
        let is_mass = |name: &str| name.starts_with('m') && name[1..].chars().all(|c| c.is_ascii_digit());
        let mass: f64 = names.iter().zip(&arm.values).filter(|(n, _)| is_mass(n)).map(|(_, v)| v).sum();
        let linear = Matrix::column(&momentum.values[..3]);
        close(name, "m·ċ", &jacobian.times(&velocities).times_number(mass), &linear, 1e-12);
        // What gravity does to the potential energy, it does at the centre of mass.
        if arm.model.arm().base.is_none() {
            let gravity = &arm.model.arm().gravity;
            let down = Matrix::of(1, 3, |_, axis| -mass * dyngen::exact::rational::to_f64(&gravity[axis]));
            close(name, "g", &down.times(&jacobian).transpose(), &arm.of(Function::Gravity), 1e-12);
        }
    }
}

#[test]
fn a_set_without_masses_has_no_centre_of_mass() {
    let (_, text) = &arms()[0];
    let model = support::model(text);
    let refused = model.function(Function::CentreOfMass, SetKind::Minimal).unwrap_err().to_string();
    assert!(refused.contains("--parameters full"), "{refused}");
}

#[test]
fn the_jacobian_has_three_forms() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, 380 + seed as u64);
        let (jacobian, pose) = (arm.of(Function::Jacobian), arm.of(Function::ForwardKinematics));
        let (velocities, n) = (Matrix::column(&arm.state.dq), arm.model.arm().dof());
        let twist = jacobian.times(&velocities);
        close(name, "J·q̇", &arm.of(Function::Twist), &twist, 1e-12);
        let carried = arm.of(Function::JacobianRate).times(&velocities);
        let rate = jacobian.times(&Matrix::column(&arm.state.ddq)).plus(&carried, 1.0);
        close(name, "J·q̈ + J̇·q̇", &arm.of(Function::TwistRate), &rate, 1e-12);
        let turned = Matrix::of(6, 6, |i, j| if i / 3 == j / 3 { pose.at(j % 3, i % 3) } else { 0.0 });
        close(name, "in own axes", &arm.of(Function::BodyJacobian), &turned.times(&jacobian), 1e-12);
        let p = [pose.at(0, 3), pose.at(1, 3), pose.at(2, 3)];
        let cross = [[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]];
        let moved = Matrix::of(6, 6, |i, j| match (i / 3, j / 3) {
            (0, 1) => cross[i][j - 3],
            _ => f64::from(u8::from(i == j)),
        });
        close(name, "about the base", &arm.of(Function::SpatialJacobian), &moved.times(&jacobian), 1e-12);
        assert_eq!(twist.values.len() * n, jacobian.values.len());
    }
}
