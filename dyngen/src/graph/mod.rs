//! Hash-consed expressions, which are emitted and evaluated.
//!
//! Every expression exists once. A sign costs nothing: an [`Expr`] is a node and a sign, so x and −x share
//! their node, and sums and products are stored with the sign pulled out. Constants are exact.

mod build;
mod contraction;
pub mod differentiate;
pub mod evaluate;
mod joint_sum;
mod preparation;
pub mod tape;

pub use build::Builder;
pub use contraction::Contraction;
pub use joint_sum::JointSum;
pub use preparation::Preparation;

use crate::exact::rational::Rational;
use rustc_hash::FxHashMap;
use std::fmt;

/// A node with a sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Expr(u32);

impl Expr {
    /// The constant 0, in every graph.
    pub const ZERO: Expr = Expr(0);
    /// The constant 1, in every graph.
    pub const ONE: Expr = Expr(2);

    fn new(node: usize, negative: bool) -> Expr {
        Expr((node as u32) << 1 | u32::from(negative))
    }

    /// Index of the node.
    pub fn node(self) -> usize {
        (self.0 >> 1) as usize
    }

    /// Whether the value is minus that of the node.
    pub fn is_negative(self) -> bool {
        self.0 & 1 == 1
    }

    /// This node without the sign.
    pub fn positive(self) -> Expr {
        Expr(self.0 & !1)
    }
}

impl std::ops::Neg for Expr {
    type Output = Expr;
    fn neg(self) -> Expr {
        if self == Expr::ZERO { self } else { Expr(self.0 ^ 1) }
    }
}

/// An input of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Input {
    /// sin q of a revolute joint, or sin(q + theta) where theta is not a multiple of pi/2; or of a sum of
    /// such angles.
    Sin(JointSum),
    /// The cosine of the same angle.
    Cos(JointSum),
    /// q of a prismatic joint.
    Position(usize),
    /// q̇
    Velocity(usize),
    /// q̈
    Acceleration(usize),
    /// Joint torque or force, for forward dynamics.
    Torque(usize),
    /// Reference velocity q̇ᵣ of Slotine and Li.
    ReferenceVelocity(usize),
    /// Reference acceleration q̈ᵣ.
    ReferenceAcceleration(usize),
    /// A vector of one number a joint that the regressor's transpose is multiplied with.
    Error(usize),
    /// A wrench on the tool's frame: force above moment.
    Wrench(usize),
    /// A payload's inertial parameter.
    Payload(usize),
    /// How q changes in a direction.
    PositionDirection(usize),
    /// How q̇ changes in a direction.
    VelocityDirection(usize),
    /// A parameter of the set.
    Parameter(usize),
    /// A value that was prepared of the parameters alone.
    Prepared(usize),
}

impl fmt::Display for Input {
    /// The name in emitted code and listings.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (letters, index) = match self {
            Input::Sin(sum) => return write!(f, "s{sum}"),
            Input::Cos(sum) => return write!(f, "c{sum}"),
            Input::Position(i) => ("q", i),
            Input::Velocity(i) => ("dq", i),
            Input::Acceleration(i) => ("ddq", i),
            Input::Torque(i) => ("tau", i),
            Input::ReferenceVelocity(i) => ("dqr", i),
            Input::ReferenceAcceleration(i) => ("ddqr", i),
            Input::Error(i) => ("e", i),
            Input::Wrench(i) => ("f", i),
            Input::Payload(i) => ("payload", i),
            Input::PositionDirection(i) => ("vq", i),
            Input::VelocityDirection(i) => ("vdq", i),
            Input::Parameter(i) => ("p", i),
            Input::Prepared(i) => ("z", i),
        };
        write!(f, "{letters}{}", index + 1)
    }
}

