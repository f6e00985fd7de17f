//! How the emitted inverse dynamics and regressor grow with the number of joints: chains of revolute joints
//! with twists of ±90° in turn and lengths along and across every axis, one to nine joints.
//!
//! `cargo bench -p powerball-benches --bench growth -- --write docs/results/performance.md` writes its table
//! into the page.

#![allow(clippy::unwrap_used, missing_docs)]

mod support;

use chacha20::ChaCha8Rng;
use dyngen::{Arm, Function, Model, SetKind};
use nalgebra::SVector;
use rand::{RngExt, SeedableRng};
use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;

const STATES: usize = 256;
const ROUNDS: usize = 500;

/// A row of the table.
macro_rules! row {
    ($table:expr, $chain:ident) => {{
        #[allow(dead_code, unreachable_pub)]
        mod $chain {
            include!(concat!(env!("OUT_DIR"), "/", stringify!($chain), ".rs"));
        }
        use $chain::{JOINTS, PARAMETERS};
        let file = concat!(env!("OUT_DIR"), "/", stringify!($chain), ".toml");
        let model = Model::derive(Arm::read(Path::new(file)).unwrap()).unwrap();
        let [tau, y] = [Function::InverseDynamics, Function::Regressor]
            .map(|f| model.function(f, SetKind::Minimal).unwrap().operations());
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut draw = || SVector::<f64, JOINTS>::from_fn(|_, _| rng.random_range(-3.0..3.0));
        let states: Vec<_> = (0..STATES).map(|_| [draw(), draw(), draw()]).collect();
        let parameters = SVector::<f64, PARAMETERS>::from_fn(|i, _| (i as f64).sin());
        let p = black_box(&parameters);
        let times = support::paired(
            ROUNDS,
            [
                &mut || {
                    for [q, dq, ddq] in black_box(&states) {
                        black_box($chain::inverse_dynamics(q, dq, ddq, p));
                    }
                },
                &mut || {
                    for [q, dq, ddq] in black_box(&states) {
                        black_box($chain::regressor(q, dq, ddq));
                    }
                },
            ],
        );
        let [tau_ns, y_ns] = times.map(|time| time.as_secs_f64() * 1e9 / STATES as f64);
        let _ = writeln!(
            $table,
            "| {JOINTS} | {PARAMETERS} | {} + {} ({}) | {tau_ns:.0} | {} + {} ({}) | {y_ns:.0} |",
            tau.mul, tau.add, tau.sin_cos, y.mul, y.add, y.sin_cos
        );
    }};
}

fn main() {
    let mut table = "| joints | parameters | τ | ns | Y | ns |\n|---|---|---|---|---|---|\n".to_string();
    row!(table, chain1);
    row!(table, chain2);
    row!(table, chain3);
    row!(table, chain4);
    row!(table, chain5);
    row!(table, chain6);
    row!(table, chain7);
    row!(table, chain8);
    row!(table, chain9);
    support::publish("growth", &table);
}
