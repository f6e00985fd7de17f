//! What optimal control asks for: derivatives of the accelerations, rates of B and J, and the tool's inertia,
//! of arms in both conventions with sliding, coupled and following joints. Each function is proven against
//! the Lagrangian as it is built; here it is compared with other functions at states drawn by lot.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use dyngen::{Evaluator, Function, SetKind};
use support::valued::{Arm, Matrix, arms, close};

#[test]
fn accelerations_change_as_differences_say() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, seed as u64);
        let by = |part| arm.differences(Function::ForwardDynamics, part);
        close(name, "∂q̈/∂q", &arm.of(Function::AccelerationByPosition), &by(|s| &mut s.q), 1e-7);
        close(name, "∂q̈/∂q̇", &arm.of(Function::AccelerationByVelocity), &by(|s| &mut s.dq), 1e-9);
        close(name, "∂q̈/∂τ", &arm.of(Function::MassMatrixInverse), &by(|s| &mut s.tau), 1e-9);
    }
}

#[test]
fn rates_of_matrices_agree_with_their_other_forms() {
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, 100 + seed as u64);
        let coriolis = arm.of(Function::CoriolisMatrix);
        close(
            name,
            "Ḃ",
            &arm.of(Function::MassMatrixRate),
            &coriolis.plus(&coriolis.transpose(), 1.0),
            1e-12,
        );
        let velocities = Matrix::column(&arm.state.dq);
        let rate = arm.of(Function::JacobianRate);
        close(name, "J̇·q̇", &rate.times(&velocities), &arm.of(Function::JacobianRateTimesVelocity), 1e-12);
        let torque = arm.of(Function::Jacobian).transpose().times(&Matrix::column(&arm.state.f));
        close(name, "Jᵀ·f", &arm.of(Function::JacobianTransposeTimes), &torque, 1e-12);
        // f·J̇·e = Σ fᵀ·∂J/∂qₖ·e·q̇ₖ
        let by_position = arm.of(Function::JacobianTransposeTimesByPosition);
        close(
            name,
            "∂(Jᵀ·f)/∂q·q̇",
            &by_position.times(&velocities),
            &rate.transpose().times(&Matrix::column(&arm.state.f)),
            1e-12,
        );
        let errors = Matrix::column(&arm.state.e);
        let along = arm.of(Function::MassMatrixTimesByPosition).times(&velocities);
        close(name, "∂(B·e)/∂q·q̇", &along, &arm.of(Function::MassMatrixRate).times(&errors), 1e-12);
    }
}

#[test]
fn the_tool_s_inertia_is_khatib_s() {
    let mut six = 0;
    for (seed, (name, text)) in arms().iter().enumerate() {
        let arm = Arm::new(text, 200 + seed as u64);
        let (jacobian, inverse) = (arm.of(Function::Jacobian), arm.of(Function::MassMatrixInverse));
        let expected = jacobian.times(&inverse).times(&jacobian.transpose());
        close(name, "Λ⁻¹", &arm.of(Function::TaskInertiaInverse), &expected, 1e-12);
        if !arm.has(Function::TaskInertia) {
            let refused = Evaluator::new(&arm.model, Function::TaskInertia, SetKind::Minimal).unwrap_err();
            assert!(refused.to_string().contains("cannot accelerate in every direction"), "{refused}");
            continue;
        }
        six += 1;
        let inertia = arm.of(Function::TaskInertia);
        close(name, "Λ·Λ⁻¹", &inertia.times(&expected), &Matrix::identity(6), 1e-8);
        let consistent = arm.of(Function::ConsistentInverse);
        close(name, "J̄", &consistent, &inverse.times(&jacobian.transpose()).times(&inertia), 1e-8);
        close(name, "J·J̄", &jacobian.times(&consistent), &Matrix::identity(6), 1e-8);
    }
    assert!(six >= 3);
}
