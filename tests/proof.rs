//! Every function of every arm and set is proven against the Lagrangian, and a wrong one is not.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::base::SetKind;
use dyngen::exact::algebra::Algebra;
use dyngen::exact::constant::ConstantField;
use dyngen::graph::{Builder, Expr, Graph, Node};
use dyngen::optimize::{PASSES, Pass};
use dyngen::prove::prove;
use dyngen::{Error, Function, Model};
use powerball_workspace::{arm, arm_text, paper_arm_with_ratios, parse};

fn prove_all(name: &str, model: &Model) {
    for set in &model.sets().sets {
        for function in model.functions(set.kind) {
            model.function(function, set.kind).unwrap_or_else(|e| panic!("{name} {}: {e}", set.kind));
        }
    }
}

#[test]
fn every_function_of_every_set_is_proven() {
    for name in ["arm", "puma560", "ur5e", "panda", "stanford", "scara"] {
        prove_all(name, &Model::derive(arm(name)).unwrap());
    }
    prove_all("no rotors", &Model::derive(paper_arm_with_ratios([None; 6])).unwrap());
}

#[test]
fn rotors_on_prismatic_joints_and_in_modified_frames_are_proven() {
    for name in ["stanford", "panda", "scara"] {
        let text = arm_text(name).replace("[[joint]]", "[[joint]]\nrotor_ratio = 50");
        prove_all(name, &Model::derive(parse(&text)).unwrap());
    }
}

#[test]
fn general_angles_and_any_gravity_are_proven() {
    let text = arm_text("ur5e")
        .replacen("\"pi/2\"", "\"pi/3\"", 1)
        .replace("theta = \"0\"", "theta = 0.7")
        .replace("\"-pi/2\"", "0.3")
        .replacen("alpha = \"0\"", "alpha = \"3*pi/4\"", 1)
        .replace("gravity = [0, 0, -9.81]", "gravity = [1.5, -2, 9.5]");
    prove_all("general angles", &Model::derive(parse(&text)).unwrap());
    let text = arm_text("stanford").replace("\"-pi/2\"", "\"pi/5\"");
    prove_all("general angles, prismatic", &Model::derive(parse(&text)).unwrap());
}

/// Every length something: arms as they are built have few, and symmetries may leave a last link nothing but
/// its mass.
#[test]
fn arms_with_lengths_everywhere_are_proven() {
    for name in ["lwa4p_rotorless", "stanford", "puma560", "ur5e"] {
        let line = |line: &str| match line.split(" = ").next() {
            Some("a") => "a = 0.21".to_string(),
            Some("d") => "d = 0.13".to_string(),
            _ => line.to_string(),
        };
        let text: Vec<String> = arm_text(name).lines().map(line).collect();
        prove_all(name, &Model::derive(parse(&text.join("\n"))).unwrap());
    }
}

#[test]
fn published_sums_that_lose_a_parameter_are_refused() {
    let model = Model::derive(paper_arm_with_ratios([1, 1, 1, 1, 1, 100].map(Some))).unwrap();
    let error = model.function(Function::Gravity, SetKind::Published).unwrap_err();
    assert!(error.to_string().contains("Im6"), "{error}");
}

/// The set with the fewest parameters that has a function.
fn least_set(function: Function) -> SetKind {
    if function.needs_every_parameter() { SetKind::Full } else { SetKind::Minimal }
}

/// Every single result that is altered in any way is noticed: the proof is no formality.
#[test]
fn a_wrong_result_anywhere_is_noticed() {
    let model = Model::derive(arm("arm")).unwrap();
    for function in Function::ALL {
        let kind = least_set(function);
        let (set, built) = (model.set(kind).unwrap(), model.function(function, kind).unwrap());
        let check = |f: &dyngen::dynamics::FunctionGraph| {
            prove(model.arm(), model.symbols(), model.sets(), set, f, None)
        };
        assert!(check(&built).is_ok());
        for k in 0..built.outputs.len() {
            // A result that is 1 at every state, as a sum of squares, may be replaced by 1; then 0 is wrong.
            let altered = [Expr::ONE, Expr::ZERO].into_iter().filter(|e| *e != built.outputs[k]);
            let refused: Vec<_> = altered
                .filter_map(|e| {
                    let mut wrong = built.clone();
                    wrong.outputs[k] = e;
                    check(&wrong).err()
                })
                .collect();
            assert!(!refused.is_empty(), "{function}, entry {k}");
            for found in refused {
                assert_eq!(found.entry, (k / built.shape.1, k % built.shape.1), "{function}");
            }
        }
    }
}

