//! Building expressions: each once, folded when it is built.

use super::{Expr, Graph, Input, Node};
use crate::exact::algebra::{Algebra, Inverses, Roots};
use crate::exact::rational::{self, Rational};
use num_traits::{One, Signed, Zero};
use rustc_hash::FxHashMap;
use std::cell::RefCell;

/// Builds a [`Graph`]; as an [`Algebra`] it turns any formula into expressions.
#[derive(Debug)]
pub struct Builder {
    graph: RefCell<Graph>,
}

impl Default for Builder {
    fn default() -> Self {
        Self::new()
    }
}

impl Builder {
    /// An empty graph: it holds 0 and 1.
    pub fn new() -> Self {
        let mut graph = Graph {
            nodes: Vec::new(),
            constants: Vec::new(),
            index: FxHashMap::default(),
            constant_index: FxHashMap::default(),
        };
        for value in [Rational::zero(), Rational::one()] {
            graph.intern_constant(value);
        }
        Builder { graph: RefCell::new(graph) }
    }

    /// The graph as built so far.
    pub fn finish(self) -> Graph {
        self.graph.into_inner()
    }

    /// A copy of the graph as built so far.
    pub fn snapshot(&self) -> Graph {
        self.graph.borrow().clone()
    }

    /// An input.
    pub fn input(&self, input: Input) -> Expr {
        self.graph.borrow_mut().intern(Node::Input(input))
    }

    /// Sine or cosine of an angle symbol.
    pub fn symbol(&self, index: usize, sine: bool) -> Expr {
        self.graph.borrow_mut().intern(Node::Symbol(index as u32, sine))
    }

    /// An exact constant.
    pub fn constant(&self, value: &Rational) -> Expr {
        let expr = self.graph.borrow_mut().intern_constant(value.abs());
        if value.is_negative() { -expr } else { expr }
    }

    /// a/b
    pub fn div(&self, a: Expr, b: Expr) -> Expr {
        if a == Expr::ZERO || b == Expr::ONE {
            return a;
        }
        let negative = a.is_negative() != b.is_negative();
        let node = Node::Div(a.positive(), b.positive());
        let quotient = self.graph.borrow_mut().intern(node);
        if negative { -quotient } else { quotient }
    }

    /// √a
    pub fn sqrt(&self, a: Expr) -> Expr {
        self.graph.borrow_mut().intern(Node::Sqrt(a))
    }

    /// A node of another graph, whose operands have been copied.
    pub fn copy_node(&self, graph: &Graph, node: usize, copied: &[Expr]) -> Expr {
        self.copy_node_with(graph, node, |e| copied[e.node()])
    }

    /// A node of another graph; `copied` gives the copy of an operand's node.
    pub fn copy_node_with(&self, graph: &Graph, node: usize, copied: impl Fn(Expr) -> Expr) -> Expr {
        let of = |e: Expr| if e.is_negative() { -copied(e) } else { copied(e) };
        match graph.nodes()[node] {
            Node::Constant(index) => self.constant(graph.constant(index)),
            Node::Symbol(index, sine) => self.symbol(index as usize, sine),
            Node::Input(input) => self.input(input),
            Node::Add(x, y) => self.add(&of(x), &of(y)),
            Node::Mul(x, y) => self.mul(&of(x), &of(y)),
            Node::Div(x, y) => self.div(of(x), of(y)),
            Node::Sqrt(x) => self.sqrt(of(x)),
        }
    }

    /// Expressions with others in place of some inputs.
    pub fn replaced(&self, outputs: &[Expr], by: impl Fn(Input) -> Option<Expr>) -> Vec<Expr> {
        let graph = self.snapshot();
        let mut copied = vec![Expr::ZERO; graph.nodes().len()];
        for node in graph.needed(outputs) {
            let other = match graph.nodes()[node] {
                Node::Input(input) => by(input),
                _ => None,
            };
            copied[node] = other.unwrap_or_else(|| self.copy_node(&graph, node, &copied));
        }
        outputs.iter().map(|e| if e.is_negative() { -copied[e.node()] } else { copied[e.node()] }).collect()
    }

