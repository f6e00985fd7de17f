//! The evaluator, which needs no compiler, against the compiled code of the same functions, over the same
//! samples.

#![allow(clippy::unwrap_used, missing_docs)]

mod support;

use chacha20::ChaCha8Rng;
use dyngen::{Evaluator, Function, Model, Samples, SetKind};
use nalgebra::SVector;
use powerball_workspace::arm;
use powerball_workspace::generated::lwa4p_minimal as lwa4p;
use powerball_workspace::generated::panda_minimal as panda;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;

const SAMPLES: usize = 4096;
const ROUNDS: usize = 40;

macro_rules! compare {
    ($name:literal, $module:ident, $arm:literal) => {{
        const N: usize = $module::JOINTS;
        const P: usize = $module::PARAMETERS;
        let model = Model::derive(arm($arm)).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut draw =
            |count: usize| -> Vec<f64> { (0..count).map(|_| rng.random_range(-1.5..1.5)).collect() };
        let (q, dq, ddq, parameters) = (draw(SAMPLES * N), draw(SAMPLES * N), draw(SAMPLES * N), draw(P));
        let p = SVector::<f64, P>::from_column_slice(&parameters);
        let at = |x: &[f64], k: usize| SVector::<f64, N>::from_column_slice(&x[k * N..][..N]);
        let row = |function: Function, compiled: &mut dyn FnMut(usize)| {
            let evaluator = Evaluator::new(&model, function, SetKind::Minimal).unwrap();
            let parameters: &[f64] = if function.takes(dyngen::dynamics::function::Argument::Parameters) {
                &parameters
            } else {
                &[]
            };
            let samples = Samples { q: &q, dq: &dq, ddq: &ddq, parameters, ..Samples::default() };
            let samples = match function {
                Function::MassMatrix => Samples { dq: &[], ddq: &[], ..samples },
                _ => samples,
            };
            let mut out = vec![0.0; SAMPLES * evaluator.outputs()];
            let [code, tape] = support::paired(
                ROUNDS,
                [&mut || (0..SAMPLES).for_each(&mut *compiled), &mut || {
                    evaluator.run(&samples, &mut out);
                    black_box(&out);
                }],
            );
            let of = |t: std::time::Duration| t.as_secs_f64() * 1e9 / SAMPLES as f64;
            println!(
                "{:<10} {:<18} {:>9.1} {:>9.1} {:>7.2}",
                $name,
                function.name(),
                of(code),
                of(tape),
                of(tape) / of(code)
            );
        };
        row(Function::InverseDynamics, &mut |k| {
            black_box($module::inverse_dynamics(&at(&q, k), &at(&dq, k), &at(&ddq, k), &p));
        });
        row(Function::Regressor, &mut |k| {
            black_box($module::regressor(&at(&q, k), &at(&dq, k), &at(&ddq, k)));
        });
        row(Function::MassMatrix, &mut |k| {
            black_box($module::mass_matrix(&at(&q, k), &p));
        });
    }};
}

fn main() {
    println!("{:<10} {:<18} {:>9} {:>9} {:>7}", "arm", "function", "code ns", "tape ns", "ratio");
    compare!("lwa4p", lwa4p, "arm");
    compare!("panda", panda, "panda");
}
