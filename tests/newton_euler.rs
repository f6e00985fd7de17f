//! What is evaluated and what is compiled agree with a numeric Newton–Euler that shares no code with the
//! generator.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::arm::{Arm, ParameterKind};
use dyngen::{Evaluator, Function, Model, Samples, SetKind};
use powerball::identification::chain::Chain;
use powerball::virtual_arm::{Dynamics, bodies};
use powerball_workspace::generated;
use powerball_workspace::{arm, paper_arm_with_ratios};
use rand::{RngExt, SeedableRng};
use std::sync::OnceLock;
use support::{State, evaluate, proven};

#[path = "../dyngen/tests/support/mod.rs"]
mod support;

/// Rounding error that two ways of computing the same sum may differ by, relative to the largest result.
const TOLERANCE: f64 = 1e-12;
const STATES: usize = 20;

/// Random values of all parameters of bodies that exist: point masses on the axes of each link's frame,
/// thinned out by the arm's declared symmetries.
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

/// What the numeric Newton–Euler knows of a function; nothing where it has no such function.
fn reference(arm: &Arm, all: &[f64], state: &State, function: Function) -> Option<Vec<f64>> {
    let State { q, dq, ddq, dqr, ddqr, .. } = state;
    let chain = Chain::new(arm);
    let numeric = Dynamics::new(chain.clone(), bodies(all).unwrap()).unwrap();
    let (n, zeros) = (arm.dof(), vec![0.0; arm.dof()]);
    let minus = |a: Vec<f64>, b: Vec<f64>| -> Vec<f64> { a.iter().zip(b).map(|(x, y)| x - y).collect() };
    let times = |m: &[f64], v: &[f64]| -> Vec<f64> {
        m.chunks(n).map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum()).collect()
    };
    let transposed = |m: Vec<f64>| -> Vec<f64> { (0..n * n).map(|k| m[k % n * n + k / n]).collect() };
    Some(match function {
        Function::InverseDynamics => numeric.inverse(q, dq, ddq),
        Function::InverseDynamicsWithoutGravity => minus(numeric.inverse(q, dq, ddq), numeric.gravity(q)),
        // The products with the values: the reference's regressor has a column for every parameter.
        Function::Regressor => numeric.inverse(q, dq, ddq),
        Function::SlotineLiRegressor => {
            let (b, c) = (times(&numeric.mass_matrix(q), ddqr), times(&numeric.coriolis_matrix(q, dq), dqr));
            (0..n).map(|i| b[i] + c[i] + numeric.gravity(q)[i]).collect()
        }
        Function::MassMatrix => numeric.mass_matrix(q),
        Function::CoriolisMatrix => numeric.coriolis_matrix(q, dq),
        Function::CoriolisTimesVelocity => minus(numeric.inverse(q, dq, &zeros), numeric.gravity(q)),
        Function::CoriolisTransposeTimesVelocity => times(&transposed(numeric.coriolis_matrix(q, dq)), dq),
        Function::Gravity => numeric.gravity(q),
        Function::ForwardDynamics => ddq.clone(),
        Function::KineticEnergy | Function::KineticEnergyRegressor => vec![numeric.kinetic_energy(q, dq)],
        Function::Momentum => times(&numeric.mass_matrix(q), dq),
        Function::ForwardKinematics => {
            let (rotation, origin) = chain.poses(q).pop().unwrap();
            let row = |i: usize| [rotation[(i, 0)], rotation[(i, 1)], rotation[(i, 2)], origin[i]];
            [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]].concat()
        }
        _ => return None,
    })
}

fn assert_close(what: &str, actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1.0f64, |m, x| m.max(x.abs()));
    for (i, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= tolerance * scale, "{what}: entry {i}: {a} against {e}");
    }
}

/// Compares a function's result with the reference; a regressor by its product with the values.
fn compare(
    name: &str,
    arm: &Arm,
    all: &[f64],
    state: &State,
    function: Function,
    result: &[f64],
    values: &[f64],
) {
    let Some(expected) = reference(arm, all, state, function) else { return };
    let what = format!("{name} {function}");
    let regressors = [Function::Regressor, Function::SlotineLiRegressor, Function::KineticEnergyRegressor];
    if regressors.contains(&function) {
        let rows = result.chunks(values.len());
        let product: Vec<f64> = rows.map(|row| row.iter().zip(values).map(|(y, p)| y * p).sum()).collect();
        assert_close(&what, &product, &expected, TOLERANCE);
    } else {
        // A solution is as exact as the mass matrix is well conditioned.
        let tolerance = if function == Function::ForwardDynamics { 1e-8 } else { TOLERANCE };
        assert_close(&what, result, &expected, tolerance);
    }
}

/// A model with every function of every set: proven once, for all tests.
struct Proven {
    model: Model,
    functions: Vec<(SetKind, Vec<Evaluator>)>,
}

impl Proven {
    fn new(arm: Arm) -> Proven {
        let model = Model::derive(arm).unwrap();
        let functions = model.sets().sets.iter().map(|set| (set.kind, proven(&model, set.kind))).collect();
        Proven { model, functions }
    }

