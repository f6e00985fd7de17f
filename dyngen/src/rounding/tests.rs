//! Bounds against what emitted operations do at random states and at corners of the limits.

#![allow(clippy::unwrap_used)]

mod twice;

use super::bodies;
use super::factors::{Factors, MassMatrix};
use super::interval::Interval;
use super::limits::Limits;
use super::{Bounder, Bounds, Divisor, bounds, divisor};
use crate::arm::{Arm, Parameter, ParameterKind};
use crate::consistency::parameters_of_body;
use crate::dynamics::function::Argument;
use crate::dynamics::{Function, FunctionGraph};
use crate::emit::emitted_sin_cos;
use crate::exact::rational::to_f64;
use crate::graph::evaluate::{Field, evaluate};
use crate::graph::{Contraction, Expr, Input, JointSum, Node, Preparation};
use crate::model::Model;
use crate::parameters::{SetKind, SetParameter};
use crate::values::Values;
use chacha20::ChaCha8Rng;
use nalgebra::{Matrix3, RealField, SMatrix, Vector3, convert};
use rand::{RngExt, SeedableRng};
use std::time::Instant;
use twice::Twice;

/// What a function is given: one number for each of an argument's.
struct State(Vec<(Argument, Vec<f64>)>);

impl State {
    /// Numbers of `f32` within the limits: half of the states have velocities, accelerations and torques at
    /// their limits.
    fn draw(arm: &Arm, parameters: &[f64], rng: &mut ChaCha8Rng) -> State {
        let (corner, end) = (rng.random_range(0..2) == 0, rng.random_range(0..8) == 0);
        let mut number = |low: f64, high: f64, at_end: bool| {
            let x: f64 = rng.random_range(low..=high);
            let x = if at_end { if x < 0.5 * (low + high) { low } else { high } } else { x };
            // Towards zero, so that it stays within.
            let single = x as f32;
            f64::from(if f64::from(single).abs() > x.abs() {
                single.abs().next_down().copysign(single)
            } else {
                single
            })
        };
        let mut all = Vec::new();
        let joints: Vec<_> = arm.coordinates().into_iter().map(|joint| &arm.joints[joint]).collect();
        let position = joints.iter().map(|j| j.position.unwrap());
        all.push((Argument::Positions, position.map(|[low, high]| number(low, high, end)).collect()));
        let mut within = |argument, limits: Vec<f64>| {
            all.push((argument, limits.into_iter().map(|x| number(-x, x, corner)).collect()));
        };
        let of = |limit: fn(&crate::arm::Joint) -> Option<f64>| -> Vec<f64> {
            joints.iter().map(|j| limit(j).unwrap()).collect()
        };
        within(Argument::Velocities, of(|j| j.velocity));
        within(Argument::ReferenceVelocities, of(|j| j.velocity));
        within(Argument::Accelerations, of(|j| j.acceleration));
        within(Argument::ReferenceAccelerations, of(|j| j.acceleration));
        within(Argument::Torques, of(|j| j.torque));
        within(Argument::Errors, vec![1.0; joints.len()]);
        within(Argument::Wrench, vec![1.0; 6]);
        within(Argument::Payload, vec![1.0; 10]);
        within(Argument::PositionDirection, vec![1.0; joints.len()]);
        within(Argument::VelocityDirection, vec![1.0; joints.len()]);
        all.push((Argument::Parameters, parameters.to_vec()));
        State(all)
    }

    fn of(&self, argument: Argument, i: usize) -> f64 {
        self.0.iter().find(|(a, _)| *a == argument).unwrap().1[i]
    }

    /// An input other than a sine or a cosine.
    fn input(&self, input: Input) -> f64 {
        let (argument, i) = super::program::variable(input).unwrap();
        self.of(argument, i)
    }

    fn q(&self, i: usize) -> f64 {
        self.of(Argument::Positions, i)
    }

