//! Which values the emitted code holds with the other sign.
//!
//! A difference costs the same in both directions, so every second neighbour in a vector of results can be
//! the negative of the computed value. LLVM otherwise joins neighbours into vectors of two and follows their
//! terms back through the function, where they lie scattered: the shuffles cost more than is saved, half of
//! the inverse dynamics' time again.

use crate::graph::{Expr, Graph, Node};

/// For each node whether minus its value is held, so that as many neighbours among the outputs as possible
/// differ.
pub(super) fn held(graph: &Graph, outputs: &[Expr], needed: &[usize]) -> Vec<bool> {
    let mut wishes = vec![false; graph.nodes().len()];
    let mut signs = assign(graph, needed, &wishes);
    let negated = |signs: &[bool], output: &Expr| output.is_negative() != signs[output.node()];
    let is_sum = |output: &Expr| matches!(graph.nodes()[output.node()], Node::Add(..));
    // What is computed first first: later results contain earlier ones.
    let mut order: Vec<usize> = (0..outputs.len()).filter(|k| is_sum(&outputs[*k])).collect();
    order.sort_by_key(|k| outputs[*k].node());
    for (done, k) in order.iter().enumerate() {
        let output = &outputs[*k];
        if negated(&signs, output) == (k % 2 == 1) {
            continue;
        }
        // The nearest difference whose other sign carries through to here and changes nothing that is done.
        for node in needed.iter().rev().filter(|n| **n <= output.node() && is_difference(graph, **n, &signs))
        {
            wishes[*node] ^= true;
            let other = assign(graph, needed, &wishes);
            let differs = |output: &Expr| negated(&other, output) != negated(&signs, output);
            if differs(output) && !order[..done].iter().any(|before| differs(&outputs[*before])) {
                signs = other;
                break;
            }
            wishes[*node] ^= true;
        }
    }
    signs
}

/// The signs of a sum's terms as they are held.
fn terms(a: Expr, b: Expr, signs: &[bool]) -> [bool; 2] {
    [signs[a.node()], signs[b.node()] != b.is_negative()]
}

fn is_difference(graph: &Graph, node: usize, signs: &[bool]) -> bool {
    matches!(graph.nodes()[node], Node::Add(a, b) if terms(a, b, signs)[0] != terms(a, b, signs)[1])
}

/// Signs that need no change of sign in between: a difference's is free, what else there is follows from its
/// operands. Without a wish they are those of the graph.
fn assign(graph: &Graph, needed: &[usize], wishes: &[bool]) -> Vec<bool> {
    let mut signs = vec![false; graph.nodes().len()];
    for node in needed {
        signs[*node] = match graph.nodes()[*node] {
            Node::Add(a, b) => match terms(a, b, &signs) {
                [first, second] if first == second => first,
                // A sum of which one term has turned turns with it.
                _ => wishes[*node] == b.is_negative(),
            },
            Node::Mul(a, b) | Node::Div(a, b) => signs[a.node()] != signs[b.node()],
            // A root has the sign that it has.
            _ => false,
        };
    }
    signs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::algebra::Algebra;
    use crate::graph::{Builder, Input};

    #[test]
    fn neighbours_differ_where_a_difference_allows_it() {
        let b = Builder::new();
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| b.input(Input::Velocity(i)));
        let difference = b.sub(&x, &y);
        let outputs = [
            b.sub(&z, &w),
            // Its sign is the difference's.
            b.add(&b.mul(&difference, &z), &b.mul(&difference, &w)),
            b.add(&b.mul(&x, &z), &y),
            // No difference, no choice.
            b.add(&x, &z),
        ];
        let graph = b.finish();
        let signs = held(&graph, &outputs, &graph.needed(&outputs));
        let negated = outputs.map(|e| e.is_negative() != signs[e.node()]);
        assert_eq!(negated, [false, true, false, false]);
        assert!(signs[difference.node()]);
    }
}