    fn value_of(&self, a: Expr) -> Option<Rational> {
        let graph = self.graph.borrow();
        let Node::Constant(index) = graph.nodes[a.node()] else { return None };
        let value = graph.constants[index as usize].clone();
        Some(if a.is_negative() { -value } else { value })
    }
}

impl Graph {
    fn intern(&mut self, node: Node) -> Expr {
        if let Some(found) = self.index.get(&node) {
            return Expr::new(*found as usize, false);
        }
        self.nodes.push(node);
        let id = (self.nodes.len() - 1) as u32;
        self.index.insert(node, id);
        Expr::new(id as usize, false)
    }

    fn intern_constant(&mut self, value: Rational) -> Expr {
        let index = match self.constant_index.get(&value) {
            Some(found) => *found,
            None => {
                self.constants.push(value.clone());
                let id = (self.constants.len() - 1) as u32;
                self.constant_index.insert(value, id);
                id
            }
        };
        self.intern(Node::Constant(index))
    }
}

impl Algebra for Builder {
    type Value = Expr;

    fn integer(&self, value: i64) -> Expr {
        self.constant(&rational::integer(value))
    }

    fn is_zero(&self, a: &Expr) -> bool {
        *a == Expr::ZERO
    }

    fn add(&self, a: &Expr, b: &Expr) -> Expr {
        if *a == Expr::ZERO {
            return *b;
        }
        if *b == Expr::ZERO {
            return *a;
        }
        if *a == -*b {
            return Expr::ZERO;
        }
        if let (Some(x), Some(y)) = (self.value_of(*a), self.value_of(*b)) {
            return self.constant(&(x + y));
        }
        // The older operand first and without sign: a + b, b + a, −a − b and −(a + b) are one node.
        let (first, second) = if a.node() <= b.node() { (*a, *b) } else { (*b, *a) };
        let negative = first.is_negative();
        let node = Node::Add(first.positive(), if negative { -second } else { second });
        let sum = self.graph.borrow_mut().intern(node);
        if negative { -sum } else { sum }
    }

    fn neg(&self, a: &Expr) -> Expr {
        -*a
    }

    fn mul(&self, a: &Expr, b: &Expr) -> Expr {
        if *a == Expr::ZERO || *b == Expr::ZERO {
            return Expr::ZERO;
        }
        let negative = a.is_negative() != b.is_negative();
        let sign = |e: Expr| if negative { -e } else { e };
        let (a, b) = (a.positive(), b.positive());
        if a == Expr::ONE {
            return sign(b);
        }
        if b == Expr::ONE {
            return sign(a);
        }
        let (first, second) = if a.node() <= b.node() { (a, b) } else { (b, a) };
        let (x, y) = (self.value_of(first), self.value_of(second));
        if let (Some(x), Some(y)) = (&x, &y) {
            return sign(self.constant(&(x * y)));
        }
        let node = Node::Mul(first, second);
        let product = self.graph.borrow_mut().intern(node);
        sign(product)
    }
}

impl Inverses for Builder {
    fn inverse(&self, a: &Expr) -> Option<Expr> {
        Some(self.div(Expr::ONE, *a))
    }
}

impl Roots for Builder {
    fn root(&self, a: &Expr) -> Option<Expr> {
        Some(self.sqrt(*a))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_expressions_are_one_node_whatever_their_sign_and_order() {
        let b = Builder::new();
        let (x, y) = (b.input(Input::Velocity(0)), b.input(Input::Velocity(1)));
        let sum = b.add(&x, &y);
        assert_eq!(b.add(&y, &x), sum);
        assert_eq!(b.add(&-x, &-y), -sum);
        assert_eq!(b.sub(&x, &y), -b.sub(&y, &x));
        assert_eq!(b.mul(&-x, &y), -b.mul(&y, &x));
        assert_eq!(b.sub(&x, &x), Expr::ZERO);
        assert_eq!(b.mul(&x, &b.integer(-1)), -x);
        assert_eq!(b.add(&b.integer(2), &b.integer(-2)), Expr::ZERO);
        assert_eq!(b.div(x, Expr::ONE), x);
        assert_eq!(b.div(-x, y), -b.div(x, y));
    }
}