/// A pass that goes wrong in one place: it turns one sum among many into a difference.
fn slip(graph: &Graph, outputs: &[Expr], _: &ConstantField) -> (Graph, Vec<Expr>) {
    let b = Builder::new();
    let needed = graph.needed(outputs);
    let sums: Vec<usize> =
        needed.iter().copied().filter(|n| matches!(graph.nodes()[*n], Node::Add(..))).collect();
    let slipped = sums[sums.len() / 2];
    let mut new = vec![Expr::ZERO; graph.nodes().len()];
    let signed = |new: &[Expr], e: Expr| if e.is_negative() { -new[e.node()] } else { new[e.node()] };
    for node in needed {
        new[node] = match graph.nodes()[node] {
            Node::Constant(index) => b.constant(graph.constant(index)),
            Node::Symbol(index, sine) => b.symbol(index as usize, sine),
            Node::Input(input) => b.input(input),
            Node::Add(x, y) if node == slipped => b.sub(&signed(&new, x), &signed(&new, y)),
            Node::Add(x, y) => b.add(&signed(&new, x), &signed(&new, y)),
            Node::Mul(x, y) => b.mul(&signed(&new, x), &signed(&new, y)),
            Node::Div(x, y) => b.div(signed(&new, x), signed(&new, y)),
            Node::Sqrt(x) => b.sqrt(signed(&new, x)),
        };
    }
    let outputs = outputs.iter().map(|e| signed(&new, *e)).collect();
    (b.finish(), outputs)
}

/// Whichever pass goes wrong, the generator refuses the function.
#[test]
fn a_pass_that_goes_wrong_is_refused() {
    let model = Model::derive(arm("arm")).unwrap();
    let with_sums: Vec<Function> = Function::ALL
        .into_iter()
        .filter(|f| model.function_after(*f, least_set(*f), &[]).unwrap().operations().add > 0)
        .collect();
    assert!(with_sums.len() > 20);
    for broken in 0..PASSES.len() {
        let mut passes: Vec<(&str, Pass)> = PASSES.to_vec();
        passes.insert(broken + 1, ("slip", slip));
        for function in &with_sums {
            let refused = model.function_after(*function, least_set(*function), &passes);
            let name = PASSES[broken].0;
            assert!(matches!(refused, Err(Error::Disagreement(_))), "{function} after a broken {name}");
        }
    }
}

/// Zero where a small term belongs is noticed as well: exact arithmetic has no tolerance.
#[test]
fn a_constant_that_is_slightly_off_is_noticed() {
    let model = Model::derive(arm("arm")).unwrap();
    let mut other = model.arm().clone();
    other.joints[3].d += dyngen::exact::rational::parse_rational("1e-30").unwrap();
    let set = model.set(SetKind::Full).unwrap();
    let built = Model::derive(other).unwrap().function(Function::Gravity, SetKind::Full).unwrap();
    assert!(prove(model.arm(), model.symbols(), model.sets(), set, &built, None).is_err());
}

/// Y·π = B·q̈ + C·q̇ + g as polynomials: the graphs themselves, whatever the Lagrangian says, at a random
/// point of the field.
#[test]
fn the_graphs_obey_the_equation_of_motion_in_the_ring() {
    use dyngen::exact::prime::{Draws, Fp};
    use dyngen::graph::{Input, evaluate};
    use std::collections::BTreeMap;
    for name in ["arm", "puma560", "panda", "stanford"] {
        let model = Model::derive(arm(name)).unwrap();
        for kind in [SetKind::Full, SetKind::Minimal, SetKind::Symbolic] {
            let mut draws = Draws::new(7);
            let mut drawn: BTreeMap<Input, Fp> = BTreeMap::new();
            let mut angles: Vec<(Fp, Fp)> = Vec::new();
            for i in 0..model.arm().dof() {
                let (s, c) = draws.element().circle_point();
                angles.push((s, c));
                drawn.insert(Input::Position(i), draws.element());
                drawn.extend([Input::Velocity(i), Input::Acceleration(i)].map(|x| (x, draws.element())));
            }
            let p = model.set(kind).unwrap().parameters.len();
            drawn.extend((0..p).map(|k| (Input::Parameter(k), draws.element())));
            let value = |function: Function| -> Vec<Fp> {
                let f = model.function(function, kind).unwrap();
                let symbol = |index, sine| model.sets().field.modular_symbol(index, sine);
                let input = |input| match input {
                    Input::Sin(sum) => evaluate::sine_and_cosine(sum, &|i| angles[i]).0,
                    Input::Cos(sum) => evaluate::sine_and_cosine(sum, &|i| angles[i]).1,
                    other => drawn[&other],
                };
                evaluate::evaluate(&f.graph, &f.outputs, input, symbol).unwrap()
            };
            let product = |matrix: &[Fp], of: fn(usize) -> Input, i: usize, width: usize| {
                (0..width).fold(Fp::ZERO, |sum, k| sum + matrix[i * width + k] * drawn[&of(k)])
            };
            let n = model.arm().dof();
            let (y, mass, coriolis) =
                (value(Function::Regressor), value(Function::MassMatrix), value(Function::CoriolisMatrix));
            let (gravity, torque) = (value(Function::Gravity), value(Function::InverseDynamics));
            for i in 0..n {
                let sum = product(&mass, Input::Acceleration, i, n)
                    + product(&coriolis, Input::Velocity, i, n)
                    + gravity[i];
                assert_eq!(product(&y, Input::Parameter, i, p), sum, "{name} {kind}");
                assert_eq!(torque[i], sum, "{name} {kind}");
            }
        }
    }
}
