//! The value of expressions in any field: one sample, modulo the prime, or as a dual number.

use super::{Expr, Graph, Input, JointSum, Node};
use crate::exact::prime::Fp;
use crate::exact::rational::Rational;

/// The number type for the operations of a graph.
pub trait Field: Copy {
    /// a + b
    fn add(self, other: Self) -> Self;
    /// −a
    fn neg(self) -> Self;
    /// a·b
    fn mul(self, other: Self) -> Self;
    /// a/b; `None` where it is not defined.
    fn div(self, other: Self) -> Option<Self>;
    /// √a, always the same one of the two roots; `None` where there is none.
    fn sqrt(self) -> Option<Self>;
    /// A constant; `None` where the field has no such number.
    fn constant(value: &Rational) -> Option<Self>;
}

impl Field for Fp {
    fn add(self, other: Self) -> Self {
        self + other
    }
    fn neg(self) -> Self {
        -self
    }
    fn mul(self, other: Self) -> Self {
        self * other
    }
    fn div(self, other: Self) -> Option<Self> {
        Some(self * other.inverse()?)
    }
    fn sqrt(self) -> Option<Self> {
        self.square_root()
    }
    fn constant(value: &Rational) -> Option<Self> {
        Fp::from_rational(value)
    }
}

/// The values of some outputs; `None` where an operation is not defined.
///
/// `input` gives the inputs, `symbol` the sine (`true`) or cosine of an angle symbol.
pub fn evaluate<F: Field>(
    graph: &Graph,
    outputs: &[Expr],
    input: impl Fn(Input) -> F,
    symbol: impl Fn(usize, bool) -> F,
) -> Option<Vec<F>> {
    let values = nodes(graph, outputs, input, symbol)?;
    outputs.iter().map(|e| signed(&values, *e)).collect()
}

fn signed<F: Field>(values: &[Option<F>], e: Expr) -> Option<F> {
    let value = values[e.node()]?;
    Some(if e.is_negative() { value.neg() } else { value })
}

/// As [`evaluate`], the values of all nodes that the outputs need.
pub fn nodes<F: Field>(
    graph: &Graph,
    outputs: &[Expr],
    input: impl Fn(Input) -> F,
    symbol: impl Fn(usize, bool) -> F,
) -> Option<Vec<Option<F>>> {
    let mut values: Vec<Option<F>> = vec![None; graph.nodes().len()];
    let of = signed::<F>;
    for node in graph.needed(outputs) {
        values[node] = match graph.nodes()[node] {
            Node::Constant(index) => F::constant(graph.constant(index)),
            Node::Symbol(index, sine) => Some(symbol(index as usize, sine)),
            Node::Input(i) => Some(input(i)),
            Node::Add(a, b) => Some(of(&values, a)?.add(of(&values, b)?)),
            Node::Mul(a, b) => Some(of(&values, a)?.mul(of(&values, b)?)),
            Node::Div(a, b) => of(&values, a)?.div(of(&values, b)?),
            Node::Sqrt(a) => of(&values, a)?.sqrt(),
        };
        values[node]?;
    }
    Some(values)
}

/// Sine and cosine of a sum of angles by the addition theorem, from those of its joints.
pub fn sine_and_cosine<F: Field>(sum: JointSum, of_joint: &dyn Fn(usize) -> (F, F)) -> (F, F) {
    let signed = |(i, negative): (usize, bool)| {
        let (s, c) = of_joint(i);
        (if negative { s.neg() } else { s }, c)
    };
    let add = |(s, c): (F, F), (t, d): (F, F)| (s.mul(d).add(c.mul(t)), c.mul(d).add(s.mul(t).neg()));
    let mut joints = sum.joints().map(signed);
    // A sum has a joint.
    let first = joints.next().unwrap_or_else(|| of_joint(0));
    joints.fold(first, add)
}
