//! A function's graph as statements, one for each node: the code of every language is printed from them.

use super::signs;
use crate::dynamics::function::{Argument, Size};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::rational;
use crate::graph::{Contraction, Expr, Graph, Input, Node, operands};
use crate::model::Model;

/// What a value is computed from: numbers, or values by their names.
pub(super) enum Value {
    /// A constant.
    Number(f64),
    /// a + b
    Sum(String, String),
    /// a − b
    Difference(String, String),
    /// −a − b
    NegativeSum(String, String),
    /// a·b
    Product(String, String),
    /// a/b
    Quotient(String, String),
    /// √a or √−a
    Root { of: String, negative: bool },
    /// ±a·b ± c, rounded once; whether the product and c are taken with minus.
    Fused { factors: [String; 2], addend: String, negative: [bool; 2] },
}

/// How the values of a graph are held.
pub(super) struct Form {
    /// The signs of [`signs::held`].
    signs: Vec<bool>,
    contraction: Contraction,
}

impl Form {
    /// That of a function.
    pub(super) fn of(built: &FunctionGraph, needed: &[usize]) -> Form {
        // Where it pays, by measurement.
        let signs = match built.function.size() == (Size::Joints, Size::Fixed(1)) {
            true => signs::held(&built.graph, &built.outputs, needed),
            false => vec![false; built.graph.nodes().len()],
        };
        Form { signs, contraction: built.contraction() }
    }

    /// Every value as it is in the graph.
    pub(super) fn plain(graph: &Graph) -> Form {
        Form { signs: vec![false; graph.nodes().len()], contraction: Contraction::none(graph) }
    }

    /// Whether a node has a statement.
    pub(super) fn is_computed(&self, graph: &Graph, node: usize) -> bool {
        !matches!(graph.nodes()[node], Node::Input(_)) && !self.contraction.is_within(node)
    }

    /// The nodes whose values the statement of a node reads.
    pub(super) fn reads(&self, graph: &Graph, node: usize) -> Vec<usize> {
        let of = |e: Expr| match self.contraction.product_in(node) == Some(e.node()) {
            true => operands(&graph.nodes()[e.node()]).map(Expr::node).collect(),
            false => vec![e.node()],
        };
        operands(&graph.nodes()[node]).flat_map(of).collect()
    }
}

/// The statement of a node; none for an input, which is named before, and for a product that is formed within
/// a sum.
pub(super) fn value(model: &Model, graph: &Graph, node: usize, form: &Form) -> Option<Value> {
    let Form { signs, contraction } = form;
    let name = |node: usize| value_name(graph, node);
    if !form.is_computed(graph, node) {
        return None;
    }
    Some(match graph.nodes()[node] {
        Node::Input(_) => return None,
        Node::Constant(index) => Value::Number(rational::to_f64(graph.constant(index))),
        Node::Symbol(index, sine) => {
            let (s, c) = model.symbols().angles[index as usize].sin_cos();
            Value::Number(if sine { s } else { c })
        }
        Node::Add(a, b) => {
            let (x, y) = (name(a.node()), name(b.node()));
            let [first, second] = [signs[a.node()], signs[b.node()] != b.is_negative()];
            let [first, second] = [first, second].map(|sign| sign != signs[node]);
            let product = contraction.product_in(node).map(|product| (product, graph.nodes()[product]));
            if let Some((product, Node::Mul(p, q))) = product {
                let factors = [name(p.node()), name(q.node())];
                return Some(match product == a.node() {
                    true => Value::Fused { factors, addend: y, negative: [first, second] },
                    false => Value::Fused { factors, addend: x, negative: [second, first] },
                });
            }
            match (first, second) {
                (false, false) => Value::Sum(x, y),
                (false, true) => Value::Difference(x, y),
                (true, false) => Value::Difference(y, x),
                (true, true) => Value::NegativeSum(x, y),
            }
        }
        Node::Mul(a, b) => Value::Product(name(a.node()), name(b.node())),
        Node::Div(a, b) => Value::Quotient(name(a.node()), name(b.node())),
        Node::Sqrt(a) => Value::Root { of: name(a.node()), negative: signs[a.node()] != a.is_negative() },
    })
}

/// The name of a node's value.
pub(super) fn value_name(graph: &Graph, node: usize) -> String {
    match graph.nodes()[node] {
        Node::Input(input) => input.to_string(),
        _ => format!("x{node}"),
    }
}

/// A number of the result, row by row: the name of a value, and whether minus it is returned.
pub(super) fn result(built: &FunctionGraph, form: &Form, entry: usize) -> (bool, String) {
    let e = built.outputs[entry];
    (e.is_negative() != form.signs[e.node()], value_name(&built.graph, e.node()))
}

/// Whether the result is a number for every arm: where it is a vector, one joint makes it a vector of one.
pub(super) fn is_number(built: &FunctionGraph) -> bool {
    matches!(built.function, Function::KineticEnergy | Function::PotentialEnergy)
}

/// Whether the result has rows and columns for every arm.
pub(super) fn is_matrix(built: &FunctionGraph) -> bool {
    let (rows, columns) = built.function.size();
    rows != Size::Fixed(1) && columns != Size::Fixed(1)
}

/// The inputs that an argument brings.
pub(super) fn input_of(argument: Argument, i: usize) -> Input {
    match argument {
        Argument::Positions => Input::Position(i),
        Argument::Velocities => Input::Velocity(i),
        Argument::Accelerations => Input::Acceleration(i),
        Argument::ReferenceVelocities => Input::ReferenceVelocity(i),
        Argument::ReferenceAccelerations => Input::ReferenceAcceleration(i),
        Argument::Torques => Input::Torque(i),
        Argument::Errors => Input::Error(i),
        Argument::Wrench => Input::Wrench(i),
        Argument::Payload => Input::Payload(i),
        Argument::PositionDirection => Input::PositionDirection(i),
        Argument::VelocityDirection => Input::VelocityDirection(i),
        Argument::Parameters => Input::Prepared(i),
    }
}
