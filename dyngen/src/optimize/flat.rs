//! Sums and products as flat lists of their parts.

use crate::graph::{Expr, Graph, Node, operands};
use std::collections::BTreeMap;

/// The kind of expression that is flattened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Sum,
    Product,
}

/// A leaf of a sum or product: a node of the graph, with its sign.
pub(super) type Leaf = (usize, bool);

/// The sums or products of a graph that depend on the state.
pub(super) struct Flat {
    /// The leaves of each that is not part of a larger one.
    pub(super) leaves: BTreeMap<usize, Vec<Leaf>>,
    /// Whether a node is part of a larger one: that is its only use.
    pub(super) is_part: Vec<bool>,
}

impl Flat {
    pub(super) fn of(graph: &Graph, outputs: &[Expr], kind: Kind) -> Flat {
        let needed = graph.needed(outputs);
        let holds = graph.holds();
        let nodes = graph.nodes();
        let of_kind = |node: usize| {
            holds[node].state
                && match nodes[node] {
                    Node::Add(..) => kind == Kind::Sum,
                    Node::Mul(..) => kind == Kind::Product,
                    _ => false,
                }
        };
        let uses = uses(graph, outputs);
        let mut used_in_kind = vec![false; nodes.len()];
        for node in needed.iter().filter(|node| of_kind(**node)) {
            operands(&nodes[*node]).for_each(|operand| used_in_kind[operand.node()] = true);
        }
        let is_part: Vec<bool> =
            (0..nodes.len()).map(|node| of_kind(node) && uses[node] == 1 && used_in_kind[node]).collect();
        let mut leaves: BTreeMap<usize, Vec<Leaf>> = BTreeMap::new();
        for node in needed.iter().copied().filter(|n| of_kind(*n)) {
            let mut own: Vec<Leaf> = Vec::new();
            for operand in operands(&nodes[node]) {
                match leaves.get(&operand.node()).filter(|_| is_part[operand.node()]) {
                    Some(parts) => own.extend(parts.iter().map(|(n, s)| (*n, *s != operand.is_negative()))),
                    None => own.push((operand.node(), operand.is_negative())),
                }
            }
            leaves.insert(node, own);
        }
        leaves.retain(|node, _| !is_part[*node]);
        Flat { leaves, is_part }
    }
}

/// How often each node is an operand or an output.
pub(super) fn uses(graph: &Graph, outputs: &[Expr]) -> Vec<usize> {
    let mut uses = vec![0usize; graph.nodes().len()];
    outputs.iter().for_each(|e| uses[e.node()] += 1);
    for node in graph.needed(outputs) {
        operands(&graph.nodes()[node]).for_each(|operand| uses[operand.node()] += 1);
    }
    uses
}
