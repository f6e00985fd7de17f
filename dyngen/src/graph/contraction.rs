//! Which sums take a product into their own operation: a·b + c, rounded once (a fused multiply-add, IEEE 754 §5.4.1).

use super::{Expr, Graph, Node, operands};

/// The products that are formed within sums. Code that is printed, and bounds of its rounding, read it from here.
///
/// It depends on the order of the nodes that hold the state and on their depth alone, so it is the same for a function
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

    /// Every product that is a term of one sum and is needed nowhere else. Of two in one sum it is the one that is known
    /// later: its sum need not wait for the rounded product.
    pub fn of(graph: &Graph, outputs: &[Expr]) -> Contraction {
        let mut contraction = Contraction::none(graph);
        let (needed, holds) = (graph.needed(outputs), graph.holds());
        let mut uses = vec![0usize; graph.nodes().len()];
        outputs.iter().for_each(|e| uses[e.node()] += 1);
        for node in &needed {
            operands(&graph.nodes()[*node]).for_each(|e| uses[e.node()] += 1);
        }
        let mut depth = vec![0usize; graph.nodes().len()];
        for node in needed {
            if !holds[node].state {
                continue;
            }
            let of = |e: Expr| depth[e.node()];
            depth[node] = match graph.nodes()[node] {
                Node::Add(a, b) | Node::Mul(a, b) | Node::Div(a, b) => 1 + of(a).max(of(b)),
                _ => 0,
            };
            let Node::Add(a, b) = graph.nodes()[node] else { continue };
            let is_free =
                |k: &usize| matches!(graph.nodes()[*k], Node::Mul(..)) && holds[*k].state && uses[*k] == 1;
            let products = [a.node(), b.node()].into_iter().filter(is_free);
            if let Some(product) = products.min_by_key(|k| (std::cmp::Reverse(depth[*k]), *k)) {
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
