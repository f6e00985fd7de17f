//! Bounds against what emitted operations do at random states and at corners of the limits.

#![allow(clippy::unwrap_used)]

mod seen;
mod twice;

use super::factors::Factors;
use super::interval::Interval;
use super::limits::Limits;
use super::task::Task;
use super::{Bounder, Bounds, Divisor, bounds, divisor};
use crate::arm::{Arm, Parameter, ParameterKind};
use crate::consistency::parameters_of_body;
use crate::dynamics::{Function, FunctionGraph};
use crate::graph::{Node, Preparation};
use crate::model::Model;
use crate::parameters::{SetKind, SetParameter};
use crate::values::Values;
use chacha20::ChaCha8Rng;
use nalgebra::{Matrix3, SMatrix, Vector3};
use rand::{RngExt, SeedableRng};
use seen::{Emitted, Seen, State, most};
use std::time::Instant;

fn lwa4p() -> (Model, Vec<f64>) {
    let arm = Arm::parse(include_str!("../../../powerball/lwa4p.toml"), "lwa4p.toml").unwrap();
    let model = Model::derive(arm).unwrap();
    let values = Values::parse(include_str!("../../../examples/cpp-controller/model.json"), "model.json");
    let values = values.unwrap().of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
    (model, values)
}

#[test]
fn no_state_of_the_lwa_4p_is_further_off_than_its_bound() {
    let (model, values) = lwa4p();
    let bounder = Bounder::new(&model, Some(&values));
    for function in model.functions(SetKind::Minimal) {
        let built = model.function(function, SetKind::Minimal).unwrap();
        let bounds = bounder.bounds(&built).unwrap_or_else(|why| panic!("{function}: {why}"));
        let seen = Seen::of(&model, &values, (&built, bounds), 200, 50);
        // A bound that holds for everything says nothing: those of the common functions are near what is
        // seen, but of accelerations of points intervals know less.
        let loose = function == Function::JacobianRateTimesVelocity;
        let is_common = Function::common().any(|common| common == function);
        if is_common || function == Function::TaskInertiaInverse {
            let worst = [
                most(&seen.bounds.single) / most(&seen.single),
                most(&seen.bounds.double) / most(&seen.double),
            ];
            let limit = if loose { 1000.0 } else { 50.0 };
            assert!(worst.iter().all(|x| *x < limit), "{function}: {worst:?}");
        }
    }
}

/// A light wrist that turns, and one joint that slides; values of the full and of the minimal set.
fn light_wrist(convention: &str, angles: [&str; 2]) -> (Model, Vec<f64>, Vec<f64>) {
    light_wrist_within(convention, angles, [50.0, 50.0, 100.0, 2.0, 0.05], (2.0, "0, 1, -9.81"))
}

/// [`light_wrist`] with other limits of torques and of every velocity, and other gravity.
fn light_wrist_within(
    convention: &str,
    [alpha_4, theta]: [&str; 2],
    torques: [f64; 5],
    (velocity, gravity): (f64, &str),
) -> (Model, Vec<f64>, Vec<f64>) {
    let joints = [
        ("revolute", "\"pi/2\""),
        ("revolute", "0"),
        ("prismatic", "\"-pi/2\""),
        ("revolute", alpha_4),
        ("revolute", "\"pi/2\""),
    ];
    LightArm { convention, joints: &joints, theta, torques: &torques, velocity, gravity, ..LightArm::TURNING }
        .built()
}

/// An arm whose last links are so light that boxes of poses prove nothing.
#[derive(Clone, Copy)]
struct LightArm<'a> {
    convention: &'a str,
    /// Kind and alpha.
    joints: &'a [(&'a str, &'a str)],
    theta: &'a str,
    /// Limits.
    torques: &'a [f64],
    velocity: f64,
    gravity: &'a str,
    /// The centre of the last link, in units of its size.
    last_centre: [f64; 3],
    /// Joints from the first on that have a rotor of this ratio.
    rotors: (usize, u32),
}

