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
    let set = model.set(SetKind::Minimal).unwrap();
    let of = |k: usize| [2.0, 0.02, -0.03, 0.04, 0.5, 0.0, 0.0, 0.6, 0.0, 0.7, 0.0][k];
    let all: Vec<f64> = (0..11 * N).map(|i| of(i % 11)).collect();
    let values = model.set_values(set, &all);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(61);
    let states: [State; LANES] = std::array::from_fn(|_| State::draw(&mut random, N, 1.2));
    let parameters = SVector::<f64, { lwa4p::PARAMETERS }>::from_column_slice(&values);
    let of = |part: fn(&State) -> &Vec<f64>| lanes::<N>(part, &states);
    let (q, dq, tau, e) = (of(|s| &s.q), of(|s| &s.dq), of(|s| &s.tau), of(|s| &s.e));
    let f = lanes::<6>(|s| &s.f, &states);
    macro_rules! blocks {
        ($name:ident, $rows:expr, $columns:expr, $($argument:expr),*) => {{
            let mut out = [[[0.0; LANES]; $rows]; $columns];
            lwa4p::batch::$name($($argument,)* &mut out);
            (0..LANES).map(|lane| of_lane(&out, lane)).collect::<Vec<_>>()
        }};
    }
    let mut torque = [[0.0; LANES]; N];
    lwa4p::batch::jacobian_transpose_times(&q, &f, &mut torque);
    let torque: Vec<Vec<f64>> = (0..LANES).map(|lane| torque.iter().map(|row| row[lane]).collect()).collect();
    let p = &parameters;
    let of_blocks = |function: Function| match function {
        Function::AccelerationByPosition => blocks!(acceleration_by_position, N, N, &q, &dq, &tau, p),
        Function::AccelerationByVelocity => blocks!(acceleration_by_velocity, N, N, &q, &dq, &tau, p),
        Function::MassMatrixRate => blocks!(mass_matrix_rate, N, N, &q, &dq, p),
        Function::MassMatrixTimesByPosition => blocks!(mass_matrix_times_by_position, N, N, &q, &e, p),
        Function::JacobianRate => blocks!(jacobian_rate, 6, N, &q, &dq),
        Function::JacobianTransposeTimes => torque.clone(),
        Function::JacobianTransposeTimesByPosition => {
            blocks!(jacobian_transpose_times_by_position, N, N, &q, &f)
        }
        Function::TaskInertiaInverse => blocks!(task_inertia_inverse, 6, 6, &q, p),
        Function::TaskInertia => blocks!(task_inertia, 6, 6, &q, p),
        Function::ConsistentInverse => blocks!(dynamically_consistent_inverse, N, 6, &q, p),
        _ => unreachable!("{function} is compared in newton_euler.rs"),
    };
    let of_one = |function: Function, state: &State| {
        let joints = |x: &[f64]| SVector::<f64, N>::from_column_slice(x);
        let (q, dq, tau, e) = (joints(&state.q), joints(&state.dq), joints(&state.tau), joints(&state.e));
        let f = SVector::<f64, 6>::from_column_slice(&state.f);
        match function {
            Function::AccelerationByPosition => {
                lwa4p::acceleration_by_position(&q, &dq, &tau, p).transpose().as_slice().to_vec()
            }
            Function::AccelerationByVelocity => {
                lwa4p::acceleration_by_velocity(&q, &dq, &tau, p).transpose().as_slice().to_vec()
            }
            Function::MassMatrixRate => lwa4p::mass_matrix_rate(&q, &dq, p).transpose().as_slice().to_vec(),
            Function::MassMatrixTimesByPosition => {
                lwa4p::mass_matrix_times_by_position(&q, &e, p).transpose().as_slice().to_vec()
            }
            Function::JacobianRate => lwa4p::jacobian_rate(&q, &dq).transpose().as_slice().to_vec(),
            Function::JacobianTransposeTimes => lwa4p::jacobian_transpose_times(&q, &f).as_slice().to_vec(),
            Function::JacobianTransposeTimesByPosition => {
                lwa4p::jacobian_transpose_times_by_position(&q, &f).transpose().as_slice().to_vec()
            }
            Function::TaskInertiaInverse => {
                lwa4p::task_inertia_inverse(&q, p).transpose().as_slice().to_vec()
            }
            Function::TaskInertia => lwa4p::task_inertia(&q, p).transpose().as_slice().to_vec(),
            Function::ConsistentInverse => {
                lwa4p::dynamically_consistent_inverse(&q, p).transpose().as_slice().to_vec()
            }
            _ => unreachable!("{function} is compared in newton_euler.rs"),
        }
    };
    let common: Vec<Function> = Function::common().collect();
    for function in Function::ALL.into_iter().filter(|f| !common.contains(f)) {
        let evaluator = Evaluator::new(&model, function, SetKind::Minimal).unwrap();
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