    /// The outputs to twice a double's digits; of arms without offsets and symbols, whose angles are exact
    /// sums.
    fn exact(&self, built: &FunctionGraph) -> Vec<Twice> {
        let turned = |sum: JointSum| {
            let add = |all: Twice, (joint, negative): (usize, bool)| {
                let q = Twice::from(self.q(joint));
                all.add(if negative { q.neg() } else { q })
            };
            sum.joints().fold(Twice::from(0.0), add).sin_cos()
        };
        let input = |input: Input| match input {
            Input::Sin(sum) => turned(sum).0,
            Input::Cos(sum) => turned(sum).1,
            other => Twice::from(self.input(other)),
        };
        evaluate(&built.graph, &built.outputs, input, |_, _| Twice::from(0.0)).unwrap()
    }
}

/// A function as emitted code computes it.
struct Emitted<'a, T> {
    model: &'a Model,
    built: &'a FunctionGraph,
    needed: Vec<usize>,
    contraction: Contraction,
    /// The values of all nodes; those of constants are there from the first.
    values: Vec<T>,
}

impl<'a, T: RealField + Copy> Emitted<'a, T> {
    fn new(model: &'a Model, built: &'a FunctionGraph) -> Self {
        let constant = |node: &Node| match node {
            Node::Constant(index) => convert(to_f64(built.graph.constant(*index))),
            Node::Symbol(index, sine) => {
                let (s, c) = model.symbols().angles[*index as usize].sin_cos();
                convert(if *sine { s } else { c })
            }
            _ => T::zero(),
        };
        let values = built.graph.nodes().iter().map(constant).collect();
        let (needed, contraction) = (built.graph.needed(&built.outputs), built.contraction());
        Emitted { model, built, needed, contraction, values }
    }

    fn run(&mut self, state: &State) -> Vec<T> {
        for node in &self.needed {
            let of = |e: Expr| if e.is_negative() { -self.values[e.node()] } else { self.values[e.node()] };
            // Nobody reads what is formed within a sum.
            if self.contraction.is_within(*node) {
                self.values[*node] = convert(f64::NAN);
                continue;
            }
            self.values[*node] = match self.built.graph.nodes()[*node] {
                Node::Add(a, b) if self.contraction.product_in(*node).is_some() => {
                    let first = self.contraction.product_in(*node) == Some(a.node());
                    let (product, addend) = if first { (a, b) } else { (b, a) };
                    let Node::Mul(x, y) = self.built.graph.nodes()[product.node()] else { unreachable!() };
                    let x = if product.is_negative() { -of(x) } else { of(x) };
                    x.mul_add(of(y), of(addend))
                }
                Node::Constant(_) | Node::Symbol(..) => continue,
                Node::Input(Input::Sin(sum)) => self.turned(sum, state).0,
                Node::Input(Input::Cos(sum)) => self.turned(sum, state).1,
                Node::Input(input) => convert(state.input(input)),
                Node::Add(a, b) => of(a) + of(b),
                Node::Mul(a, b) => of(a) * of(b),
                Node::Div(a, b) => of(a) / of(b),
            };
        }
        let of = |e: &Expr| if e.is_negative() { -self.values[e.node()] } else { self.values[e.node()] };
        self.built.outputs.iter().map(of).collect()
    }

    fn turned(&self, sum: JointSum, state: &State) -> (T, T) {
        let mut angle = T::zero();
        for (k, (joint, negative)) in sum.joints().enumerate() {
            let of = self.model.angles().joint(joint);
            let q: T = convert(state.q(of.coordinate));
            let term = of.ratio.map_or(q, |ratio| convert::<f64, T>(ratio) * q);
            angle = if k == 0 {
                term
            } else if negative {
                angle - term
            } else {
                angle + term
            };
        }
        let offset = self.model.angles().offset(sum);
        emitted_sin_cos(if offset == 0.0 { angle } else { angle + convert(offset) })
    }
}

fn lwa4p() -> (Model, Vec<f64>) {
    let arm = Arm::parse(include_str!("../../../powerball/lwa4p.toml"), "lwa4p.toml").unwrap();
    let model = Model::derive(arm).unwrap();
    let values = Values::parse(include_str!("../../../examples/cpp-controller/model.json"), "model.json");
    let values = values.unwrap().of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
    (model, values)
}

/// The worst of each output, in single and in double precision; each within its bound.
struct Seen {
    bounds: Bounds,
    single: Vec<f64>,
    double: Vec<f64>,
}