    fn of(&self, kind: SetKind) -> &[Evaluator] {
        &self.functions.iter().find(|(of, _)| *of == kind).unwrap().1
    }
}

const ARMS: [&str; 6] = ["arm", "puma560", "ur5e", "panda", "stanford", "scara"];

fn proven_arm(name: &str) -> &'static Proven {
    static ALL: [OnceLock<Proven>; ARMS.len()] = [const { OnceLock::new() }; ARMS.len()];
    ALL[ARMS.iter().position(|n| *n == name).unwrap()].get_or_init(|| Proven::new(arm(name)))
}

fn check_evaluator(name: &str, proven: &Proven) {
    let model = &proven.model;
    let mut rng = ChaCha8Rng::seed_from_u64(42);
    for set in &model.sets().sets {
        let evaluators = proven.of(set.kind);
        for _ in 0..STATES {
            let all = values(model.arm(), &mut rng);
            let state = State::draw(&mut rng, model.arm().dof(), 3.0);
            let tau = reference(model.arm(), &all, &state, Function::InverseDynamics).unwrap();
            let parameters = model.set_values(set, &all);
            for evaluator in evaluators {
                let result = evaluate(evaluator, &Samples { tau: &tau, ..state.samples(&parameters) });
                let name = format!("{name} {}", set.kind);
                compare(&name, model.arm(), &all, &state, evaluator.function(), &result, &parameters);
            }
        }
    }
}

#[test]
fn evaluated_functions_agree_for_every_arm_and_set() {
    for name in ARMS {
        check_evaluator(name, proven_arm(name));
    }
}

#[test]
fn evaluated_functions_agree_with_high_gear_ratios() {
    let mut geared = paper_arm_with_ratios([100; 6].map(Some));
    geared.groupings.clear();
    check_evaluator("k = 100", &Proven::new(geared));
    let mut stanford = arm("stanford");
    stanford.joints.iter_mut().for_each(|j| j.rotor_ratio = Some(dyngen::exact::rational::integer(50)));
    check_evaluator("stanford k = 50", &Proven::new(stanford));
}

/// Motors that turn with several joints, tables that go along y too, both conventions, sliding joints.
#[test]
fn evaluated_functions_agree_with_transmissions_and_offsets_along_y() {
    use dyngen::arm::Transmission;
    use dyngen::exact::rational::{integer, parse_rational};
    let matrix = |rows: &[&[&str]]| -> Vec<Vec<_>> {
        rows.iter().map(|row| row.iter().map(|x| parse_rational(x).unwrap()).collect()).collect()
    };
    for name in ["puma560", "stanford"] {
        let mut coupled = arm(name);
        coupled.joints.iter_mut().for_each(|j| j.rotor_ratio = Some(integer(20)));
        let wrist = Transmission { joints: vec![4, 5], matrix: matrix(&[&["1", "0"], &["1", "1"]]) };
        let shoulder = Transmission {
            joints: vec![2, 0, 1],
            matrix: matrix(&[&["1", "0", "-1"], &["0", "1", "1/3"], &["0", "0", "2"]]),
        };
        coupled.transmissions = vec![wrist, shoulder];
        coupled.joints[1].b = parse_rational("0.07").unwrap();
        coupled.joints[3].b = parse_rational("-0.11").unwrap();
        check_evaluator(&format!("{name}, coupled"), &Proven::new(coupled));
    }
}

/// Compiled code agrees with the numeric Newton–Euler, and where that has no such function with the
/// evaluator.
#[test]
fn compiled_functions_agree_for_every_arm_and_set() {
    let mut rng = ChaCha8Rng::seed_from_u64(43);
    for file in generated::ALL {
        let proven = proven_arm(file.arm);
        let model = &proven.model;
        let set = model.set(file.set).unwrap();
        let evaluators = proven.of(set.kind);
        let name = format!("{} {}", file.arm, file.set);
        for _ in 0..STATES {
            let all = values(model.arm(), &mut rng);
            let state = State::draw(&mut rng, model.arm().dof(), 3.0);
            let tau = reference(model.arm(), &all, &state, Function::InverseDynamics).unwrap();
            let parameters = model.set_values(set, &all);
            let samples = Samples { tau: &tau, ..state.samples(&parameters) };
            for (evaluator, result) in evaluators.iter().zip((file.call)(&samples)) {
                let function = evaluator.function();
                compare(&name, model.arm(), &all, &state, function, &result, &parameters);
                // The same operations in the same order: only the sines may differ in the last place.
                assert_close(&format!("{name} {function}"), &result, &evaluate(evaluator, &samples), 1e-9);
            }
        }
    }
}