impl LightArm<'_> {
    /// As of a UR: three parallel axes, then a wrist.
    const TURNING: LightArm<'static> = LightArm {
        convention: "modified",
        joints: &[
            ("revolute", "0"),
            ("revolute", "\"pi/2\""),
            ("revolute", "0"),
            ("revolute", "0"),
            ("revolute", "\"pi/2\""),
            ("revolute", "\"-pi/2\""),
        ],
        theta: "0",
        torques: &[50.0, 50.0, 20.0, 2.0, 0.5, 0.05],
        velocity: 2.0,
        gravity: "0, 1, -9.81",
        last_centre: CENTRE,
        rotors: (0, 1),
    };

    /// Model, and values of the full and of the minimal set.
    fn built(&self) -> (Model, Vec<f64>, Vec<f64>) {
        let LightArm { convention, theta, velocity, gravity, .. } = *self;
        let joint = |(i, ((kind, alpha), torque)): (usize, (&(&str, &str), &f64))| {
            let (driven, ratio) = self.rotors;
            let mut more = if i < driven { format!(", rotor_ratio = {ratio}") } else { String::new() };
            if i + 1 == self.joints.len() && self.last_centre[..2] == [0.0; 2] {
                more += ", zero = [\"mx\", \"my\"]";
            }
            format!(
                "{{ kind = \"{kind}\", a = 0.2, alpha = {alpha}, d = 0.1, theta = {theta}, \
                 position = [-2, 2.5], velocity = {velocity}, acceleration = 5, torque = {torque}{more} }}"
            )
        };
        let joints: Vec<String> = self.joints.iter().zip(self.torques).enumerate().map(joint).collect();
        let text = format!(
            "name = \"a\"\nconvention = \"{convention}\"\ngravity = [{gravity}]\njoint = [\n{}\n]",
            joints.join(",\n")
        );
        let model = Model::derive(Arm::parse(&text, "arm.toml").unwrap()).unwrap();
        // Masses and sizes, the last one's at the end.
        let links = [(4.0, 0.1), (3.0, 0.1), (2.0, 0.08), (0.5, 0.05), (0.3, 0.05), (0.05, 0.02)];
        let n = joints.len();
        let value = |p: &SetParameter| {
            let Parameter { link, kind } = p.terms[0].0;
            if kind == ParameterKind::Im {
                return ROTOR;
            }
            let is_last = link + 1 == n;
            let (mass, size) = links[if is_last { 5 } else { link }];
            let centre = Vector3::from(if is_last { self.last_centre } else { CENTRE }) * size;
            let shift = centre.cross_matrix();
            let tensor = Matrix3::from_diagonal(&Vector3::new(1.0, 1.2, 0.9)) * mass * size * size;
            let body = parameters_of_body(mass, &(centre * mass), &(tensor - shift * shift * mass));
            body[ParameterKind::ALL.iter().position(|k| *k == kind).unwrap()]
        };
        let parameters = &model.set(SetKind::Full).unwrap().parameters;
        let full: Vec<f64> = parameters.iter().map(value).collect();
        let names = parameters.iter().map(|p| p.name.as_str());
        let named = Values::named(names.zip(full.iter().copied()), "values");
        let minimal = named.of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
        (model, full, minimal)
    }
}

/// Inertia of a rotor, kg·m².
const ROTOR: f64 = 1e-4;

/// A centre of mass on no axis.
const CENTRE: [f64; 3] = [0.5, -0.3, 0.8];

