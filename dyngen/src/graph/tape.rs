//! A graph as a tape that runs over blocks of samples without a compiler and without allocating.
//!
//! Each instruction works on a block of [`LANES`] samples, so its cost is shared by all of them and the
//! processor's vector units do the arithmetic.

use super::{Expr, Graph, Input, Node};
use crate::exact::rational;

/// Samples in a block.
pub const LANES: usize = 32;

/// One value for each sample of a block.
pub type Lane = [f64; LANES];

#[derive(Clone, Copy, Debug)]
enum Instruction {
    Add { to: u32, a: u32, b: u32 },
    Sub { to: u32, a: u32, b: u32 },
    Mul { to: u32, a: u32, b: u32 },
    Div { to: u32, a: u32, b: u32 },
    Sqrt { to: u32, a: u32, negative: bool },
}

/// The place of a result.
#[derive(Clone, Copy, Debug)]
struct Output {
    slot: u32,
    negative: bool,
}

/// A compiled function.
#[derive(Clone, Debug)]
pub struct Tape {
    constants: Vec<f64>,
    inputs: Vec<Input>,
    instructions: Vec<Instruction>,
    outputs: Vec<Output>,
    slots: usize,
}

impl Tape {
    /// Compiles some outputs. Slots of values that are needed no more are used again.
    ///
    /// Slots hold the constants first, then the inputs, then the results of instructions.
    pub fn compile(graph: &Graph, outputs: &[Expr], symbol: impl Fn(usize, bool) -> f64) -> Tape {
        let needed = graph.needed(outputs);
        let mut last_use = vec![0usize; graph.nodes().len()];
        for node in &needed {
            for operand in super::operands(&graph.nodes()[*node]) {
                last_use[operand.node()] = *node;
            }
        }
        for output in outputs {
            last_use[output.node()] = usize::MAX;
        }
        let mut slot_of = vec![u32::MAX; graph.nodes().len()];
        let (mut constants, mut inputs) = (Vec::new(), Vec::new());
        for node in &needed {
            let value = match graph.nodes()[*node] {
                Node::Constant(index) => rational::to_f64(graph.constant(index)),
                Node::Symbol(index, sine) => symbol(index as usize, sine),
                _ => continue,
            };
            slot_of[*node] = constants.len() as u32;
            constants.push(value);
        }
        for node in &needed {
            if let Node::Input(input) = graph.nodes()[*node] {
                slot_of[*node] = (constants.len() + inputs.len()) as u32;
                inputs.push(input);
            }
        }
        let fixed = constants.len() + inputs.len();
        let mut slots = fixed;
        let mut free: Vec<u32> = Vec::new();
        let mut instructions = Vec::new();
        for node in &needed {
            let (a, b) = match graph.nodes()[*node] {
                Node::Add(a, b) | Node::Mul(a, b) | Node::Div(a, b) => (a, b),
                Node::Sqrt(a) => (a, a),
                Node::Constant(_) | Node::Symbol(..) | Node::Input(_) => continue,
            };
            let (from_a, from_b) = (slot_of[a.node()], slot_of[b.node()]);
            for operand in [a.node(), b.node()] {
                let slot = slot_of[operand];
                if last_use[operand] == *node && slot as usize >= fixed && !free.contains(&slot) {
                    free.push(slot);
                }
            }
            let to = free.pop().unwrap_or_else(|| {
                slots += 1;
                (slots - 1) as u32
            });
            slot_of[*node] = to;
            let (a, b_negative, b) = (from_a, b.is_negative(), from_b);
            instructions.push(match graph.nodes()[*node] {
                Node::Mul(..) => Instruction::Mul { to, a, b },
                Node::Div(..) => Instruction::Div { to, a, b },
                Node::Sqrt(_) => Instruction::Sqrt { to, a, negative: b_negative },
                _ if b_negative => Instruction::Sub { to, a, b },
                _ => Instruction::Add { to, a, b },
            });
        }
        let outputs =
            outputs.iter().map(|e| Output { slot: slot_of[e.node()], negative: e.is_negative() }).collect();
        Tape { constants, inputs, instructions, outputs, slots }
    }

    /// The number of results.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// A workspace for [`Tape::run`], with the constants in place.
    pub fn workspace(&self) -> Vec<Lane> {
        let mut slots = vec![[0.0; LANES]; self.slots];
        for (slot, value) in slots.iter_mut().zip(&self.constants) {
            *slot = [*value; LANES];
        }
        slots
    }

    /// Runs over one block: `input` fills a lane, `output` takes the lane of each result in order.
    pub fn run(
        &self,
        workspace: &mut [Lane],
        mut input: impl FnMut(Input, &mut Lane),
        mut output: impl FnMut(usize, &Lane, bool),
    ) {
        for (slot, which) in workspace[self.constants.len()..].iter_mut().zip(&self.inputs) {
            input(*which, slot);
        }
        for instruction in &self.instructions {
            match *instruction {
                Instruction::Add { to, a, b } => apply(workspace, to, a, b, |x, y| x + y),
                Instruction::Sub { to, a, b } => apply(workspace, to, a, b, |x, y| x - y),
                Instruction::Mul { to, a, b } => apply(workspace, to, a, b, |x, y| x * y),
                Instruction::Div { to, a, b } => apply(workspace, to, a, b, |x, y| x / y),
                Instruction::Sqrt { to, a, negative } => {
                    apply(workspace, to, a, a, |x, _| if negative { (-x).sqrt() } else { x.sqrt() });
                }
            }
        }
        for (i, result) in self.outputs.iter().enumerate() {
            output(i, &workspace[result.slot as usize], result.negative);
        }
    }
}

#[inline]
fn apply(workspace: &mut [Lane], to: u32, a: u32, b: u32, f: impl Fn(f64, f64) -> f64) {
    let (x, y) = (workspace[a as usize], workspace[b as usize]);
    let z = &mut workspace[to as usize];
    for lane in 0..LANES {
        z[lane] = f(x[lane], y[lane]);
    }
}
