//! What is evaluated and what is compiled agree with a numeric Newton–Euler that shares no code with the generator.

use dyngen::arm::{Arm, ParameterKind};
use dyngen::{Evaluator, Function, Model, SetKind};
use powerball::virtual_arm::{Chain, Dynamics, bodies};
use powerball_workspace::generated::{self, Call};
use powerball_workspace::{arm, paper_arm_with_ratios};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rounding error that two ways of computing the same sum may differ by, relative to the largest result.
const TOLERANCE: f64 = 1e-12;
const STATES: usize = 20;

/// Random values of all parameters of bodies that exist: point masses on the axes of each link's frame, thinned out
/// by the arm's declared symmetries.
fn values(arm: &Arm, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut all = Vec::new();
    for joint in &arm.joints {
        let mut link = [0.0; 11];
        let points = if joint.zero.is_empty() { 5 } else { 0 };
        for _ in 0..points {
            add_point(
                &mut link,
                rng.random_range(0.1..2.0),
                std::array::from_fn(|_| rng.random_range(-0.2..0.2)),
            );
        }
        // Pairs of points mirrored in every plane in which a symmetry is declared keep the declared zeros.
        let zero = |kind| joint.zero.contains(&kind);
        let flat = [zero(ParameterKind::Mx), zero(ParameterKind::My), zero(ParameterKind::Mz)];
        for _ in 0..if points == 0 { 4 } else { 0 } {
            let mass = rng.random_range(0.1..2.0);
            let r: [f64; 3] = std::array::from_fn(|_| rng.random_range(-0.2..0.2));
            for signs in 0..8 {
                let mirrored = |i: usize| if signs >> i & 1 == 1 { -r[i] } else { r[i] };
                if (0..3).all(|i| flat[i] || signs >> i & 1 == 0) {
                    add_point(&mut link, mass, std::array::from_fn(mirrored));
                }
            }
        }
        for kind in &joint.zero {
            link[*kind as usize] = 0.0;
        }
        link[10] = if joint.rotor_ratio.is_some() { rng.random_range(1e-5..1e-3) } else { 0.0 };
        all.extend(link);
    }
    all
}

fn add_point(link: &mut [f64; 11], m: f64, [x, y, z]: [f64; 3]) {
    let point = [
        m,
        m * x,
        m * y,
        m * z,
        m * (y * y + z * z),
        m * x * y,
        m * x * z,
        m * (x * x + z * z),
        m * y * z,
        m * (x * x + y * y),
    ];
    link.iter_mut().zip(point).for_each(|(sum, p)| *sum += p);
}

/// A random state: q, q̇, q̈.
fn state(n: usize, rng: &mut ChaCha8Rng) -> [Vec<f64>; 3] {
    std::array::from_fn(|_| (0..n).map(|_| rng.random_range(-3.0..3.0)).collect())
}

/// Every function by the numeric Newton–Euler, in the order of `Function::ALL`.
fn reference(arm: &Arm, all: &[f64], [q, dq, ddq]: &[Vec<f64>; 3]) -> Vec<Vec<f64>> {
    let chain = Chain::new(arm);
    let (rotation, origin) = chain.poses(q).pop().unwrap();
    let numeric = Dynamics::new(chain, bodies(all).unwrap()).unwrap();
    let mut pose = Vec::new();
    for i in 0..3 {
        pose.extend([rotation[(i, 0)], rotation[(i, 1)], rotation[(i, 2)], origin[i]]);
    }
    pose.extend([0.0, 0.0, 0.0, 1.0]);
    vec![
        numeric.inverse(q, dq, ddq),
        numeric.regressor(q, dq, ddq),
        numeric.mass_matrix(q),
        numeric.coriolis_matrix(q, dq),
        numeric.gravity(q),
        ddq.clone(),
        pose,
    ]
}

fn assert_close(what: &str, actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1.0f64, |m, x| m.max(x.abs()));
    for (i, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= tolerance * scale, "{what}: entry {i}: {a} against {e}");
    }
}

/// Compares the results of all functions with the reference; `regressor · values` stands for the regressor, because the
/// reference has a column for every parameter.
fn compare(name: &str, results: &[Vec<f64>], parameters: &[f64], expected: &[Vec<f64>]) {
    for (f, function) in Function::ALL.into_iter().enumerate() {
        let what = format!("{name} {function}");
        match function {
            Function::Regressor => {
                let rows = results[f].chunks(parameters.len());
                let torque: Vec<f64> =
                    rows.map(|row| row.iter().zip(parameters).map(|(y, p)| y * p).sum()).collect();
                assert_close(&what, &torque, &expected[0], TOLERANCE);
            }
            // The solution is as exact as the mass matrix is well conditioned.
            Function::ForwardDynamics => assert_close(&what, &results[f], &expected[f], 1e-8),
            _ => assert_close(&what, &results[f], &expected[f], TOLERANCE),
        }
    }
}

