//! What emitted operations do at random states and at corners of the limits, against their bounds.

use super::super::{Bounds, Where, divisor, program};
use super::twice::Twice;
use crate::arm::{Arm, Joint};
use crate::consistency::parameters_of_body;
use crate::dynamics::function::Argument;
use crate::dynamics::{Function, FunctionGraph};
use crate::emit::emitted_sin_cos;
use crate::exact::rational::to_f64;
use crate::graph::evaluate::{Field, evaluate};
use crate::graph::{Contraction, Expr, Input, JointSum, Node};
use crate::model::Model;
use crate::parameters::SetKind;
use chacha20::ChaCha8Rng;
use nalgebra::{Matrix3, RealField, Vector3, convert};
use rand::{RngExt, SeedableRng};

/// What a function is given: one number for each of an argument's.
pub(super) struct State(Vec<(Argument, Vec<f64>)>);

impl State {
    /// Numbers of `f32` within the limits: half of the states have velocities, accelerations and torques at
    /// their limits. A payload is ten numbers within ±1, or one that a body can have.
    pub(super) fn draw(arm: &Arm, parameters: &[f64], of_body: bool, rng: &mut ChaCha8Rng) -> State {
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
        let of = |limit: fn(&Joint) -> Option<f64>| -> Vec<f64> {
            joints.iter().map(|j| limit(j).unwrap()).collect()
        };
        within(Argument::Velocities, of(|j| j.velocity));
        within(Argument::ReferenceVelocities, of(|j| j.velocity));
        within(Argument::Accelerations, of(|j| j.acceleration));
        within(Argument::ReferenceAccelerations, of(|j| j.acceleration));
        within(Argument::Torques, of(|j| j.torque));
        within(Argument::Errors, vec![1.0; joints.len()]);
        within(Argument::Wrench, vec![1.0; 6]);
        within(Argument::PositionDirection, vec![1.0; joints.len()]);
        within(Argument::VelocityDirection, vec![1.0; joints.len()]);
        match of_body {
            true => all.push((Argument::Payload, payload(rng))),
            false => within(Argument::Payload, vec![1.0; 10]),
        }
        all.push((Argument::Parameters, parameters.to_vec()));
        State(all)
    }

    fn of(&self, argument: Argument, i: usize) -> f64 {
        self.0.iter().find(|(a, _)| *a == argument).unwrap().1[i]
    }

    /// An input other than a sine or a cosine.
    fn input(&self, input: Input) -> f64 {
        let (argument, i) = program::variable(input).unwrap();
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

/// A payload that a body can have, of some points: each number of `f32` within ±1.
fn payload(rng: &mut ChaCha8Rng) -> Vec<f64> {
    let (mut mass, mut moment, mut tensor) = (0.0, Vector3::zeros(), Matrix3::zeros());
    let most: f64 = rng.random_range(0.02..0.2);
    for _ in 0..5 {
        let (m, r) = (rng.random_range(0.01..most), Vector3::from_fn(|_, _| rng.random_range(-0.7..0.7)));
        mass += m;
        moment += r * m;
        tensor -= r.cross_matrix() * r.cross_matrix() * m;
    }
    parameters_of_body(mass, &moment, &tensor).into_iter().map(|x| f64::from(x as f32)).collect()
}

/// A function as emitted code computes it.
pub(super) struct Emitted<'a, T> {
    model: &'a Model,
    built: &'a FunctionGraph,
    needed: Vec<usize>,
    contraction: Contraction,
    /// The values of all nodes; those of constants are there from the first.
    values: Vec<T>,
}

impl<'a, T: RealField + Copy> Emitted<'a, T> {
    pub(super) fn new(model: &'a Model, built: &'a FunctionGraph) -> Self {
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

    pub(super) fn run(&mut self, state: &State) -> Vec<T> {
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
                Node::Sqrt(a) => of(a).sqrt(),
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

/// The worst of each output, in single and in double precision; each within its bound.
pub(super) struct Seen {
    pub(super) bounds: Bounds,
    pub(super) single: Vec<f64>,
    pub(super) double: Vec<f64>,
}

impl Seen {
    /// `exact` of the samples are evaluated with twice the digits too.
    pub(super) fn of(
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
        let inertia = model.function(Function::TaskInertia, SetKind::Minimal).ok();
        let mut inertia = inertia.as_ref().map(|inertia| Emitted::<f64>::new(model, inertia));
        for sample in 0..samples {
            let state = State::draw(model.arm(), &parameters, divisor(built.function).is_some(), &mut rng);
            if let Some(Where { largest_inertia, .. }) = &bounds.poses {
                let flat = inertia.as_mut().unwrap().run(&state);
                if largest_inertia.iter().enumerate().any(|(i, most)| flat[7 * i] > *most) {
                    continue;
                }
            }
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
    pub(super) fn ratios(bounds: &[f64], seen: &[f64]) -> Vec<f64> {
        bounds.iter().zip(seen).filter(|(_, seen)| **seen > 0.0).map(|(bound, seen)| bound / seen).collect()
    }
}

pub(super) fn most(all: &[f64]) -> f64 {
    all.iter().copied().fold(0.0, f64::max)
}
