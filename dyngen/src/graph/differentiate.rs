//! Derivatives of expressions, node by node.

use super::{Builder, Expr, Graph, Input, Node};
use crate::exact::algebra::Algebra;
use std::collections::HashMap;

/// What is differentiated by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// q of a joint: its sine, cosine or position.
    Position(usize),
    /// q̇ of a joint.
    Velocity(usize),
}

/// The derivative of each output in one direction.
pub fn derivative(b: &Builder, outputs: &[Expr], direction: Direction) -> Vec<Expr> {
    let graph = b.snapshot();
    let mut rates: HashMap<usize, Expr> = HashMap::new();
    for node in graph.needed(outputs) {
        let rate = rate(b, &graph, &rates, node, direction);
        rates.insert(node, rate);
    }
    outputs.iter().map(|e| signed(&rates, *e)).collect()
}

fn signed(rates: &HashMap<usize, Expr>, e: Expr) -> Expr {
    let rate = rates.get(&e.node()).copied().unwrap_or(Expr::ZERO);
    if e.is_negative() { -rate } else { rate }
}

fn rate(b: &Builder, graph: &Graph, rates: &HashMap<usize, Expr>, node: usize, direction: Direction) -> Expr {
    let of = |e: Expr| signed(rates, e);
    match graph.nodes()[node] {
        Node::Input(input) => match (input, direction) {
            (Input::Sin(sum), Direction::Position(j)) => times_sign(b.input(Input::Cos(sum)), sum.sign(j)),
            (Input::Cos(sum), Direction::Position(j)) => times_sign(-b.input(Input::Sin(sum)), sum.sign(j)),
            (Input::Position(i), Direction::Position(j)) | (Input::Velocity(i), Direction::Velocity(j))
                if i == j =>
            {
                Expr::ONE
            }
            _ => Expr::ZERO,
        },
        Node::Constant(_) | Node::Symbol(..) => Expr::ZERO,
        Node::Add(x, y) => b.add(&of(x), &of(y)),
        Node::Mul(x, y) => b.add(&b.mul(&of(x), &y), &b.mul(&x, &of(y))),
        // (x/y)' = (x' − (x/y) y')/y
        Node::Div(x, y) => {
            let quotient = b.div(x, y);
            b.div(b.sub(&of(x), &b.mul(&quotient, &of(y))), y)
        }
    }
}

/// The derivative of a function of a sum of angles: `derivative` by the sum, with the joint's sign in it.
fn times_sign(derivative: Expr, sign: Option<bool>) -> Expr {
    match sign {
        None => Expr::ZERO,
        Some(negative) => {
            if negative {
                -derivative
            } else {
                derivative
            }
        }
    }
}