#[test]
fn no_acceleration_of_an_arm_with_a_light_wrist_is_further_off_than_its_bound() {
    let rotors = LightArm { rotors: (4, 50), ..LightArm::TURNING }.built();
    let [standard, modified] = ["standard", "modified"].map(|c| light_wrist(c, ["\"pi/2\"", "0"]));
    for (model, full, minimal) in [standard, modified, rotors] {
        let without = Bounder::new(&model, Some(&minimal));
        let bounder = Bounder::new(&model, Some(&minimal)).with_links(Some(&full));
        // Rounding changes its Λ⁻¹ by more than the proof allows.
        let wanted = [Some(Divisor::Pivots), Some(Divisor::Loaded)];
        for function in model.functions(SetKind::Minimal).filter(|f| wanted.contains(&divisor(*f))) {
            let built = model.function(function, SetKind::Minimal).unwrap();
            assert!(without.bounds(&built).is_err(), "boxes prove {function}: the wrist is not light enough");
            let bounds = bounder.bounds(&built).unwrap_or_else(|e| panic!("{function}: {e}"));
            // A payload is much heavier than the last links.
            let kept =
                if divisor(function) == Some(Divisor::Pivots) { &bounds.single } else { &bounds.double };
            assert!(kept.iter().all(|x| x.is_finite()), "{function} has no bound");
            let seen = Seen::of(&model, &minimal, (&built, bounds), 2000, 200);
            if matches!(function, Function::ForwardDynamics | Function::MassMatrixInverse) {
                let worst = [
                    most(&seen.bounds.single) / most(&seen.single),
                    most(&seen.bounds.double) / most(&seen.double),
                ];
                // What bounds that hold for any masses of the links cost.
                assert!(worst.iter().all(|x| *x < 4e5), "{function}: {worst:?}");
            }
        }
    }
}

/// The optimiser may mix a right-hand side with what the solve subtracts from it, so that no operation has
/// its value: it counts all the same. One torque much larger than the others shows one that is left out.
#[test]
fn every_entry_of_a_right_hand_side_counts() {
    for joint in 0..5 {
        let torques = std::array::from_fn(|k| if k == joint { 5e6 } else { 1e-3 });
        let (model, full, minimal) =
            light_wrist_within("standard", ["\"pi/2\"", "0"], torques, (1e-3, "0, 0, 0"));
        let bounder = Bounder::new(&model, Some(&minimal)).with_links(Some(&full));
        for function in [Function::ForwardDynamics, Function::AccelerationByVelocity] {
            let built = model.function(function, SetKind::Minimal).unwrap();
            let bounds = bounder.bounds(&built).unwrap();
            Seen::of(&model, &minimal, (&built, bounds), 2000, 200);
        }
    }
}

/// Products that are formed within sums round once with them: bounds are below those of other code, and hold.
#[test]
fn no_state_is_further_off_than_the_bound_of_contracted_code() {
    let (model, values) = lwa4p();
    let bounder = Bounder::new(&model, Some(&values));
    for function in [
        Function::InverseDynamics,
        Function::MassMatrix,
        Function::CoriolisMatrix,
        Function::ForwardDynamics,
        Function::TorqueByPosition,
    ] {
        let plain = model.function(function, SetKind::Minimal).unwrap();
        let built = FunctionGraph { contracted: true, ..plain.clone() };
        assert!(built.contraction().count() > 20, "{function}");
        let [before, bounds] = [&plain, &built].map(|built| bounder.bounds(built).unwrap());
        let total = |bounds: &Bounds| bounds.single.iter().sum::<f64>();
        assert!(total(&bounds) < 0.99 * total(&before), "{function}");
        let seen = Seen::of(&model, &values, (&built, bounds), 200, 50);
        let worst = most(&seen.bounds.single) / most(&seen.single);
        assert!(worst < 50.0, "{function}: {worst}");
    }
}

