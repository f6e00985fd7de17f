//! Which sums take a product into their own operation: a·b + c, rounded once (a fused multiply-add, IEEE 754
//! §5.4.1).

use super::{Expr, Graph, Holds, Node, operands};
use std::cmp::Reverse;

/// Cycles after which a result is there, of the processor where sums are fastest next to the others (Zen 5).
const FUSED: usize = 4;
const PRODUCT: usize = 3;
const SUM: usize = 2;
const QUOTIENT: usize = 13;
const ROOT: usize = 21;

/// The products that are formed within sums. Code that is printed, and bounds of its rounding, read it from
/// here.
///
/// It depends on the nodes that hold the state alone and on their order, so it is the same for a function
/// before and after what depends on the parameters alone is taken out; of that nothing is contracted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contraction {
    /// Of each node that is a sum, the product that it takes in.
    product: Vec<Option<usize>>,
    /// Whether a node is such a product: it has no value of its own.
    within: Vec<bool>,
}

impl Contraction {
    /// No product is formed within a sum.
    pub fn none(graph: &Graph) -> Contraction {
        let nodes = graph.nodes().len();
        Contraction { product: vec![None; nodes], within: vec![false; nodes] }
    }

    /// Every product that is a term of one sum and is needed nowhere else, where that lets no result wait
    /// longer: a sum that takes a product in comes two cycles later after its other term than a plain one. Of
    /// two products in a sum it is the one that is there later, of two at once the one that is formed first.
    pub fn of(graph: &Graph, outputs: &[Expr]) -> Contraction {
        let mut contraction = Contraction::none(graph);
        let needed = graph.needed(outputs);
        let Times { cycles, latest, uses } = Times::of(graph, outputs, &needed);
        let mut ready = vec![0usize; graph.nodes().len()];
        let is_free =
            |k: &usize| matches!(graph.nodes()[*k], Node::Mul(..)) && cycles[*k] > 0 && uses[*k] == 1;
        for node in needed {
            ready[node] = cycles[node] + after(graph, node, &ready);
            let Node::Add(a, b) = graph.nodes()[node] else { continue };
            let terms = [a.node(), b.node()];
            let products = terms.into_iter().filter(is_free);
            let Some(product) = products.min_by_key(|k| (Reverse(ready[*k]), *k)) else { continue };
            let other = if terms[0] == product { terms[1] } else { terms[0] };
            let at = FUSED + ready[other].max(after(graph, product, &ready));
            if at <= latest[node] {
                ready[node] = at;
                contraction.product[node] = Some(product);
                contraction.within[product] = true;
            }
        }
        contraction
    }

    /// The product that a sum takes in.
    pub fn product_in(&self, sum: usize) -> Option<usize> {
        self.product[sum]
    }

    /// Whether a product is formed within a sum, so that it is not rounded.
    pub fn is_within(&self, product: usize) -> bool {
        self.within[product]
    }

    /// How many sums take a product in.
    pub fn count(&self) -> usize {
        self.within.iter().filter(|within| **within).count()
    }
}

/// What is known of every node before anything is contracted.
struct Times {
    /// How long it takes; nothing without the state.
    cycles: Vec<usize>,
    /// When it must be there so that no result comes later than the last one would.
    latest: Vec<usize>,
    uses: Vec<usize>,
}

impl Times {
    fn of(graph: &Graph, outputs: &[Expr], needed: &[usize]) -> Times {
        let nodes = graph.nodes();
        let cycles = |(node, holds): (&Node, Holds)| match node {
            _ if !holds.state => 0,
            Node::Add(..) => SUM,
            Node::Mul(..) => PRODUCT,
            Node::Div(..) => QUOTIENT,
            Node::Sqrt(_) => ROOT,
            _ => 0,
        };
        let cycles: Vec<usize> = nodes.iter().zip(graph.holds()).map(cycles).collect();
        let (mut ready, mut uses) = (vec![0; nodes.len()], vec![0; nodes.len()]);
        for node in needed {
            ready[*node] = cycles[*node] + after(graph, *node, &ready);
            operands(&nodes[*node]).for_each(|e| uses[e.node()] += 1);
        }
        outputs.iter().for_each(|e| uses[e.node()] += 1);
        let last = outputs.iter().map(|e| ready[e.node()]).max().unwrap_or(0);
        let mut latest = vec![last; nodes.len()];
        for node in needed.iter().rev() {
            for operand in operands(&nodes[*node]).map(Expr::node) {
                latest[operand] = latest[operand].min(latest[*node] - cycles[*node]);
            }
        }
        Times { cycles, latest, uses }
    }
}

/// When the operands of a node are there.
fn after(graph: &Graph, node: usize, ready: &[usize]) -> usize {
    operands(&graph.nodes()[node]).map(|e| ready[e.node()]).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::algebra::Algebra;
    use crate::graph::{Builder, Input, Preparation};

    #[test]
    fn products_of_one_sum_alone_are_taken_in_the_later_one_first() {
        let b = Builder::new();
        let [x, y, z] = [0, 1, 2].map(|i| b.input(Input::Velocity(i)));
        let (early, shared) = (b.mul(&x, &y), b.mul(&y, &z));
        let late = b.mul(&b.add(&x, &z), &y);
        let sum = b.sub(&early, &late);
        let outputs = [sum, b.add(&shared, &x), b.mul(&shared, &z)];
        let contraction = Contraction::of(&b.finish(), &outputs);
        assert_eq!(contraction.product_in(sum.node()), Some(late.node()));
        assert!(!contraction.is_within(early.node()) && !contraction.is_within(shared.node()));
        assert_eq!(contraction.count(), 1);
    }

    /// x·y is there when the last term of the longest sum is waited for: within it, that sum would come
    /// later.
    #[test]
    fn no_result_waits_longer() {
        let b = Builder::new();
        let [x, y, z] = [0, 1, 2].map(|i| b.input(Input::Velocity(i)));
        let long = (0..4).fold(b.add(&x, &y), |sum, k| b.add(&b.add(&sum, &sum), &b.integer(k + 2)));
        let late = b.add(&long, &b.mul(&x, &y));
        let other = b.add(&z, &b.mul(&y, &z));
        let graph = b.finish();
        let contraction = Contraction::of(&graph, &[late, other]);
        assert_eq!((contraction.product_in(late.node()), contraction.count()), (None, 1));
        assert!(contraction.product_in(other.node()).is_some());
    }

    #[test]
    fn it_is_the_same_where_parameters_are_prepared() {
        let b = Builder::new();
        let [p, r] = [0, 1].map(|i| b.input(Input::Parameter(i)));
        let [x, y] = [0, 1].map(|i| b.input(Input::Velocity(i)));
        // A product of parameters, in a sum with the state and in a sum of its own.
        let of_parameters = b.mul(&p, &r);
        let outputs = [b.add(&of_parameters, &b.mul(&x, &y)), b.mul(&b.add(&b.mul(&p, &p), &r), &x)];
        let graph = b.finish();
        let whole = Contraction::of(&graph, &outputs);
        let (rest, left) = Preparation::default().take_out(&graph, &outputs);
        assert_eq!((whole.count(), Contraction::of(&rest, &left).count()), (1, 1));
        assert!(!whole.is_within(of_parameters.node()));
    }
}