impl Seen {
    /// `exact` of the samples are evaluated with twice the digits too.
    fn of(
        model: &Model,
        values: &[f64],
        (built, bounds): (&FunctionGraph, Bounds),
        samples: usize,
        exact: usize,
    ) -> Seen {
        // What both formats are given.
        let parameters: Vec<f64> = values.iter().map(|x| f64::from(*x as f32)).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let [mut single, mut double] = [(); 2].map(|()| vec![0.0f64; built.outputs.len()]);
        let mut singles = Emitted::<f32>::new(model, built);
        let mut doubles = Emitted::<f64>::new(model, built);
        for sample in 0..samples {
            let state = State::draw(model.arm(), &parameters, &mut rng);
            let in_double = doubles.run(&state);
            for (k, x) in singles.run(&state).into_iter().enumerate() {
                let error = (f64::from(x) - in_double[k]).abs();
                single[k] = single[k].max(error - bounds.double[k].min(error));
                assert!(error <= bounds.single[k] + bounds.double[k], "{} {k}: {error:e}", built.function);
            }
            if sample < exact {
                for (k, x) in state.exact(built).into_iter().enumerate() {
                    double[k] = double[k].max(x.add(Twice::from(-in_double[k])).high().abs());
                    assert!(double[k] <= bounds.double[k], "{} {k}: {:e}", built.function, double[k]);
                }
            }
        }
        Seen { bounds, single, double }
    }

    /// How many times the worst that was seen each bound is; entries that are exact are left out.
    fn ratios(bounds: &[f64], seen: &[f64]) -> Vec<f64> {
        bounds.iter().zip(seen).filter(|(_, seen)| **seen > 0.0).map(|(bound, seen)| bound / seen).collect()
    }
}

fn most(all: &[f64]) -> f64 {
    all.iter().copied().fold(0.0, f64::max)
}