/// What is taken out of a function for all states changes nothing of what is contracted in the rest, so a
/// bound of the whole is one of the code.
#[test]
fn contraction_is_that_of_the_code_behind_the_preparation() {
    let (model, _) = lwa4p();
    for function in model.functions(SetKind::Minimal) {
        let built = model.function(function, SetKind::Minimal).unwrap();
        let built = FunctionGraph { contracted: true, ..built };
        let rest = built.without_preparation(&mut Preparation::default());
        // Of each state-dependent sum, in order: whether it takes its first or second term in, or none.
        let taken = |built: &FunctionGraph| {
            let (graph, contraction) = (&built.graph, built.contraction());
            let holds = graph.holds();
            let products: Vec<usize> = graph.needed(&built.outputs);
            let states = products
                .into_iter()
                .filter(|k| holds[*k].state && !matches!(graph.nodes()[*k], Node::Input(_)));
            states.map(|k| contraction.is_within(k)).collect::<Vec<bool>>()
        };
        assert_eq!(taken(&built), taken(&rest), "{function}");
    }
}

/// Angles with offsets, constants that are symbols, a joint that slides, parameters without values.
#[test]
fn no_state_of_a_general_arm_is_further_off_than_its_bound() {
    let joint = |kind: &str| {
        format!(
            "{{ kind = \"{kind}\", a = 0.3, alpha = 0.7, d = 0.1, theta = 0.4, position = [-2.5, 3.1], \
             velocity = 2.5, acceleration = 7, torque = 3 }},"
        )
    };
    let joints =
        [joint("revolute"), joint("prismatic"), joint("revolute").replace("alpha = 0.7", "alpha = 0")];
    let text = format!(
        "name = \"a\"\nconvention = \"modified\"\ngravity = [0, 3, -9.81]\njoint = [\n{}\n]",
        joints.join("\n")
    );
    let model = Model::derive(Arm::parse(&text, "arm.toml").unwrap()).unwrap();
    let parameters = model.set(SetKind::Minimal).unwrap().parameters.len();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for function in [Function::InverseDynamics, Function::ForwardKinematics, Function::CoriolisMatrix] {
        let built = model.function(function, SetKind::Minimal).unwrap();
        let bounds = bounds(&model, &built, None).unwrap();
        let mut singles = Emitted::<f32>::new(&model, &built);
        let mut doubles = Emitted::<f64>::new(&model, &built);
        let mut seen = vec![0.0f64; built.outputs.len()];
        for _ in 0..500 {
            let values: Vec<f64> =
                (0..parameters).map(|_| f64::from(rng.random_range(-1.0..1.0f32))).collect();
            let state = State::draw(model.arm(), &values, false, &mut rng);
            let double = doubles.run(&state);
            for (k, x) in singles.run(&state).into_iter().enumerate() {
                seen[k] = seen[k].max((f64::from(x) - double[k]).abs());
                assert!(seen[k] <= bounds.single[k] + bounds.double[k], "{function} {k}: {:e}", seen[k]);
            }
        }
        assert!(most(&bounds.single) < 100.0 * most(&seen), "{function}");
    }
}

#[test]
fn a_limit_that_the_file_lacks_is_named() {
    let text = include_str!("../../../powerball/lwa4p.toml").replacen("torque = 19.0", "", 1);
    let model = Model::derive(Arm::parse(&text, "lwa4p.toml").unwrap()).unwrap();
    let of = |function| bounds(&model, &model.function(function, SetKind::Minimal).unwrap(), None);
    assert_eq!(of(Function::ForwardDynamics).unwrap_err(), "the arm file gives no torque of joint 5");
    assert!(of(Function::Gravity).is_ok());
}

/// The inverse of the last rows and columns from `first` on, where they stand.
fn inverse_from(b: &SMatrix<f64, 6, 6>, first: usize) -> SMatrix<f64, 6, 6> {
    let one = SMatrix::<f64, 6, 6>::identity();
    let block = SMatrix::<f64, 6, 6>::from_fn(|i, j| if i.min(j) >= first { b[(i, j)] } else { one[(i, j)] });
    block.try_inverse().unwrap()
}