/// An operation. Operands of `Mul` carry no sign, the first of `Add` and both of `Div` neither; that of
/// `Sqrt` may.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// A constant other than zero and without sign: index for [`Graph::constant`].
    Constant(u32),
    /// Sine or cosine of an angle symbol.
    Symbol(u32, bool),
    /// An input.
    Input(Input),
    /// a + b
    Add(Expr, Expr),
    /// a·b
    Mul(Expr, Expr),
    /// a/b
    Div(Expr, Expr),
    /// √a
    Sqrt(Expr),
}

/// Expressions with their nodes in an order in which operands come first.
#[derive(Clone, Debug)]
pub struct Graph {
    nodes: Vec<Node>,
    constants: Vec<Rational>,
    index: FxHashMap<Node, u32>,
    constant_index: FxHashMap<Rational, u32>,
}

/// Operations of a function, trigonometry apart. Changes of sign are free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Operations {
    /// Multiplications.
    pub mul: usize,
    /// Additions and subtractions.
    pub add: usize,
    /// Divisions.
    pub div: usize,
    /// Square roots.
    pub sqrt: usize,
    /// Angles whose sine and cosine are needed.
    pub sin_cos: usize,
}

impl Graph {
    /// The nodes, operands first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The value of a constant node.
    pub fn constant(&self, index: u32) -> &Rational {
        &self.constants[index as usize]
    }

    /// The nodes that some outputs need, in order.
    pub fn needed(&self, outputs: &[Expr]) -> Vec<usize> {
        let mut needed = vec![false; self.nodes.len()];
        for output in outputs {
            needed[output.node()] = true;
        }
        for node in (0..self.nodes.len()).rev() {
            if needed[node] {
                for operand in operands(&self.nodes[node]) {
                    needed[operand.node()] = true;
                }
            }
        }
        (0..self.nodes.len()).filter(|n| needed[*n]).collect()
    }

    /// The inputs on which each node depends.
    pub fn holds(&self) -> Vec<Holds> {
        let mut holds: Vec<Holds> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            holds.push(match node {
                Node::Input(Input::Parameter(_)) => Holds { parameters: true, state: false },
                Node::Input(_) => Holds { parameters: false, state: true },
                _ => operands(node).map(|e| holds[e.node()]).fold(Holds::default(), |sum, x| Holds {
                    parameters: sum.parameters || x.parameters,
                    state: sum.state || x.state,
                }),
            });
        }
        holds
    }

    /// The operations that some outputs cost.
    pub fn operations(&self, outputs: &[Expr]) -> Operations {
        self.count(outputs, |_| true)
    }

    /// The operations that some outputs cost in addition to those that depend on parameters alone and can be
    /// prepared.
    pub fn operations_when_prepared(&self, outputs: &[Expr]) -> Operations {
        let holds = self.holds();
        self.count(outputs, |node| holds[node].state || !holds[node].parameters)
    }

    fn count(&self, outputs: &[Expr], counts: impl Fn(usize) -> bool) -> Operations {
        let mut count = Operations::default();
        let mut angles = std::collections::BTreeSet::new();
        for node in self.needed(outputs).into_iter().filter(|n| counts(*n)) {
            match self.nodes[node] {
                Node::Add(..) => count.add += 1,
                Node::Mul(..) => count.mul += 1,
                Node::Div(..) => count.div += 1,
                Node::Sqrt(_) => count.sqrt += 1,
                Node::Input(Input::Sin(sum) | Input::Cos(sum)) => {
                    angles.insert(sum);
                }
                _ => {}
            }
        }
        // A sum of angles is formed before its sine and cosine are taken.
        count.add += angles.iter().map(|sum| sum.count() - 1).sum::<usize>();
        count.sin_cos = angles.len();
        count
    }
}

/// On what a value depends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Holds {
    /// On parameters.
    pub parameters: bool,
    /// On any other input.
    pub state: bool,
}

/// The operands of a node.
pub fn operands(node: &Node) -> impl Iterator<Item = Expr> {
    match *node {
        Node::Add(a, b) | Node::Mul(a, b) | Node::Div(a, b) => [Some(a), Some(b)],
        Node::Sqrt(a) => [Some(a), None],
        _ => [None, None],
    }
    .into_iter()
    .flatten()
}
