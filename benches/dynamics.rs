//! The emitted dynamics of the LWA 4P without rotors compared with code written by hand, in one run.
//!
//! `cargo bench -p powerball-benches --bench dynamics -- --write docs/results/performance.md` writes its
//! tables into the page.

#![allow(clippy::unwrap_used, missing_docs)]

mod support;

use chacha20::ChaCha8Rng;
use dyngen::{Model, SetKind, Values};
use nalgebra::{SMatrix, SVector};
use powerball_workspace::arm as arm_file;
use powerball_workspace::generated::lwa4p_rotorless_minimal as arm;
use rand::{RngExt, SeedableRng};
use std::cell::RefCell;
use std::fmt::Write;
use std::hint::black_box;
use support::by_hand::{self, Link};
use support::with_dynibo;
use support::with_nalgebra;

const FILE: &str = "tests/arms/lwa4p_rotorless.toml";
const STATES: usize = 256;
const ROUNDS: usize = 3000;

type Joints = SVector<f64, 6>;
type Parameters = SVector<f64, { arm::PARAMETERS }>;

/// The virtual arm's links without rotors: for the functions by hand, and as the minimal set.
fn links() -> ([Link; 6], Parameters) {
    let bodies = powerball::virtual_arm::lwa4p::links();
    let links: [Link; 6] = std::array::from_fn(|i| bodies[i].parameters()[..10].try_into().unwrap());
    let names = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
    let model = Model::derive(arm_file("lwa4p_rotorless")).unwrap();
    // What the arm's symmetries make zero has no name there.
    let kept = model.set(SetKind::Full).unwrap().names();
    let mut json = serde_json::Map::new();
    for (i, link) in links.iter().enumerate() {
        for (name, value) in names.iter().zip(link) {
            let name = format!("{name}{}", i + 1);
            assert!(kept.contains(&name) || value.abs() < 1e-12, "{name}");
            if kept.contains(&name) {
                json.insert(name, (*value).into());
            }
        }
    }
    let values = Values::parse(&serde_json::Value::from(json).to_string(), "links").unwrap();
    let values = values.of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
    (links, Parameters::from_column_slice(&values))
}

/// q, q̇ and q̈ within the arm's limits.
fn states(count: usize) -> Vec<[Joints; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw = |limit: f64| Joints::from_fn(|_, _| rng.random_range(-limit..limit));
    (0..count).map(|_| [draw(3.0), draw(1.2), draw(4.0)]).collect()
}

/// One row of the table: what, nanoseconds, and what it may take of the Newton–Euler's time.
type Row<'a> = (&'static str, Box<dyn FnMut() + 'a>, Option<f64>);

