//! What optimal control asks for, compiled: one sample and blocks of samples give what the evaluator gives.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::{Evaluator, Function, Model, SetKind};
use nalgebra::SVector;
use powerball_workspace::arm;
use powerball_workspace::generated::lwa4p_rotorless_control as lwa4p;
use rand::SeedableRng;
use support::{State, evaluate};

#[path = "../dyngen/tests/support/mod.rs"]
mod support;

const LANES: usize = 4;
const N: usize = lwa4p::JOINTS;

/// By joint, then by sample.
fn lanes<const M: usize>(of: fn(&State) -> &Vec<f64>, states: &[State; LANES]) -> [[f64; LANES]; M] {
    std::array::from_fn(|joint| std::array::from_fn(|lane| of(&states[lane])[joint]))
}

/// A result of blocks for one sample, row-major: it is held as columns of rows.
fn of_lane<const R: usize, const C: usize>(out: &[[[f64; LANES]; R]; C], lane: usize) -> Vec<f64> {
    (0..R * C).map(|k| out[k % C][k / C][lane]).collect()
}

#[test]
fn compiled_functions_are_the_evaluator_s() {
    let model = Model::derive(arm("lwa4p_rotorless")).unwrap();
    let set = model.set(SetKind::Full).unwrap();
    let of = |k: usize| [2.0, 0.02, -0.03, 0.04, 0.5, 0.0, 0.0, 0.6, 0.0, 0.7, 0.0][k];
    let all: Vec<f64> = (0..11 * N).map(|i| of(i % 11)).collect();
    let values = model.set_values(set, &all);
    let mut random = chacha20::ChaCha8Rng::seed_from_u64(61);
    let states: [State; LANES] = std::array::from_fn(|_| State::draw(&mut random, N, 1.2));
    let parameters = SVector::<f64, { lwa4p::PARAMETERS }>::from_column_slice(&values);
    let of = |part: fn(&State) -> &Vec<f64>| lanes::<N>(part, &states);
    let (q, dq, ddq, tau) = (of(|s| &s.q), of(|s| &s.dq), of(|s| &s.ddq), of(|s| &s.tau));
    let (e, vq, vdq) = (of(|s| &s.e), of(|s| &s.vq), of(|s| &s.vdq));
    let (f, payload) = (lanes::<6>(|s| &s.f, &states), lanes::<10>(|s| &s.payload, &states));
    macro_rules! blocks {
        ($name:ident, $rows:expr, $columns:expr, $($argument:expr),*) => {{
            let mut out = [[[0.0; LANES]; $rows]; $columns];
            lwa4p::batch::$name($($argument,)* &mut out);
            (0..LANES).map(|lane| of_lane(&out, lane)).collect::<Vec<_>>()
        }};
    }
    // A result that is one column is no matrix.
    macro_rules! column {
        ($name:ident, $rows:expr, $($argument:expr),*) => {{
            let mut out = [[0.0; LANES]; $rows];
            lwa4p::batch::$name($($argument,)* &mut out);
            (0..LANES).map(|lane| out.iter().map(|row| row[lane]).collect()).collect::<Vec<Vec<f64>>>()
        }};
    }
    let p = &parameters;
    let of_blocks = |function: Function| match function {
        Function::AccelerationByPosition => blocks!(acceleration_by_position, N, N, &q, &dq, &tau, p),
        Function::AccelerationByVelocity => blocks!(acceleration_by_velocity, N, N, &q, &dq, &tau, p),
        Function::MassMatrixRate => blocks!(mass_matrix_rate, N, N, &q, &dq, p),
        Function::MassMatrixTimesByPosition => blocks!(mass_matrix_times_by_position, N, N, &q, &e, p),
        Function::JacobianRate => blocks!(jacobian_rate, 6, N, &q, &dq),
        Function::JacobianTransposeTimes => column!(jacobian_transpose_times, N, &q, &f),
        Function::JacobianTransposeTimesByPosition => {
            blocks!(jacobian_transpose_times_by_position, N, N, &q, &f)
        }
        Function::TaskInertiaInverse => blocks!(task_inertia_inverse, 6, 6, &q, p),
        Function::TaskInertia => blocks!(task_inertia, 6, 6, &q, p),
        Function::ConsistentInverse => blocks!(dynamically_consistent_inverse, N, 6, &q, p),
        Function::BodyJacobian => blocks!(body_jacobian, 6, N, &q),
        Function::SpatialJacobian => blocks!(spatial_jacobian, 6, N, &q),
        Function::Twist => column!(twist, 6, &q, &dq),
        Function::TwistRate => column!(twist_rate, 6, &q, &dq, &ddq),
        Function::InverseDynamicsWithPayload => {
            column!(inverse_dynamics_with_payload, N, &q, &dq, &ddq, &payload, p)
        }
        Function::PayloadRegressor => blocks!(payload_regressor, N, 10, &q, &dq, &ddq),
        Function::MassMatrixWithPayload => blocks!(mass_matrix_with_payload, N, N, &q, &payload, p),
        Function::CoriolisMatrixWithPayload => {
            blocks!(coriolis_matrix_with_payload, N, N, &q, &dq, &payload, p)
        }
        Function::GravityWithPayload => column!(gravity_with_payload, N, &q, &payload, p),
        Function::ForwardDynamicsWithPayload => {
            column!(forward_dynamics_with_payload, N, &q, &dq, &tau, &payload, p)
        }
        Function::TorqueHessianTimes => {
            blocks!(torque_hessian_times, N, 2, &q, &dq, &ddq, &e, &vq, &vdq, p)
        }
        Function::CentreOfMass => column!(centre_of_mass, 3, &q, p),
        Function::CentreOfMassJacobian => blocks!(centre_of_mass_jacobian, 3, N, &q, p),
        Function::TotalMomentum => column!(total_momentum, 6, &q, &dq, p),
        Function::TotalMomentumMatrix => blocks!(total_momentum_matrix, 6, N, &q, p),
        _ => unreachable!("{function} is compared in newton_euler.rs"),
    };
    macro_rules! one {
        ($name:ident, $($argument:expr),*) => {
            lwa4p::$name($($argument),*).transpose().as_slice().to_vec()
        };
    }
    let of_one = |function: Function, state: &State| {
        let joints = |x: &[f64]| SVector::<f64, N>::from_column_slice(x);
        let (q, dq, ddq, tau) = (joints(&state.q), joints(&state.dq), joints(&state.ddq), joints(&state.tau));
        let (e, vq, vdq) = (joints(&state.e), joints(&state.vq), joints(&state.vdq));
        let f = SVector::<f64, 6>::from_column_slice(&state.f);
        let payload = SVector::<f64, 10>::from_column_slice(&state.payload);
        match function {
            Function::AccelerationByPosition => one!(acceleration_by_position, &q, &dq, &tau, p),
            Function::AccelerationByVelocity => one!(acceleration_by_velocity, &q, &dq, &tau, p),
            Function::MassMatrixRate => one!(mass_matrix_rate, &q, &dq, p),
            Function::MassMatrixTimesByPosition => one!(mass_matrix_times_by_position, &q, &e, p),
            Function::JacobianRate => one!(jacobian_rate, &q, &dq),
            Function::JacobianTransposeTimes => one!(jacobian_transpose_times, &q, &f),
            Function::JacobianTransposeTimesByPosition => {
                one!(jacobian_transpose_times_by_position, &q, &f)
            }
            Function::TaskInertiaInverse => one!(task_inertia_inverse, &q, p),
            Function::TaskInertia => one!(task_inertia, &q, p),
            Function::ConsistentInverse => one!(dynamically_consistent_inverse, &q, p),
            Function::BodyJacobian => one!(body_jacobian, &q),
            Function::SpatialJacobian => one!(spatial_jacobian, &q),
            Function::Twist => one!(twist, &q, &dq),
            Function::TwistRate => one!(twist_rate, &q, &dq, &ddq),
            Function::InverseDynamicsWithPayload => {
                one!(inverse_dynamics_with_payload, &q, &dq, &ddq, &payload, p)
            }
            Function::PayloadRegressor => one!(payload_regressor, &q, &dq, &ddq),
            Function::MassMatrixWithPayload => one!(mass_matrix_with_payload, &q, &payload, p),
            Function::CoriolisMatrixWithPayload => one!(coriolis_matrix_with_payload, &q, &dq, &payload, p),
            Function::GravityWithPayload => one!(gravity_with_payload, &q, &payload, p),
            Function::ForwardDynamicsWithPayload => {
                one!(forward_dynamics_with_payload, &q, &dq, &tau, &payload, p)
            }
            Function::TorqueHessianTimes => one!(torque_hessian_times, &q, &dq, &ddq, &e, &vq, &vdq, p),
            Function::CentreOfMass => one!(centre_of_mass, &q, p),
            Function::CentreOfMassJacobian => one!(centre_of_mass_jacobian, &q, p),
            Function::TotalMomentum => one!(total_momentum, &q, &dq, p),
            Function::TotalMomentumMatrix => one!(total_momentum_matrix, &q, p),
            _ => unreachable!("{function} is compared in newton_euler.rs"),
        }
    };
    let common: Vec<Function> = Function::common().collect();
    for function in Function::ALL.into_iter().filter(|f| !common.contains(f)) {
        let evaluator = Evaluator::new(&model, function, SetKind::Full).unwrap();
        let blocks = of_blocks(function);
        for (lane, state) in states.iter().enumerate() {
            let takes = function.takes(dyngen::dynamics::function::Argument::Parameters);
            let expected = evaluate(&evaluator, &state.samples(if takes { &values } else { &[] }));
            let scale = expected.iter().fold(1e-3, |largest: f64, x| largest.max(x.abs()));
            for (what, found) in [("one sample", &of_one(function, state)), ("blocks", &blocks[lane])] {
                assert_eq!(found.len(), expected.len(), "{function}");
                let miss = found.iter().zip(&expected).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
                assert!(miss < 1e-9 * scale, "{function}, {what}: {miss:e} of {scale:e}");
            }
        }
    }
}