#[test]
fn no_state_of_the_lwa_4p_is_further_off_than_its_bound() {
    let (model, values) = lwa4p();
    let bounder = Bounder::new(&model, Some(&values));
    for function in model.functions(SetKind::Minimal) {
        let built = model.function(function, SetKind::Minimal).unwrap();
        let Ok(bounds) = bounder.bounds(&built) else {
            let without = [Divisor::Task, Divisor::Loaded].map(Some);
            assert!(without.contains(&divisor(function)), "{function} has no bound");
            continue;
        };
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

/// Turning joints and one that slides, with a wrist so light that boxes of poses prove nothing; values of the
/// full and of the minimal set.
fn light_wrist(convention: &str, angles: [&str; 2]) -> (Model, Vec<f64>, Vec<f64>) {
    light_wrist_within(convention, angles, [50.0, 50.0, 100.0, 2.0, 0.05], (2.0, "0, 1, -9.81"))
}

/// The same with other limits of torques and of every velocity, and other gravity.
fn light_wrist_within(
    convention: &str,
    [alpha_4, theta]: [&str; 2],
    torques: [f64; 5],
    (velocity, gravity): (f64, &str),
) -> (Model, Vec<f64>, Vec<f64>) {
    let kinds = [
        ("revolute", "\"pi/2\""),
        ("revolute", "0"),
        ("prismatic", "\"-pi/2\""),
        ("revolute", alpha_4),
        ("revolute", "\"pi/2\""),
    ];
    let joint = |((kind, alpha), torque): ((&str, &str), f64)| {
        format!(
            "{{ kind = \"{kind}\", a = 0.2, alpha = {alpha}, d = 0.1, theta = {theta}, position = [-2, 2.5], \
             velocity = {velocity}, acceleration = 5, torque = {torque} }}"
        )
    };
    let joints: Vec<String> = kinds.into_iter().zip(torques).map(joint).collect();
    let text = format!(
        "name = \"a\"\nconvention = \"{convention}\"\ngravity = [{gravity}]\njoint = [\n{}\n]",
        joints.join(",\n")
    );
    let model = Model::derive(Arm::parse(&text, "arm.toml").unwrap()).unwrap();
    let links = [(4.0, 0.1), (3.0, 0.1), (2.0, 0.08), (0.5, 0.05), (0.05, 0.02)];
    let value = |p: &SetParameter| {
        let Parameter { link, kind } = p.terms[0].0;
        let (mass, size) = links[link];
        let centre = Vector3::new(0.5, -0.3, 0.8) * size;
        let shift = centre.cross_matrix();
        let tensor = Matrix3::from_diagonal(&Vector3::new(1.0, 1.2, 0.9)) * mass * size * size;
        let body = parameters_of_body(mass, &(centre * mass), &(tensor - shift * shift * mass));
        body[ParameterKind::ALL.iter().position(|k| *k == kind).unwrap()]
    };
    let parameters = &model.set(SetKind::Full).unwrap().parameters;
    let full: Vec<f64> = parameters.iter().map(value).collect();
    let named = Values::named(parameters.iter().map(|p| p.name.as_str()).zip(full.iter().copied()), "values");
    let minimal = named.of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
    (model, full, minimal)
}

#[test]
fn no_acceleration_of_an_arm_without_rotors_is_further_off_than_its_bound() {
    for convention in ["standard", "modified"] {
        let (model, full, minimal) = light_wrist(convention, ["\"pi/2\"", "0"]);
        let without = Bounder::new(&model, Some(&minimal));
        let bounder = Bounder::new(&model, Some(&minimal)).with_links(Some(&full));
        for function in model.functions(SetKind::Minimal).filter(|f| divisor(*f) == Some(Divisor::Pivots)) {
            let built = model.function(function, SetKind::Minimal).unwrap();
            assert!(without.bounds(&built).is_err(), "boxes prove {function}: the wrist is not light enough");
            let bounds = bounder.bounds(&built).unwrap_or_else(|e| panic!("{function}: {e}"));
            assert!(bounds.single.iter().all(|x| x.is_finite()), "{function} has no bound in f32");
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
            let state = State::draw(model.arm(), &values, &mut rng);
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

/// Entries of B⁻¹, L and D are in their ranges at poses of the whole range and of its corners.
#[test]
fn ranges_of_factors_hold_every_pose() {
    let (model, values) = lwa4p();
    let built = model.function(Function::MassMatrix, SetKind::Minimal).unwrap();
    let mass = MassMatrix::new(&model, &built, &Limits::new(model.arm(), Some(&values))).unwrap();
    ranges_hold_every_pose((&model, &built), &values, &mass.factors(0.5, 100_000).unwrap(), 0.3);
    for convention in ["standard", "modified"] {
        let (model, full, values) = light_wrist(convention, ["0.7", "0.3"]);
        let built = model.function(Function::MassMatrix, SetKind::Minimal).unwrap();
        let mass = MassMatrix::new(&model, &built, &Limits::new(model.arm(), Some(&values))).unwrap();
        let set = model.set(SetKind::Full).unwrap();
        let factors = bodies::factors(model.arm(), set, &full, &mass).unwrap();
        ranges_hold_every_pose((&model, &built), &values, &factors, 0.1);
    }
}

/// `near` says how near to its end the range of the first entry of B⁻¹ must be reached: ranges that hold
/// everything would say nothing.
fn ranges_hold_every_pose(
    (model, built): (&Model, &FunctionGraph),
    values: &[f64],
    factors: &Factors,
    near: f64,
) {
    let n = factors.n;
    let mut matrices = Emitted::<f64>::new(model, built);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut reached = 0.0f64;
    for _ in 0..5_000 {
        let state = State::draw(model.arm(), values, &mut rng);
        let flat = matrices.run(&state);
        // Where there are fewer joints, the rest is the identity.
        let entry =
            |i: usize, j: usize| if i.max(j) < n { flat[i * n + j] } else { f64::from(u8::from(i == j)) };
        let b = SMatrix::<f64, 6, 6>::from_fn(entry);
        let inverse = inverse_from(&b, 0);
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
    let task = of(Some(&values), Function::TaskInertia).unwrap_err();
    assert!(task.contains("rank six") && task.contains("at q = ["), "{task}");
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

fn compare_at_length(wanted: impl Fn(Function) -> bool) {
    let (model, values) = lwa4p();
    println!(
        "function, time, bound in f32; then of f32 and of f64 the bound / the worst error that was seen: of \
        the"
    );
    println!("worst entry, and the largest of all entries");
    let bounder = Bounder::new(&model, Some(&values));
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
        let seen = Seen::of(&model, &values, (&built, found), 1_000_000, 20_000);
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