/// Entries of B⁻¹, L and D, with a payload too, and of Λ are in their ranges at poses of the whole range and
/// of its corners.
#[test]
fn ranges_of_factors_hold_every_pose() {
    let (model, values) = lwa4p();
    let arm = model.arm();
    let limits = Limits::new(arm, Some(&values));
    let bounder = Bounder::new(&model, Some(&values));
    let every = |_: &[f64]| true;
    let rough = bounder.matrix(Function::MassMatrix, &limits).unwrap().factors(0.5, 100_000).unwrap();
    ranges_hold_every_pose((&model, Function::MassMatrix), &values, (&rough, 0.3), every);
    let loaded = bounder.loaded(&limits).unwrap();
    ranges_hold_every_pose((&model, Function::MassMatrixWithPayload), &values, (loaded, 0.3), every);
    let Task { factors, poses } = bounder.task(&limits).unwrap();
    let within = |inverse: &[f64]| (0..6).all(|i| inverse[7 * i] <= poses.largest_inertia[i]);
    ranges_hold_every_pose((&model, Function::TaskInertiaInverse), &values, (factors, 0.9), within);
    assert!((0.5..1.0).contains(&poses.share), "{poses:?}");
    let turning = LightArm { rotors: (4, 50), theta: "0.3", ..LightArm::TURNING }.built();
    let [standard, modified] = ["standard", "modified"].map(|c| light_wrist(c, ["0.7", "0.3"]));
    for (model, full, values) in [standard, modified, turning] {
        let bounder = Bounder::new(&model, Some(&values)).with_links(Some(&full));
        let factors = bounder.unloaded(&Limits::new(model.arm(), Some(&values))).unwrap();
        assert!(factors.diagonal.is_some(), "boxes prove B: the wrist is not light enough");
        ranges_hold_every_pose((&model, Function::MassMatrix), &values, (factors, 0.1), every);
    }
}

/// `near` says how near to its end the range of the first entry of the inverse must be reached: ranges that
/// hold everything would say nothing. `counts` says of the inverse whether its pose is one of the ranges'.
fn ranges_hold_every_pose(
    (model, function): (&Model, Function),
    values: &[f64],
    (factors, near): (&Factors, f64),
    counts: impl Fn(&[f64]) -> bool,
) {
    let n = factors.n;
    let built = model.function(function, SetKind::Minimal).unwrap();
    let mut matrices = Emitted::<f64>::new(model, &built);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut reached = 0.0f64;
    for _ in 0..5_000 {
        let state = State::draw(model.arm(), values, true, &mut rng);
        let flat = matrices.run(&state);
        // Where there are fewer joints, the rest is the identity.
        let entry =
            |i: usize, j: usize| if i.max(j) < n { flat[i * n + j] } else { f64::from(u8::from(i == j)) };
        let b = SMatrix::<f64, 6, 6>::from_fn(entry);
        let inverse = inverse_from(&b, 0);
        if !counts(inverse.as_slice()) {
            continue;
        }
        let inside = |x: f64, range: Interval| range.widened(1e-9 * x.abs().max(1.0)).contains(x);
        for k in 0..n * n {
            assert!(inside(inverse[(k / n, k % n)], factors.inverse[k]), "B⁻¹ {k}");
        }
        reached = reached.max(inverse[(0, 0)] / factors.inverse[0].high);
        // Pivots from the last joint inwards: 1/d is the first entry of the inverse of what is left.
        for i in 0..n {
            let outer = inverse_from(&b, i);
            assert!(inside(1.0 / outer[(i, i)], factors.pivots[i]), "d {i}");
            for j in 0..i {
                let l = (i..n).map(|c| outer[(i, c)] * b[(c, j)]).sum::<f64>();
                assert!(inside(l, factors.lower[i * n + j]), "L {i} {j}");
                // The outer joints follow when j accelerates: column j of L⁻¹.
                let freed = inverse_from(&b, j + 1);
                let l = -(j + 1..n).map(|c| freed[(i, c)] * b[(c, j)]).sum::<f64>();
                assert!(inside(l, factors.lower_inverse[i * n + j]), "L⁻¹ {i} {j}");
            }
        }
    }
    assert!(reached > near, "{reached}");
}

