//! A function's graph as statements, one for each node: the code of every language is printed from them.

use super::signs;
use crate::dynamics::function::{Argument, Size};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::rational;
use crate::graph::{Graph, Input, Node};
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
}

/// The statement of a node; none for an input, which is named before. `signs` are those of [`signs::held`].
pub(super) fn value(model: &Model, graph: &Graph, node: usize, signs: &[bool]) -> Option<Value> {
    let name = |node: usize| value_name(graph, node);
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
            match (first != signs[node], second != signs[node]) {
                (false, false) => Value::Sum(x, y),
                (false, true) => Value::Difference(x, y),
                (true, false) => Value::Difference(y, x),
                (true, true) => Value::NegativeSum(x, y),
            }
        }
        Node::Mul(a, b) => Value::Product(name(a.node()), name(b.node())),
        Node::Div(a, b) => Value::Quotient(name(a.node()), name(b.node())),
    })
}

/// The name of a node's value.
pub(super) fn value_name(graph: &Graph, node: usize) -> String {
    match graph.nodes()[node] {
        Node::Input(input) => input.to_string(),
        _ => format!("x{node}"),
    }
}

/// The signs with which a function's values are held.
pub(super) fn signs_of(built: &FunctionGraph, needed: &[usize]) -> Vec<bool> {
    // Where it pays, by measurement.
    if built.function.size() == (Size::Joints, Size::Fixed(1)) {
        signs::held(&built.graph, &built.outputs, needed)
    } else {
        vec![false; built.graph.nodes().len()]
    }
}

/// A number of the result, row by row: the name of a value, and whether minus it is returned.
pub(super) fn result(built: &FunctionGraph, signs: &[bool], entry: usize) -> (bool, String) {
    let e = built.outputs[entry];
    (e.is_negative() != signs[e.node()], value_name(&built.graph, e.node()))
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
