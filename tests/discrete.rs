//! Steps of time: their linearisation against differences, their order against shorter steps.

#![allow(clippy::unwrap_used)]

use dyngen::{Model, SetKind};
use lwa4p::discrete::{self, Linearised, STATES, State};
use nalgebra::{SMatrix, SVector};
use powerball_workspace::arm;
use powerball_workspace::generated::lwa4p_rotorless_discrete as lwa4p;
use powerball_workspace::generated::lwa4p_rotorless_minimal as common;
use rand::{RngExt, SeedableRng};

const N: usize = lwa4p::JOINTS;

type Torque = SVector<f64, N>;

fn values() -> SVector<f64, { lwa4p::PARAMETERS }> {
    let model = Model::derive(arm("lwa4p_rotorless")).unwrap();
    let of = |k: usize| [2.0, 0.02, -0.03, 0.04, 0.5, 0.0, 0.0, 0.6, 0.0, 0.7, 0.0][k];
    let all: Vec<f64> = (0..11 * N).map(|i| of(i % 11)).collect();
    SVector::from_column_slice(&model.set_values(model.set(SetKind::Minimal).unwrap(), &all))
}

fn draw(seed: u64) -> (State<f64>, Torque) {
    let mut random = chacha20::ChaCha8Rng::seed_from_u64(seed);
    let mut number = |_: usize, _: usize| random.random_range(-1.0..1.0);
    (State::from_fn(&mut number), Torque::from_fn(&mut number) * 5.0)
}

/// Central differences of a step by state and torque.
fn differences(
    step: impl Fn(&State<f64>, &Torque) -> State<f64>,
    x: &State<f64>,
    tau: &Torque,
) -> Linearised<f64> {
    let h = 1e-5;
    let by_x = |j: usize| {
        let mut moved = State::zeros();
        moved[j] = h;
        (step(&(x + moved), tau) - step(&(x - moved), tau)) / (2.0 * h)
    };
    let by_tau = |j: usize| {
        let mut moved = Torque::zeros();
        moved[j] = h;
        (step(x, &(tau + moved)) - step(x, &(tau - moved))) / (2.0 * h)
    };
    let a = SMatrix::<f64, STATES, STATES>::from_columns(&std::array::from_fn::<_, STATES, _>(by_x));
    let b = SMatrix::<f64, STATES, N>::from_columns(&std::array::from_fn::<_, N, _>(by_tau));
    (a, b)
}

#[test]
fn linearised_steps_are_those_of_differences() {
    let p = values();
    for seed in 0..5 {
        let (x, tau) = draw(seed);
        let dt = 0.02;
        for (exact, expected) in [
            (
                discrete::semi_implicit_linearised(&x, &tau, &p, dt),
                differences(|x, tau| discrete::semi_implicit(x, tau, &p, dt), &x, &tau),
            ),
            (
                discrete::runge_kutta_linearised(&x, &tau, &p, dt),
                differences(|x, tau| discrete::runge_kutta(x, tau, &p, dt), &x, &tau),
            ),
        ] {
            assert!((exact.0 - expected.0).abs().max() < 1e-8, "{}", exact.0 - expected.0);
            assert!((exact.1 - expected.1).abs().max() < 1e-8, "{}", exact.1 - expected.1);
        }
    }
}

#[test]
fn steps_have_their_order() {
    let p = values();
    let (x, tau) = draw(7);
    let after = |step: &dyn Fn(&State<f64>, f64) -> State<f64>, count: u32| {
        (0..count).fold(x, |x, _| step(&x, 0.1 / f64::from(count)))
    };
    let runge_kutta = |x: &State<f64>, dt: f64| discrete::runge_kutta(x, &tau, &p, dt);
    let semi_implicit = |x: &State<f64>, dt: f64| discrete::semi_implicit(x, &tau, &p, dt);
    let truth = after(&runge_kutta, 400);
    let error = |step: &dyn Fn(&State<f64>, f64) -> State<f64>, count| (after(step, count) - truth).norm();
    // Half the step: a half of the error of first order, a sixteenth of that of fourth order.
    let order = |step, count| (error(step, count) / error(step, 2 * count)).log2();
    assert!((order(&runge_kutta, 8) - 4.0).abs() < 0.3, "{}", order(&runge_kutta, 8));
    assert!((order(&semi_implicit, 64) - 1.0).abs() < 0.2, "{}", order(&semi_implicit, 64));
}

/// What a matrix's structure leaves out is zero at any state, and the rest is not.
#[test]
fn the_structure_of_the_jacobian_is_its_own() {
    let mut seen = SMatrix::<bool, 6, N>::from_element(false);
    for seed in 0..5 {
        let (x, _) = draw(20 + seed);
        let jacobian = common::jacobian(&x.fixed_rows::<N>(0).into_owned());
        seen = seen.zip_map(&jacobian, |seen, x| seen || x != 0.0);
    }
    let listed = SMatrix::<bool, 6, N>::from_fn(|i, j| common::JACOBIAN_NONZERO.contains(&(i, j)));
    assert_eq!(seen, listed);
    assert!(common::JACOBIAN_NONZERO.is_sorted_by_key(|(i, j)| (*j, *i)));
}