#[test]
fn an_arm_whose_mass_matrix_is_not_positive_is_named_with_a_pose() {
    let (model, mut values) = lwa4p();
    let of = |values: Option<&[f64]>, function| {
        bounds(&model, &model.function(function, SetKind::Minimal).unwrap(), values)
    };
    assert!(of(None, Function::ForwardDynamics).unwrap_err().contains("--values"));
    // Less than the first joint's inertia when the arm points upwards.
    values[0] -= 1.2;
    let negative = of(Some(&values), Function::ForwardDynamics).unwrap_err();
    assert!(negative.contains("not positive definite") && negative.contains("at q = ["), "{negative}");
}

#[test]
#[ignore = "at_length minutes: cargo test --release -p dyngen --lib rounding -- --ignored --nocapture"]
fn no_state_of_a_million_is_further_off_than_its_bound() {
    compare_at_length(|function| divisor(function).is_none());
}

#[test]
#[ignore = "at_length minutes: cargo test --release -p dyngen --lib rounding -- --ignored --nocapture"]
fn no_acceleration_of_a_million_is_further_off_than_its_bound() {
    compare_at_length(|function| divisor(function).is_some());
}

#[test]
#[ignore = "at_length minutes: cargo test --release -p dyngen --lib rounding -- --ignored --nocapture"]
fn no_state_of_light_arms_is_further_off_than_its_bound() {
    let with = |text, rotors, last_centre| (text, LightArm { rotors, last_centre, ..LightArm::TURNING });
    for (text, arm) in [
        with("light wrist", (0, 1), CENTRE),
        with("last centre on its axis", (0, 1), [0.0, 0.0, 0.8]),
        with("rotors", (4, 50), CENTRE),
        with("rotors at all joints", (6, 50), CENTRE),
    ] {
        println!("{text}");
        let (model, full, minimal) = arm.built();
        let bounder = Bounder::new(&model, Some(&minimal)).with_links(Some(&full));
        compare((&model, &bounder, &minimal), 50_000, |function| divisor(function).is_some());
    }
}

fn compare_at_length(wanted: impl Fn(Function) -> bool) {
    let (model, values) = lwa4p();
    compare((&model, &Bounder::new(&model, Some(&values)), &values), 1_000_000, wanted);
}

fn compare(
    (model, bounder, values): (&Model, &Bounder<'_>, &[f64]),
    samples: usize,
    wanted: impl Fn(Function) -> bool,
) {
    println!(
        "function, time, bound in f32; then of f32 and of f64 the bound / the worst error that was seen: of \
        the"
    );
    println!("worst entry, and the largest of all entries");
    for function in model.functions(SetKind::Minimal).filter(|f| wanted(*f)) {
        let built = model.function(function, SetKind::Minimal).unwrap();
        let start = Instant::now();
        let found = bounder.bounds(&built);
        let seconds = start.elapsed().as_secs_f64();
        let found = match found {
            Ok(found) => found,
            Err(why) => {
                println!("{:36} {seconds:6.2} s  no bound: {why}", function.name());
                continue;
            }
        };
        let seen = Seen::of(model, values, (&built, found), samples, samples / 50);
        let Seen { bounds, single, double } = &seen;
        let of = |bounds: &[f64], seen: &[f64]| {
            let ratios = Seen::ratios(bounds, seen);
            let over = ratios.iter().filter(|x| **x > 10.0).count();
            format!(
                "{:6.1} {:7.1} ({over:3} of {:3} > 10)",
                most(bounds) / most(seen),
                most(&ratios),
                ratios.len()
            )
        };
        let [f32, f64] = [of(&bounds.single, single), of(&bounds.double, double)];
        println!("{:36} {seconds:6.2} s  {:8.1e}  {f32}   {f64}", function.name(), most(&bounds.single));
    }
}
