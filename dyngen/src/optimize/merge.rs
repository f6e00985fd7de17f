//! Merges nodes that are equal as functions, whatever their form.
//!
//! Each node's value at two random points modulo the 61-bit prime is its fingerprint. Nodes with the same
//! fingerprint are the same function except with a probability below 2⁻¹⁰⁰, and the emitted code is proven
//! afterwards in any case: a false merge would stop the generator and not reach the code.

use crate::arm::MAX_JOINTS;
use crate::exact::constant::ConstantField;
use crate::exact::prime::{Draws, Fp};
use crate::graph::evaluate::{Field, sine_and_cosine};
use crate::graph::{Builder, Expr, Graph, Input, Node};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

const POINTS: usize = 2;
type Fingerprint = [Fp; POINTS];

/// The pass.
pub(super) fn merge(graph: &Graph, outputs: &[Expr], field: &ConstantField) -> (Graph, Vec<Expr>) {
    let builder = Builder::new();
    let mut inputs = Inputs::new();
    let mut new: Vec<Expr> = vec![Expr::ZERO; graph.nodes().len()];
    let mut prints: Vec<Option<Fingerprint>> = vec![None; graph.nodes().len()];
    let mut known: FxHashMap<Fingerprint, Expr> = FxHashMap::default();
    for node in graph.needed(outputs) {
        let of = |e: Expr| prints[e.node()].map(|p| if e.is_negative() { p.map(|x| -x) } else { p });
        let print = fingerprint(graph, node, field, &mut inputs, of);
        prints[node] = print;
        let replacement = print.and_then(|p| {
            if p == [Fp::ZERO; POINTS] {
                return Some(Expr::ZERO);
            }
            known.get(&p).copied().or_else(|| known.get(&p.map(|x| -x)).map(|e| -*e))
        });
        let built = replacement.unwrap_or_else(|| builder.copy_node(graph, node, &new));
        new[node] = built;
        if let (None, Some(p)) = (replacement, print) {
            known.insert(p, built);
        }
    }
    let outputs = outputs.iter().map(|e| signed(&new, *e)).collect();
    (builder.finish(), outputs)
}

fn signed(new: &[Expr], e: Expr) -> Expr {
    if e.is_negative() { -new[e.node()] } else { new[e.node()] }
}

fn fingerprint(
    graph: &Graph,
    node: usize,
    field: &ConstantField,
    inputs: &mut Inputs,
    of: impl Fn(Expr) -> Option<Fingerprint>,
) -> Option<Fingerprint> {
    let pair = |x: Expr, y: Expr, f: fn(Fp, Fp) -> Option<Fp>| -> Option<Fingerprint> {
        let (a, b) = (of(x)?, of(y)?);
        Some([f(a[0], b[0])?, f(a[1], b[1])?])
    };
    match graph.nodes()[node] {
        Node::Constant(index) => Fp::from_rational(graph.constant(index)).map(|x| [x; POINTS]),
        Node::Symbol(index, sine) => Some([field.modular_symbol(index as usize, sine); POINTS]),
        Node::Input(input) => Some(inputs.value(input)),
        Node::Add(x, y) => pair(x, y, |a, b| Some(a + b)),
        Node::Mul(x, y) => pair(x, y, |a, b| Some(a * b)),
        Node::Div(x, y) => pair(x, y, |a, b| a.div(b)),
        Node::Sqrt(x) => Some(of(x)?.map(root)),
    }
}

/// The root of a square. The number of no square has a value for its root that is as good as free of all
/// others, so that no two nodes agree because of it.
fn root(x: Fp) -> Fp {
    x.square_root().unwrap_or_else(|| Draws::new(x.residue()).element())
}

/// Random values of inputs, sines and cosines on the circle.
struct Inputs {
    draws: Draws,
    /// Sine and cosine of every joint's angle.
    joints: Vec<[(Fp, Fp); POINTS]>,
    values: BTreeMap<Input, Fingerprint>,
}

impl Inputs {
    fn new() -> Self {
        let mut draws = Draws::new(0x006d_6572_6765);
        let mut points = || std::array::from_fn(|_| draws.element().circle_point());
        let joints = (0..MAX_JOINTS).map(|_| points()).collect();
        Inputs { draws, joints, values: BTreeMap::new() }
    }

    fn value(&mut self, input: Input) -> Fingerprint {
        if let Some(found) = self.values.get(&input) {
            return *found;
        }
        match input {
            Input::Sin(sum) | Input::Cos(sum) => {
                let points: [(Fp, Fp); POINTS] = std::array::from_fn(|k| {
                    let joints: Vec<(Fp, Fp)> = self.joints.iter().map(|points| points[k]).collect();
                    sine_and_cosine(sum, &|i| joints[i])
                });
                self.values.insert(Input::Sin(sum), points.map(|p| p.0));
                self.values.insert(Input::Cos(sum), points.map(|p| p.1));
            }
            other => {
                let value = std::array::from_fn(|_| self.draws.element());
                self.values.insert(other, value);
            }
        }
        self.values.get(&input).copied().unwrap_or([Fp::ZERO; POINTS])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::algebra::Algebra;
    use crate::exact::symbols::AngleSymbols;
    use crate::graph::JointSum;

    #[test]
    fn different_forms_of_one_function_become_one_node() {
        let field = ConstantField::new(&AngleSymbols::default(), 0, &mut Draws::new(1));
        let b = Builder::new();
        let sum = JointSum::joint(0);
        let (s, c) = (b.input(Input::Sin(sum)), b.input(Input::Cos(sum)));
        let (x, y) = (b.input(Input::Velocity(0)), b.input(Input::Velocity(1)));
        let square = |e: Expr| b.mul(&e, &e);
        let one = b.add(&square(s), &square(c));
        let factored = b.mul(&b.add(&x, &y), &b.sub(&x, &y));
        let expanded = b.sub(&square(y), &square(x));
        let zero = b.sub(&b.mul(&one, &x), &x);
        let outputs = [b.mul(&x, &one), factored, expanded, zero];
        let (graph, merged) = merge(&b.finish(), &outputs, &field);
        assert_eq!(merged[0], merged[0].positive());
        assert_eq!(merged[1], -merged[2]);
        assert_eq!(merged[3], Expr::ZERO);
        let operations = graph.operations(&merged);
        assert_eq!((operations.mul, operations.add), (1, 2));
    }
}
