//! Derivatives of expressions, node by node.

use super::{Builder, Expr, Input, JointSum, Node};
use crate::exact::algebra::Algebra;
use std::collections::HashMap;

/// The variable of a derivative.
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
            Node::Sqrt(x) => b.div(of(x), twice_root(b, x)),
        };
        rates.insert(node, rate);
    }
    outputs.iter().map(|e| signed(&rates, *e)).collect()
}

/// The derivative of one output by q and by q̇ of each joint of the chain, in one pass backwards.
pub fn gradient(b: &Builder, output: Expr, joints: usize) -> [Vec<Expr>; 2] {
    let graph = b.snapshot();
    let mut weights: HashMap<usize, Expr> = HashMap::from([(output.node(), Expr::ONE)]);
    let (mut by_position, mut by_velocity) = (vec![Expr::ZERO; joints], vec![Expr::ZERO; joints]);
    let add = |to: &mut Expr, x: Expr| *to = b.add(to, &x);
    for node in graph.needed(&[output]).into_iter().rev() {
        let Some(weight) = weights.get(&node).copied() else { continue };
        let mut by_angle = |sum: JointSum, weight: Expr| {
            for (joint, negative) in sum.joints() {
                add(&mut by_position[joint], if negative { -weight } else { weight });
            }
        };
        let mut give = |e: Expr, weight: Expr| {
            add(
                weights.entry(e.node()).or_insert(Expr::ZERO),
                if e.is_negative() { -weight } else { weight },
            );
        };
        match graph.nodes()[node] {
            Node::Input(Input::Sin(sum)) => by_angle(sum, b.mul(&weight, &b.input(Input::Cos(sum)))),
            Node::Input(Input::Cos(sum)) => by_angle(sum, -b.mul(&weight, &b.input(Input::Sin(sum)))),
            Node::Input(Input::Position(j)) => add(&mut by_position[j], weight),
            Node::Input(Input::Velocity(j)) => add(&mut by_velocity[j], weight),
            Node::Input(_) | Node::Constant(_) | Node::Symbol(..) => {}
            Node::Add(x, y) => [x, y].into_iter().for_each(|e| give(e, weight)),
            Node::Mul(x, y) => {
                give(x, b.mul(&weight, &y));
                give(y, b.mul(&weight, &x));
            }
            Node::Div(x, y) => {
                let by_x = b.div(weight, y);
                give(x, by_x);
                give(y, -b.mul(&by_x, &b.div(x, y)));
            }
            Node::Sqrt(x) => give(x, b.div(weight, twice_root(b, x))),
        }
    }
    if output.is_negative() {
        by_position.iter_mut().chain(&mut by_velocity).for_each(|x| *x = -*x);
    }
    [by_position, by_velocity]
}

fn signed(rates: &HashMap<usize, Expr>, e: Expr) -> Expr {
    let rate = rates.get(&e.node()).copied().unwrap_or(Expr::ZERO);
    if e.is_negative() { -rate } else { rate }
}

/// 2√x
fn twice_root(b: &Builder, x: Expr) -> Expr {
    let root = b.sqrt(x);
    b.add(&root, &root)
}

/// The rate of a sum of angles.
fn angle_rate(b: &Builder, sum: JointSum, position: &dyn Fn(usize) -> Expr) -> Expr {
    let term = |(joint, negative): (usize, bool)| if negative { -position(joint) } else { position(joint) };
    sum.joints().map(term).fold(Expr::ZERO, |sum, term| b.add(&sum, &term))
}