fn check_evaluator(name: &str, arm: Arm) {
    let model = Model::derive(arm).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(42);
    for set in &model.sets().sets {
        let evaluators: Vec<Evaluator> =
            Function::ALL.iter().map(|f| Evaluator::new(&model, *f, set.kind).unwrap()).collect();
        for _ in 0..STATES {
            let all = values(model.arm(), &mut rng);
            let state = state(model.arm().dof(), &mut rng);
            let expected = reference(model.arm(), &all, &state);
            let parameters = model.set_values(set, &all);
            let [q, dq, ddq] = &state;
            let results: Vec<Vec<f64>> = evaluators
                .iter()
                .map(|evaluator| {
                    let mut out = vec![0.0; evaluator.outputs()];
                    let forward = evaluator.function() == Function::ForwardDynamics;
                    let drive = if forward { &expected[0] } else { ddq };
                    evaluator.evaluate(q, dq, drive, &parameters, &mut out);
                    out
                })
                .collect();
            compare(&format!("{name} {}", set.kind), &results, &parameters, &expected);
        }
    }
}

#[test]
fn evaluated_functions_agree_for_every_arm_and_set() {
    for name in ["arm", "puma560", "ur5e", "panda", "stanford", "scara"] {
        check_evaluator(name, arm(name));
    }
}

#[test]
fn evaluated_functions_agree_with_high_gear_ratios() {
    let mut geared = paper_arm_with_ratios([100; 6].map(Some));
    geared.groupings.clear();
    check_evaluator("k = 100", geared);
    let mut stanford = arm("stanford");
    stanford.joints.iter_mut().for_each(|j| j.rotor_ratio = Some(dyngen::exact::rational::integer(50)));
    check_evaluator("stanford k = 50", stanford);
}

#[test]
fn compiled_functions_agree_for_every_arm_and_set() {
    let mut rng = ChaCha8Rng::seed_from_u64(43);
    for file in generated::ALL {
        let model = Model::derive(arm(file.arm)).unwrap();
        let set = model.set(file.set).unwrap();
        for _ in 0..STATES {
            let all = values(model.arm(), &mut rng);
            let state = state(model.arm().dof(), &mut rng);
            let expected = reference(model.arm(), &all, &state);
            let parameters = model.set_values(set, &all);
            let [q, dq, ddq] = &state;
            let results = (file.call)(&Call { q, dq, ddq, tau: &expected[0], parameters: &parameters });
            compare(&format!("{} {}", file.arm, file.set), &results, &parameters, &expected);
        }
    }
}

#[test]
fn the_full_regressor_agrees_column_by_column() {
    for name in ["arm", "puma560", "panda", "stanford"] {
        let model = Model::derive(arm(name)).unwrap();
        let set = model.set(SetKind::Full).unwrap();
        let evaluator = Evaluator::new(&model, Function::Regressor, SetKind::Full).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(44);
        let [q, dq, ddq] = state(model.arm().dof(), &mut rng);
        let mut out = vec![0.0; evaluator.outputs()];
        evaluator.evaluate(&q, &dq, &ddq, &[], &mut out);
        let all = vec![0.0; model.arm().all_parameters().len()];
        let reference = reference(model.arm(), &all, &[q, dq, ddq]).swap_remove(1);
        let (n, p, width) = (model.arm().dof(), set.parameters.len(), all.len());
        for i in 0..n {
            for (j, parameter) in set.parameters.iter().enumerate() {
                let expected = reference[i * width + parameter.terms[0].0.index()];
                assert_close(
                    &format!("{name} row {i} {}", parameter.name),
                    &[out[i * p + j]],
                    &[expected],
                    TOLERANCE,
                );
            }
        }
    }
}

#[test]
fn coriolis_matrices_are_skew_against_the_rate_of_the_mass_matrix() {
    let h = 1e-6;
    let mut rng = ChaCha8Rng::seed_from_u64(45);
    for file in generated::ALL {
        let model = Model::derive(arm(file.arm)).unwrap();
        let n = model.arm().dof();
        let all = values(model.arm(), &mut rng);
        let parameters = model.set_values(model.set(file.set).unwrap(), &all);
        let [q, dq, ddq] = state(n, &mut rng);
        let results = |step: f64| {
            let q: Vec<f64> = q.iter().zip(&dq).map(|(q, v)| q + step * v).collect();
            (file.call)(&Call { q: &q, dq: &dq, ddq: &ddq, tau: &ddq, parameters: &parameters })
        };
        let (before, now, after) = (results(-h), results(0.0), results(h));
        for i in 0..n {
            for j in 0..n {
                let rate = |k: usize| (after[2][k] - before[2][k]) / (2.0 * h);
                let sum = rate(i * n + j) - now[3][i * n + j] - now[3][j * n + i];
                // Central differences of step h err by about h² and by rounding over h.
                assert!(sum.abs() < 1e-7, "{} {}: Ḃ − 2C is not skew at {i}, {j}: {sum}", file.arm, file.set);
            }
        }
    }
}
