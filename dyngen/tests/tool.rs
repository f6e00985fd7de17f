//! A declared tool: pose, Jacobian and J̇·q̇ of another frame than the last link's.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::{Arm, Evaluator, Function, Model, Samples, SetKind};
use nalgebra::{Matrix4, Rotation3, SMatrix, SVector, Translation3};

const TOOL: &str = "\n[tool]\nxyz = [0.1, -0.02, 0.3]\nrpy = [0.4, \"pi/3\", \"-pi/2\"]\n";

fn twist() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/arms/twist.toml")).unwrap()
}

fn run(arm: &str, function: Function, q: &[f64], dq: &[f64]) -> Vec<f64> {
    let model = Model::derive(Arm::parse(arm, "twist.toml").unwrap()).unwrap();
    let evaluator = Evaluator::new(&model, function, SetKind::Minimal).unwrap();
    let mut out = vec![0.0; evaluator.outputs()];
    evaluator.run(&Samples { q, dq, ..Samples::default() }, &mut out);
    out
}

fn pose(arm: &str, q: &[f64]) -> Matrix4<f64> {
    Matrix4::from_row_slice(&run(arm, Function::ForwardKinematics, q, &[]))
}

#[test]
fn the_pose_is_the_last_frame_s_with_the_tool_on_it() {
    let (plain, with_tool) = (twist(), twist() + TOOL);
    let turn = Rotation3::from_euler_angles(0.4, std::f64::consts::FRAC_PI_3, -std::f64::consts::FRAC_PI_2);
    let tool = Translation3::new(0.1, -0.02, 0.3).to_homogeneous() * turn.to_homogeneous();
    for q in [[0.0; 3], [0.3, -0.2, 1.4], [-2.0, 0.5, 0.7]] {
        assert!((pose(&with_tool, &q) - pose(&plain, &q) * tool).abs().max() < 1e-14);
    }
}

#[test]
fn the_jacobian_and_its_rate_are_differences_of_the_pose() {
    let arm = twist() + TOOL;
    let (q, dq) = (SVector::from([0.3, -0.2, 1.4]), SVector::from([0.5, 0.7, -1.1]));
    let jacobian = |q: &SVector<f64, 3>| {
        SMatrix::<f64, 6, 3>::from_row_slice(&run(&arm, Function::Jacobian, q.as_slice(), &[]))
    };
    let step = 1e-6;
    let (ahead, behind) = (q + dq * step, q - dq * step);
    let rate = (pose(&arm, ahead.as_slice()) - pose(&arm, behind.as_slice())) / (2.0 * step);
    let here = pose(&arm, q.as_slice());
    // Angular velocity from Ṙ·Rᵀ.
    let spin = rate.fixed_view::<3, 3>(0, 0) * here.fixed_view::<3, 3>(0, 0).transpose();
    let twist = jacobian(&q) * dq;
    let expected = [rate[(0, 3)], rate[(1, 3)], rate[(2, 3)], spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]];
    assert!((twist - SVector::from(expected)).abs().max() < 1e-8);
    let drift = (jacobian(&ahead) - jacobian(&behind)) * dq / (2.0 * step);
    let rate = run(&arm, Function::JacobianRateTimesVelocity, q.as_slice(), dq.as_slice());
    assert!((SVector::<f64, 6>::from_column_slice(&rate) - drift).abs().max() < 1e-8);
}

#[test]
fn the_tool_changes_no_torque() {
    let sets = |text: &str| {
        let model = Model::derive(Arm::parse(text, "twist.toml").unwrap()).unwrap();
        model.set(SetKind::Minimal).unwrap().names()
    };
    assert_eq!(sets(&twist()), sets(&(twist() + TOOL)));
}

#[test]
fn what_is_wrong_with_a_tool_is_said_at_its_place() {
    let wrong = "\n[tool]\nxyz = [0, 1]\nrpy = [0, 0, \"quarter\"]\nmass = 2\n";
    let message = Arm::parse(&(twist() + wrong), "twist.toml").unwrap_err().to_string();
    for part in ["twist.toml:", "tool: xyz must be three numbers in m", "tool: rpy", "unknown key 'mass'"] {
        assert!(message.contains(part), "{part} is missing in:\n{message}");
    }
}

/// Eight general twists in the standard convention, whose parameter sets would take minutes.
#[test]
fn kinematics_needs_no_parameter_sets() {
    let arm = |joints: usize| {
        let mut text = "name = \"k\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n".to_string();
        for i in 1..=joints {
            text +=
                &format!("[[joint]]\nkind = \"revolute\"\na = 0.{i}\nalpha = 0.{i}1\nd = 0.2\ntheta = 0.1\n");
        }
        dyngen::Arm::parse(&text, "k.toml").unwrap()
    };
    let at = |model: &Model, function, kind| {
        let evaluator = Evaluator::new(model, function, kind).unwrap();
        let mut out = vec![0.0; evaluator.outputs()];
        let (q, dq) =
            ([0.3, -0.7, 1.1, 0.2, 0.5, -0.4, 0.9, -1.3], [1.0, 0.5, -0.25, 2.0, 1.0, 1.0, 1.0, 1.0]);
        let n = model.arm().dof();
        let none = vec![0.0; model.set(kind).unwrap().parameters.len()];
        evaluator.evaluate(&q[..n], &dq[..n], &[], &none, &mut out);
        out
    };
    for function in [
        Function::ForwardKinematics,
        Function::Jacobian,
        Function::JacobianRate,
        Function::JacobianRateTimesVelocity,
    ] {
        assert!(function.is_kinematic());
        let derived = Model::derive(arm(2)).unwrap();
        let alone = at(&Model::kinematic(arm(2)), function, SetKind::Full);
        assert_eq!(alone, at(&derived, function, SetKind::Minimal), "{function}");
        assert!(at(&Model::kinematic(arm(8)), function, SetKind::Full).iter().all(|x| x.is_finite()));
    }
    assert!(Function::ALL.iter().filter(|f| f.is_kinematic()).count() == 10);
}
