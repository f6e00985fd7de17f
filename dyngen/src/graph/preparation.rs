//! The values of functions that depend on the parameters alone: computed once, not with every state.

use super::{Builder, Expr, Graph, Input, Operations, operands};

/// The values that several functions need of the parameters alone, each of them once.
#[derive(Debug, Default)]
pub struct Preparation {
    builder: Builder,
    values: Vec<Expr>,
}

impl Preparation {
    /// Removes the values that depend on parameters alone from a graph: the rest reads them as
    /// [`Input::Prepared`].
    pub fn take_out(&mut self, graph: &Graph, outputs: &[Expr]) -> (Graph, Vec<Expr>) {
        let holds = graph.holds();
        let prepared = |node: usize| holds[node].parameters && !holds[node].state;
        let rest = Builder::new();
        let nodes = graph.nodes().len();
        let (mut copied, mut left) = (vec![Expr::ZERO; nodes], vec![None; nodes]);
        for node in graph.needed(outputs) {
            if !holds[node].state {
                copied[node] = self.builder.copy_node(graph, node, &copied);
            }
            if !prepared(node) {
                for operand in operands(&graph.nodes()[node]) {
                    left[operand.node()].get_or_insert_with(|| self.read(&rest, copied[operand.node()]));
                }
                let operand = |e: Expr| left[e.node()].unwrap_or(Expr::ZERO);
                left[node] = Some(rest.copy_node_with(graph, node, operand));
            }
        }
        let output = |e: &Expr| {
            let value = left[e.node()].unwrap_or_else(|| self.read(&rest, copied[e.node()]));
            if e.is_negative() { -value } else { value }
        };
        let outputs = outputs.iter().map(output).collect();
        (rest.finish(), outputs)
    }

    /// A prepared value as an input of the rest.
    fn read(&mut self, rest: &Builder, value: Expr) -> Expr {
        let found = self.values.iter().position(|v| *v == value.positive());
        let index = found.unwrap_or_else(|| {
            self.values.push(value.positive());
            self.values.len() - 1
        });
        let input = rest.input(Input::Prepared(index));
        if value.is_negative() { -input } else { input }
    }

    /// The values as expressions of their graph.
    pub fn values(&self) -> &[Expr] {
        &self.values
    }

    /// The graph of the values.
    pub fn graph(&self) -> Graph {
        self.builder.snapshot()
    }

    /// The operations of the preparation.
    pub fn operations(&self) -> Operations {
        self.graph().operations(&self.values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::algebra::Algebra;

    #[test]
    fn what_two_functions_need_of_the_parameters_is_prepared_once() {
        let b = Builder::new();
        let [p, r] = [0, 1].map(|i| b.input(Input::Parameter(i)));
        let [x, y] = [0, 1].map(|i| b.input(Input::Velocity(i)));
        let sum = b.add(&p, &b.mul(&b.integer(2), &r));
        let one = b.mul(&sum, &x);
        let other = b.add(&b.mul(&-sum, &y), &b.mul(&p, &x));
        let graph = b.finish();
        let mut preparation = Preparation::default();
        let (first, first_out) = preparation.take_out(&graph, &[one, -p]);
        let (second, second_out) = preparation.take_out(&graph, &[other]);
        assert_eq!(preparation.values().len(), 2);
        let count = |o: Operations| (o.mul, o.add);
        assert_eq!(count(preparation.operations()), (1, 1));
        assert_eq!(count(first.operations(&first_out)), (1, 0));
        assert_eq!(count(second.operations(&second_out)), (2, 1));
        assert!(first_out[1].is_negative());
    }
}
