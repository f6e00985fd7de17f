//! Passes over a graph, in order, each with the property that holds after it.

mod associate;
mod factor;
mod flat;
mod merge;

use crate::exact::constant::ConstantField;
use crate::graph::{Expr, Graph};

/// A pass: it transforms a graph and its outputs.
pub type Pass = fn(&Graph, &[Expr], &ConstantField) -> (Graph, Vec<Expr>);

/// The passes in order.
pub const PASSES: &[(&str, Pass)] = &[
    // AFTER THIS POINT: no two nodes are equal as functions of the inputs, up to sign, and none is zero.
    ("merge", merge::merge),
    // AFTER THIS POINT: no two terms occur together in two sums, and no two factors in two products.
    ("associate", associate::associate),
    // AFTER THIS POINT: no two terms of a sum that occur nowhere else share a factor.
    ("factor", factor::factor),
];

/// The passes that a form goes through before its cost is compared with that of others.
pub const COMPARED: usize = 1;

/// A graph with its outputs.
type Form = (Graph, Vec<Expr>);

/// The new form where it costs less: where nothing is saved the order of evaluation stays as it was.
fn cheaper(before: Form, after: Form) -> Form {
    let cost = |(graph, outputs): &Form| {
        let operations = graph.operations_when_prepared(outputs);
        operations.mul + operations.add
    };
    if cost(&after) < cost(&before) { after } else { before }
}

/// Runs passes one after another.
pub fn optimize(
    graph: Graph,
    outputs: Vec<Expr>,
    field: &ConstantField,
    passes: &[(&str, Pass)],
) -> (Graph, Vec<Expr>) {
    passes.iter().fold((graph, outputs), |(graph, outputs), (_, pass)| pass(&graph, &outputs, field))
}