fn times(links: &[Link; 6], parameters: &Parameters, states: &[[Joints; 3]]) {
    let by_hand = by_hand::Arm::new(FILE, *links);
    let with_nalgebra = with_nalgebra::Arm::new(FILE);
    let with_dynibo = RefCell::new(with_dynibo::Arm::new(&arm_file("lwa4p_rotorless"), links));
    for [q, dq, ddq] in states {
        let [a, b, c]: [[f64; 6]; 3] = [(*q).into(), (*dq).into(), (*ddq).into()];
        let torque = arm::inverse_dynamics(q, dq, ddq, parameters);
        let limit = 1e-12 * torque.amax().max(1.0);
        assert!((torque - Joints::from(by_hand.inverse_dynamics(&a, &b, &c))).amax() < limit);
        let all = SMatrix::<f64, 60, 1>::from_column_slice(links.as_flattened());
        assert!((torque - with_nalgebra.regressor(&a, &b, &c) * all).amax() < limit);
        assert!((torque - arm::regressor(q, dq, ddq) * parameters).amax() < limit);
        let mass = arm::mass_matrix(q, parameters);
        assert!((mass - with_nalgebra.mass_matrix(&a, links)).amax() < 1e-12);
        let mut peer = with_dynibo.borrow_mut();
        let theirs = Joints::from(peer.inverse_dynamics(&a, &b, &c));
        assert!((torque - theirs - Joints::from(peer.more_gravity(&a, 9.81))).amax() < limit);
        assert!((mass - SMatrix::from_column_slice(&peer.mass_matrix(&a))).amax() < 1e-12);
    }
    let plain: Vec<[[f64; 6]; 3]> = states.iter().map(|state| state.map(Into::into)).collect();
    let ready: Vec<_> = states.iter().map(|state| (*state, arm::Trig::new(&state[0]))).collect();
    macro_rules! each {
        ($states:expr, $state:pat => $call:expr) => {
            Box::new(|| {
                for $state in black_box(&$states).iter() {
                    black_box($call);
                }
            })
        };
    }
    let (p, prepared) = (black_box(parameters), arm::prepare(parameters));
    let z = black_box(&prepared);
    let mut rows: Vec<Row<'_>> = vec![
        (
            "Newton–Euler by hand, 60 parameters",
            each!(plain, [q, dq, ddq] => by_hand.inverse_dynamics(q, dq, ddq)),
            None,
        ),
        ("**τ**", each!(states, [q, dq, ddq] => arm::inverse_dynamics(q, dq, ddq, p)), Some(0.27)),
        (
            "**τ**, sines, cosines and prepared parameters passed in",
            each!(ready, ([_, dq, ddq], trig) => arm::inverse_dynamics_with(trig, dq, ddq, z)),
            Some(0.15),
        ),
        ("**Y**, 6 × 19", each!(states, [q, dq, ddq] => arm::regressor(q, dq, ddq)), Some(0.33)),
        ("**B**", each!(states, [q, ..] => arm::mass_matrix(q, p)), Some(0.22)),
        (
            "**C** of Christoffel symbols",
            each!(states, [q, dq, _] => arm::coriolis_matrix(q, dq, p)),
            Some(0.45),
        ),
        ("**g**", each!(states, [q, ..] => arm::gravity(q, p)), Some(0.14)),
        (
            "inverse dynamics with dynibo 0.5.3",
            each!(plain, [q, dq, ddq] => with_dynibo.borrow_mut().inverse_dynamics(q, dq, ddq)),
            None,
        ),
        (
            "mass matrix with dynibo 0.5.3",
            each!(plain, [q, ..] => with_dynibo.borrow_mut().mass_matrix(q)),
            None,
        ),
        (
            "numeric regressor with nalgebra, 6 × 60",
            each!(plain, [q, dq, ddq] => with_nalgebra.regressor(q, dq, ddq)),
            None,
        ),
        (
            "numeric mass matrix with nalgebra",
            each!(plain, [q, ..] => with_nalgebra.mass_matrix(q, links)),
            None,
        ),
        ("preparation of the parameters for all functions", each!(states, _ => arm::prepare(p)), None),
        ("`Trig::new`: seven sines and cosines, emitted", each!(states, [q, ..] => arm::Trig::new(q)), None),
        ("six sines and cosines, `std`", each!(plain, [q, ..] => q.map(f64::sin_cos)), None),
        ("six sines and cosines, crate `libm`", each!(plain, [q, ..] => q.map(libm::sincos)), None),
    ];
    let mut best = vec![f64::MAX; rows.len()];
    for _ in 0..ROUNDS {
        for ((_, run, _), best) in rows.iter_mut().zip(&mut best) {
            let [time] = support::paired(1, [&mut **run]);
            *best = best.min(time.as_secs_f64() * 1e9 / states.len() as f64);
        }
    }
    let mut table =
        "| one call, trigonometry included | ns | × Newton–Euler by hand | goal |\n|---|---|---|---|\n"
            .to_string();
    for ((what, _, goal), time) in rows.iter().zip(&best) {
        let goal = goal.map_or(String::new(), |goal| format!("{goal:.2}"));
        let _ = writeln!(table, "| {what} | {time:.1} | {:.2} | {goal} |", time / best[0]);
    }
    support::publish("dynamics", &table);
}

/// Single against double precision at the arm's own parameters.
fn precision(parameters: &Parameters, states: &[[Joints; 3]]) {
    let single = parameters.map(|x| x as f32);
    let mut rows = [
        ("τ, N·m", 0.0f64, 0.0f64),
        ("Y·π, N·m", 0.0, 0.0),
        ("B, kg·m²", 0.0, 0.0),
        ("C, N·m·s", 0.0, 0.0),
        ("g, N·m", 0.0, 0.0),
    ];
    for state in states {
        // The state as single precision has it: what is compared is the arithmetic.
        let [qs, dqs, ddqs] = state.map(|v| v.map(|x| x as f32));
        let [q, dq, ddq] = [qs, dqs, ddqs].map(|v| v.map(f64::from));
        let mut take = |k: usize, of: &[f64], close: &[f32]| {
            for (x, y) in of.iter().zip(close) {
                rows[k].1 = rows[k].1.max((x - f64::from(*y)).abs());
                rows[k].2 = rows[k].2.max(x.abs());
            }
        };
        let p = &single.map(f64::from);
        take(
            0,
            arm::inverse_dynamics(&q, &dq, &ddq, p).as_slice(),
            arm::inverse_dynamics(&qs, &dqs, &ddqs, &single).as_slice(),
        );
        take(
            1,
            (arm::regressor(&q, &dq, &ddq) * p).as_slice(),
            (arm::regressor(&qs, &dqs, &ddqs) * single).as_slice(),
        );
        take(2, arm::mass_matrix(&q, p).as_slice(), arm::mass_matrix(&qs, &single).as_slice());
        take(
            3,
            arm::coriolis_matrix(&q, &dq, p).as_slice(),
            arm::coriolis_matrix(&qs, &dqs, &single).as_slice(),
        );
        take(4, arm::gravity(&q, p).as_slice(), arm::gravity(&qs, &single).as_slice());
    }
    let mut table = "| | largest error of f32 | largest value |\n|---|---|---|\n".to_string();
    for (what, error, largest) in rows {
        let _ = writeln!(table, "| {what} | {error:.1e} | {largest:.3} |");
    }
    support::publish("precision", &table);
}

fn main() {
    let (links, parameters) = links();
    times(&links, &parameters, &states(STATES));
    precision(&parameters, &states(100_000));
}