#[test]
fn the_full_regressor_agrees_column_by_column() {
    for name in ["arm", "puma560", "panda", "stanford"] {
        let proven = proven_arm(name);
        let model = &proven.model;
        let set = model.set(SetKind::Full).unwrap();
        let functions = proven.of(SetKind::Full);
        let evaluator = functions.iter().find(|e| e.function() == Function::Regressor).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(44);
        let state = State::draw(&mut rng, model.arm().dof(), 3.0);
        let out = evaluate(evaluator, &state.samples(&[]));
        let all = vec![0.0; model.arm().all_parameters().len()];
        let numeric = Dynamics::new(Chain::new(model.arm()), bodies(&all).unwrap()).unwrap();
        let reference = numeric.regressor(&state.q, &state.dq, &state.ddq);
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

/// Central differences of step h err by about h² times a third derivative, and by rounding over h.
const STEP: f64 = 1e-5;
const DIFFERENCE: f64 = 1e-6;

#[test]
fn rates_and_derivatives_agree_with_differences() {
    let mut rng = ChaCha8Rng::seed_from_u64(45);
    let index = |f: Function| Function::ALL.iter().position(|g| *g == f).unwrap();
    for file in generated::ALL {
        let model = &proven_arm(file.arm).model;
        let (n, name) = (model.arm().dof(), format!("{} {}", file.arm, file.set));
        let parameters = model.set_values(model.set(file.set).unwrap(), &values(model.arm(), &mut rng));
        let state = State::draw(&mut rng, n, 3.0);
        let at = |q: Vec<f64>, dq: Vec<f64>| {
            (file.call)(&Samples { q: &q, dq: &dq, tau: &state.ddq, ..state.samples(&parameters) })
        };
        let shifted = |x: &[f64], by: &[f64], h: f64| -> Vec<f64> {
            x.iter().zip(by).map(|(a, b)| a + h * b).collect()
        };
        let difference = |plus: &[Vec<f64>], minus: &[Vec<f64>], f: Function| -> Vec<f64> {
            plus[index(f)].iter().zip(&minus[index(f)]).map(|(a, b)| (a - b) / (2.0 * STEP)).collect()
        };
        let now = at(state.q.clone(), state.dq.clone());
        let value = |f: Function| now[index(f)].clone();
        let [after, before] = [STEP, -STEP].map(|h| at(shifted(&state.q, &state.dq, h), state.dq.clone()));

        // Ḃ − 2C is skew-symmetric.
        let (rate, c) = (difference(&after, &before, Function::MassMatrix), value(Function::CoriolisMatrix));
        let sum: Vec<f64> = (0..n * n).map(|k| c[k] + c[k % n * n + k / n]).collect();
        assert_close(&format!("{name}: C + Cᵀ against Ḃ"), &sum, &rate, DIFFERENCE);
        // J̇·q̇
        let jdot = difference(&after, &before, Function::Jacobian);
        let product: Vec<f64> =
            jdot.chunks(n).map(|row| row.iter().zip(&state.dq).map(|(a, b)| a * b).sum()).collect();
        assert_close(
            &format!(
                "{name}: \
            J̇·q̇"
            ),
            &value(Function::JacobianRateTimesVelocity),
            &product,
            DIFFERENCE,
        );
        // B·B⁻¹ = 1
        let (b, inverse) = (value(Function::MassMatrix), value(Function::MassMatrixInverse));
        let unit: Vec<f64> = (0..n * n).map(|k| f64::from(u8::from(k / n == k % n))).collect();
        let product: Vec<f64> =
            (0..n * n).map(|k| (0..n).map(|m| b[k / n * n + m] * inverse[m * n + k % n]).sum()).collect();
        assert_close(&format!("{name}: B·B⁻¹"), &product, &unit, 1e-7);

        for j in 0..n {
            let e: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == j))).collect();
            let column = |f: Function| -> Vec<f64> { value(f).chunks(n).map(|row| row[j]).collect() };
            let [plus, minus] = [STEP, -STEP].map(|h| at(shifted(&state.q, &e, h), state.dq.clone()));
            let what = format!("{name}: ∂/∂q{}", j + 1);
            assert_close(
                &what,
                &column(Function::TorqueByPosition),
                &difference(&plus, &minus, Function::InverseDynamics),
                DIFFERENCE,
            );
            let gravity = difference(&plus, &minus, Function::PotentialEnergy);
            assert_close(&what, &[value(Function::Gravity)[j]], &gravity, DIFFERENCE);
            let pose = difference(&plus, &minus, Function::ForwardKinematics);
            assert_close(&what, &column(Function::Jacobian)[..3], &[pose[3], pose[7], pose[11]], DIFFERENCE);
            let [plus, minus] = [STEP, -STEP].map(|h| at(state.q.clone(), shifted(&state.dq, &e, h)));
            let what = format!("{name}: ∂/∂q̇{}", j + 1);
            assert_close(
                &what,
                &column(Function::TorqueByVelocity),
                &difference(&plus, &minus, Function::InverseDynamics),
                DIFFERENCE,
            );
            assert_close(
                &what,
                &[value(Function::Momentum)[j]],
                &difference(&plus, &minus, Function::KineticEnergy),
                DIFFERENCE,
            );
        }
    }
}
