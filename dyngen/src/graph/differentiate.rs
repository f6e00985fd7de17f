//! Derivatives of expressions, node by node.

use super::{Builder, Expr, Input, JointSum, Node};
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
    let one = |is: bool| if is { Expr::ONE } else { Expr::ZERO };
    along(b, outputs, &|j| one(direction == Direction::Position(j)), &|j| {
        one(direction == Direction::Velocity(j))
    })
}

/// The derivative of each output where q and q̇ of each joint change at given rates.
pub fn along(
    b: &Builder,
    outputs: &[Expr],
    position: &dyn Fn(usize) -> Expr,
    velocity: &dyn Fn(usize) -> Expr,
) -> Vec<Expr> {
    let graph = b.snapshot();
    let mut rates: HashMap<usize, Expr> = HashMap::new();
    for node in graph.needed(outputs) {
        let of = |e: Expr| signed(&rates, e);
        let rate = match graph.nodes()[node] {
            Node::Input(Input::Sin(sum)) => b.mul(&angle_rate(b, sum, position), &b.input(Input::Cos(sum))),
            Node::Input(Input::Cos(sum)) => b.mul(&angle_rate(b, sum, position), &-b.input(Input::Sin(sum))),
            Node::Input(Input::Position(j)) => position(j),
            Node::Input(Input::Velocity(j)) => velocity(j),
            Node::Input(_) | Node::Constant(_) | Node::Symbol(..) => Expr::ZERO,
            Node::Add(x, y) => b.add(&of(x), &of(y)),
            Node::Mul(x, y) => b.add(&b.mul(&of(x), &y), &b.mul(&x, &of(y))),
            // (x/y)' = (x' − (x/y) y')/y
            Node::Div(x, y) => {
                let quotient = b.div(x, y);
                b.div(b.sub(&of(x), &b.mul(&quotient, &of(y))), y)
            }
        };
        rates.insert(node, rate);
    }
    outputs.iter().map(|e| signed(&rates, *e)).collect()
}

fn signed(rates: &HashMap<usize, Expr>, e: Expr) -> Expr {
    let rate = rates.get(&e.node()).copied().unwrap_or(Expr::ZERO);
    if e.is_negative() { -rate } else { rate }
}

/// The rate of a sum of angles.
fn angle_rate(b: &Builder, sum: JointSum, position: &dyn Fn(usize) -> Expr) -> Expr {
    let term = |(joint, negative): (usize, bool)| if negative { -position(joint) } else { position(joint) };
    sum.joints().map(term).fold(Expr::ZERO, |sum, term| b.add(&sum, &term))
}
