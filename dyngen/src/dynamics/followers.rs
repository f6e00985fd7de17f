//! Joints that follow others, in graphs: the full chain's functions become those of the coordinates.
//!
//! With q_chain = G·q + o the chain's torques and momenta give Gᵀ·τ, its mass and Coriolis matrices GᵀMG and
//! GᵀCG (Christoffel symbols are those of the coordinates because G is constant), and quantities that are
//! linear in velocities give J·G. Inputs of joints that follow are replaced by those of the joints that they
//! follow.

use super::angles::Angles;
use crate::arm::{Arm, Drive};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr, Graph, Input, Node};

/// How an arm's chain moves with the coordinates.
#[derive(Clone, Debug)]
pub struct Followers<'a> {
    arm: &'a Arm,
    angles: &'a Angles,
    drives: Vec<Drive>,
}

impl<'a> Followers<'a> {
    /// The followers of an arm; where no joint follows another nothing changes.
    pub fn new(arm: &'a Arm, angles: &'a Angles) -> Self {
        Followers { arm, angles, drives: arm.drives() }
    }

    /// Gᵀ·A for a matrix with a row for each joint of the chain, row-major.
    pub fn rows(&self, b: &Builder, matrix: Vec<Expr>) -> Vec<Expr> {
        if !self.arm.has_mimics() {
            return matrix;
        }
        let columns = matrix.len() / self.drives.len();
        let mut sums = vec![Expr::ZERO; self.arm.dof() * columns];
        for (row, drive) in matrix.chunks(columns.max(1)).zip(&self.drives) {
            let ratio = b.constant(&drive.ratio);
            for (k, entry) in row.iter().enumerate() {
                let sum = &mut sums[drive.coordinate * columns + k];
                *sum = b.add(sum, &b.mul(&ratio, entry));
            }
        }
        sums
    }

    /// A·G for a matrix with a column for each joint of the chain, row-major.
    pub fn columns(&self, b: &Builder, matrix: Vec<Expr>) -> Vec<Expr> {
        if !self.arm.has_mimics() {
            return matrix;
        }
        let (n, dof) = (self.drives.len(), self.arm.dof());
        let mut sums = vec![Expr::ZERO; matrix.len() / n * dof];
        for (row, to) in matrix.chunks(n).zip(sums.chunks_mut(dof)) {
            for (entry, drive) in row.iter().zip(&self.drives) {
                let sum = &mut to[drive.coordinate];
                *sum = b.add(sum, &b.mul(&b.constant(&drive.ratio), entry));
            }
        }
        sums
    }

    /// The chain's rates or accelerations from those of the coordinates.
    pub fn of_chain(&self, b: &Builder, coordinates: &[Expr]) -> Vec<Expr> {
        let of = |drive: &Drive| b.mul(&b.constant(&drive.ratio), &coordinates[drive.coordinate]);
        self.drives.iter().map(of).collect()
    }

    /// The outputs with the coordinates in place of the chain's joints.
    pub fn of_coordinates(&self, graph: Graph, outputs: Vec<Expr>) -> (Graph, Vec<Expr>) {
        if !self.arm.has_mimics() {
            return (graph, outputs);
        }
        let b = Builder::new();
        let mut copied = vec![Expr::ZERO; graph.nodes().len()];
        for node in graph.needed(&outputs) {
            copied[node] = match graph.nodes()[node] {
                Node::Input(input) => self.input(&b, input),
                _ => b.copy_node(&graph, node, &copied),
            };
        }
        let of = |e: &Expr| if e.is_negative() { -copied[e.node()] } else { copied[e.node()] };
        let outputs = outputs.iter().map(of).collect();
        (b.finish(), outputs)
    }

    /// An input of the chain in terms of those of the coordinates.
    fn input(&self, b: &Builder, input: Input) -> Expr {
        let rate = |of: fn(usize) -> Input, joint: usize| {
            let drive = &self.drives[joint];
            b.mul(&b.constant(&drive.ratio), &b.input(of(drive.coordinate)))
        };
        match input {
            Input::Sin(sum) => self.angles.of_coordinates(b, sum).0,
            Input::Cos(sum) => self.angles.of_coordinates(b, sum).1,
            Input::Position(joint) => {
                b.add(&rate(Input::Position, joint), &b.constant(&self.drives[joint].offset))
            }
            Input::Velocity(joint) => rate(Input::Velocity, joint),
            Input::Acceleration(joint) => rate(Input::Acceleration, joint),
            Input::ReferenceVelocity(joint) => rate(Input::ReferenceVelocity, joint),
            Input::ReferenceAcceleration(joint) => rate(Input::ReferenceAcceleration, joint),
            other => b.input(other),
        }
    }
}
