//! Joints that follow others, in graphs: the full chain's functions become those of the coordinates.
//!
//! With q_chain = G·q + o the chain's torques and momenta give Gᵀ·τ, its mass and Coriolis matrices GᵀMG and
//! GᵀCG (Christoffel symbols are those of the coordinates because G is constant), and what is linear in
//! velocities J·G. Inputs of joints that follow are replaced by those of the joints that they follow.

use super::chain;
use crate::arm::{Arm, Drive, JointKind};
use crate::exact::algebra::Algebra;
use crate::exact::angle::Angle;
use crate::exact::rational::{self, Rational};
use crate::graph::{Builder, Expr, Graph, Input, JointSum};
use num_traits::Zero;

/// How an arm's chain moves with the coordinates.
#[derive(Clone, Debug)]
pub struct Followers<'a> {
    arm: &'a Arm,
    drives: Vec<Drive>,
}

impl<'a> Followers<'a> {
    /// Those of an arm; where no joint follows another nothing changes.
    pub fn new(arm: &'a Arm) -> Self {
        Followers { arm, drives: arm.drives() }
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

    /// The outputs with the coordinates in place of the chain's joints.
    pub fn of_coordinates(&self, graph: Graph, outputs: Vec<Expr>) -> (Graph, Vec<Expr>) {
        if !self.arm.has_mimics() {
            return (graph, outputs);
        }
        let b = Builder::new();
        let mut copied = vec![Expr::ZERO; graph.nodes().len()];
        for node in graph.needed(&outputs) {
            copied[node] = match graph.nodes()[node] {
                crate::graph::Node::Input(input) => self.input(&b, input),
                _ => b.copy_node(&graph, node, &copied),
            };
        }
        let of = |e: &Expr| if e.is_negative() { -copied[e.node()] } else { copied[e.node()] };
        let outputs = outputs.iter().map(of).collect();
        (b.finish(), outputs)
    }

    fn input(&self, b: &Builder, input: Input) -> Expr {
        let rate = |of: fn(usize) -> Input, joint: usize| {
            let drive = &self.drives[joint];
            b.mul(&b.constant(&drive.ratio), &b.input(of(drive.coordinate)))
        };
        match input {
            Input::Sin(sum) => self.sin_cos(b, sum).0,
            Input::Cos(sum) => self.sin_cos(b, sum).1,
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

    fn sin_cos(&self, b: &Builder, sum: JointSum) -> (Expr, Expr) {
        let of = |sum| (b.input(Input::Sin(sum)), b.input(Input::Cos(sum)));
        let Some(Folded { sum, negative, quarters }) = self.folded(sum) else { return of(sum) };
        let (s, c) = sum.map_or((Expr::ZERO, Expr::ONE), of);
        let s = if negative { -s } else { s };
        match quarters {
            1 => (c, -s),
            2 => (-s, -c),
            3 => (-c, s),
            _ => (s, c),
        }
    }

    /// A sum of the chain's angles as one of joints that move on their own, where it is one but for quarter
    /// turns: with ratios of one, as in a parallelogram.
    fn folded(&self, sum: JointSum) -> Option<Folded> {
        let mut factors = vec![Rational::zero(); self.arm.links()];
        let mut phases: Vec<(Angle, Rational)> = Vec::new();
        for (joint, negative) in sum.joints() {
            let sign = rational::integer(if negative { -1 } else { 1 });
            let drive = &self.drives[joint];
            if joint != drive.joint && self.arm.joints[drive.joint].kind != JointKind::Revolute {
                return None;
            }
            factors[drive.joint] += &sign * &drive.ratio;
            phases.push((self.arm.phase(joint), sign));
        }
        let quarters = Angle::sum(&phases).quarter_turns()?;
        let one = |x: &Rational| *x == rational::integer(1) || *x == rational::integer(-1);
        let terms: Vec<(usize, bool)> = (factors.iter().enumerate())
            .filter(|(_, x)| !x.is_zero())
            .map(|(joint, x)| one(x).then(|| (joint, *x < Rational::zero())))
            .collect::<Option<_>>()?;
        if terms.is_empty() {
            return Some(Folded { sum: None, negative: false, quarters });
        }
        let (sum, negative) = JointSum::of(terms);
        Some(Folded { sum: Some(sum), negative, quarters })
    }

    /// The sums of angles, beside the coordinates' own, whose sines and cosines functions may take.
    fn sums(&self) -> Vec<JointSum> {
        let followers = (0..self.arm.links()).filter(|i| self.drives[*i].joint != *i).map(JointSum::joint);
        let own = self.arm.coordinates();
        let mut sums = Vec::new();
        for sum in followers.chain(chain::sums(self.arm)) {
            let sum = match self.folded(sum) {
                Some(Folded { sum: None, .. }) => continue,
                Some(Folded { sum: Some(folded), .. }) => folded,
                None => sum,
            };
            let is_own = own.iter().any(|joint| JointSum::joint(*joint) == sum);
            if !is_own && !sums.contains(&sum) {
                sums.push(sum);
            }
        }
        sums
    }
}

/// A sum of angles of joints that move on their own, none where it is constant.
struct Folded {
    sum: Option<JointSum>,
    negative: bool,
    /// What is added.
    quarters: u8,
}

/// Every angle whose sine and cosine functions may take: those of the joints that move on their own, then
/// sums across parallel axes and angles of joints that follow.
pub fn angles(arm: &Arm) -> Vec<JointSum> {
    let own = arm.coordinates().into_iter().map(JointSum::joint);
    let sums = if arm.has_mimics() { Followers::new(arm).sums() } else { chain::sums(arm) };
    own.chain(sums).collect()
}
