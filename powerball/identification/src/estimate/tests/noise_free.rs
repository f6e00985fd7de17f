//! Both sides of the regression are filtered alike: a log of the model itself leaves nothing.

use crate::estimate::{Folds, fit};
use approx::assert_relative_eq;
use chacha20::ChaCha8Rng;
use dyngen::Arm;
use powerball_logs::log::Arrays;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataOptions, RigidArm};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;
use std::slice;

/// A carriage on a spindle, as EMPS is.
const CARRIAGE: &str = r#"name = "carriage"
convention = "standard"
gravity = [0, 0, 0]
[[joint]]
kind = "prismatic"
theta = 0
d = 0
a = 0
alpha = 0
"#;

/// Coulomb and viscous friction of a joint, N·m and N·m·s/rad.
const FRICTION: [f64; 2] = [3.0, 1.5];

/// A log of an arm along a path with waves up to `top` Hz: torque of the minimal set's `values`, sharp
/// Coulomb friction and viscous friction, without noise.
fn log(body: &RigidArm, values: &[f64], friction: &[[f64; 2]], rate: f64, top: f64, seed: u64) -> Log {
    let n = body.dof();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Amplitudes fall with the square of the frequency: every wave accelerates alike.
    let waves: Vec<Vec<[f64; 3]>> = (0..n)
        .map(|_| {
            let wave = |k: i32| {
                let f = 0.11 * (top / 0.11).powf(f64::from(k) / 9.0) * rng.random_range(0.9..1.1);
                [f, 0.3 / (1.0 + (f / 0.3).powi(2)), rng.random_range(0.0..TAU)]
            };
            (0..10).map(wave).collect()
        })
        .collect();
    let t: Vec<f64> = (0..(40.0 * rate) as usize).map(|k| k as f64 / rate).collect();
    let along = |derivative: i32| -> Vec<f64> {
        let value = |t: f64, waves: &[[f64; 3]]| -> f64 {
            let turned = |[f, size, phase]: &[f64; 3]| {
                size * (TAU * f).powi(derivative)
                    * (TAU * f * t + phase + 0.25 * TAU * f64::from(derivative)).sin()
            };
            waves.iter().map(turned).sum()
        };
        t.iter().flat_map(|t| waves.iter().map(|w| value(*t, w))).collect()
    };
    let (q, v, a) = (along(0), along(1), along(2));
    let rigid = body.torque(&q, &v, &a, values);
    let of = |x: &[f64], j: usize| -> Vec<f64> { x.iter().skip(j).step_by(n).copied().collect() };
    let torque: Vec<Vec<f64>> = (0..n)
        .map(|j| {
            let [coulomb, viscous] = friction[j];
            let sum = |(tau, v): (f64, f64)| tau + coulomb * (500.0 * v).tanh() + viscous * v;
            of(&rigid, j).into_iter().zip(of(&v, j)).map(sum).collect()
        })
        .collect();
    let q: Vec<Vec<f64>> = (0..n).map(|j| of(&q, j)).collect();
    let arrays = Arrays { t: &t, q: &q, torque: &torque, ..Arrays::default() };
    Log::from_arrays("log", body.arm(), &arrays).unwrap().0
}

/// A random arm of this geometry with its log; friction as shares of [`FRICTION`].
fn case(
    name: &str,
    text: &str,
    rate: f64,
    top: f64,
    share: f64,
    seed: u64,
) -> (RigidArm, Vec<f64>, Vec<[f64; 2]>, Log) {
    let body = RigidArm::new(&Arm::parse(text, name).unwrap()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let values: Vec<f64> = body.names().iter().map(|_| rng.random_range(0.5..2.0)).collect();
    let friction: Vec<[f64; 2]> =
        (0..body.dof()).map(|_| FRICTION.map(|f| share * f * rng.random_range(0.5..2.0))).collect();
    let log = log(&body, &values, &friction, rate, top, seed);
    (body, values, friction, log)
}

/// Any arm, rate and bandwidth below what positions are smoothed to: at most half a percent of a joint's
/// torque is left, and every parameter is found to half a percent.
#[test]
fn a_log_of_the_model_itself_leaves_nothing() {
    let arms = [
        ("carriage", CARRIAGE),
        ("scara", include_str!("../../../../../tests/arms/scara.toml")),
        ("ur5e", include_str!("../../../../../tests/arms/ur5e.toml")),
    ];
    for (seed, (name, text)) in (1..).zip(arms) {
        for (rate, top) in [(100.0, 2.0), (100.0, 10.0), (250.0, 6.0), (1000.0, 10.0)] {
            let (body, values, friction, log) = case(name, text, rate, top, 1.0, seed);
            let data = Data::new(&body, &[log], &DataOptions::default()).unwrap();
            let fitted = fit(&data, &Folds::new(&data), &[], None);
            for (j, [coulomb, viscous]) in friction.iter().enumerate() {
                let what = format!("{name}, {rate} Hz, waves up to {top} Hz, joint {}", j + 1);
                let left = fitted.sigma[j] / rms(&data.joints[j].torque);
                assert!(left < 0.005, "{what}: {left} of its torque is left");
                let [g1, _, g3, _, g5] = fitted.friction(j);
                assert_relative_eq!(g1 + g3, *coulomb, max_relative = 0.005);
                assert_relative_eq!(g5, *viscous, max_relative = 0.005);
            }
            for (true_value, found) in values.iter().zip(&fitted.theta) {
                assert_relative_eq!(*found, *true_value, max_relative = 0.005);
            }
        }
    }
}

/// What is linear in the motion is exact in any band, also of a path with more in it than positions are
/// smoothed to.
#[test]
fn what_is_linear_is_exact_whatever_the_path_holds() {
    for (rate, top) in [(100.0, 30.0), (250.0, 60.0), (1000.0, 60.0)] {
        let (body, _, _, log) = case("carriage", CARRIAGE, rate, top, 0.0, 5);
        for cutoff in [7.0, 20.0] {
            let data =
                Data::new(&body, slice::from_ref(&log), &DataOptions { cutoff, ..DataOptions::default() });
            let data = data.unwrap();
            let fitted = fit(&data, &Folds::new(&data), &[], None);
            let left = fitted.sigma[0] / rms(&data.joints[0].torque);
            assert!(left < 0.001, "{rate} Hz, waves up to {top} Hz, band {cutoff} Hz: {left}");
        }
    }
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
}
