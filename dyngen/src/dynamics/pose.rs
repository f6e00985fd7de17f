//! Kinematics of the tool, or of the last link where no tool is declared: pose, Jacobian, and the
//! acceleration that velocities alone make.

use super::body::Vector;
use super::chain::LinkGeometry;
use super::motion::{Drive, motions};
use super::stage::{Chain, back_x, plus, scaled};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};
use crate::lagrangian::elements::{ArmElements, JointElements, PlacementElements, turn_x};

/// A frame in the base: its axes as columns, and its origin.
#[derive(Clone, Copy, Debug)]
struct Pose {
    axes: [Vector; 3],
    origin: Vector,
}

impl Pose {
    const BASE: Pose = {
        const O: Expr = Expr::ZERO;
        const I: Expr = Expr::ONE;
        Pose { axes: [[I, O, O], [O, I, O], [O, O, I]], origin: [O, O, O] }
    };

    /// After Tx(a) Ty(b) Rx(α).
    fn about_x(&self, b: &Builder, joint: &JointElements<Expr>) -> Pose {
        let [x, y, z] = self.axes;
        let origin = moved(b, &moved(b, &self.origin, joint.a, &x), joint.b, &y);
        let (y, z) = turned(b, &joint.sin_alpha, &joint.cos_alpha, &y, &z);
        Pose { axes: [x, y, z], origin }
    }

    /// After Rz(θ) Tz(d).
    fn about_z(&self, b: &Builder, joint: &JointElements<Expr>) -> Pose {
        let [x, y, z] = self.axes;
        let (x, y) = turned(b, &joint.sin, &joint.cos, &x, &y);
        Pose { axes: [x, y, z], origin: moved(b, &self.origin, joint.shift, &z) }
    }

    /// A frame that is placed in this one: a shift, then Rz(yaw)·Ry(pitch)·Rx(roll).
    fn placed(&self, b: &Builder, frame: &PlacementElements<Expr>) -> Pose {
        let shifted = |origin: Vector, (axis, length): (&Vector, &Expr)| moved(b, &origin, *length, axis);
        let origin = self.axes.iter().zip(&frame.origin).fold(self.origin, shifted);
        let [x, y, z] = self.axes;
        let [(sr, cr), (sp, cp), (sy, cy)] = &frame.rpy;
        let (x, y) = turned(b, sy, cy, &x, &y);
        let (z, x) = turned(b, sp, cp, &z, &x);
        let (y, z) = turned(b, sr, cr, &y, &z);
        Pose { axes: [x, y, z], origin }
    }
}

/// u' = c u + s v, v' = c v − s u
fn turned(b: &Builder, s: &Expr, c: &Expr, u: &Vector, v: &Vector) -> (Vector, Vector) {
    let first = std::array::from_fn(|i| b.add(&b.mul(c, &u[i]), &b.mul(s, &v[i])));
    let second = std::array::from_fn(|i| b.sub(&b.mul(c, &v[i]), &b.mul(s, &u[i])));
    (first, second)
}

fn moved(b: &Builder, origin: &Vector, length: Expr, axis: &Vector) -> Vector {
    plus(b, origin, &scaled(b, length, axis))
}

/// The fixed frames at both ends of the chain.
#[derive(Clone, Debug)]
pub struct Ends {
    /// Frame 0 in the root link's.
    pub base: PlacementElements<Expr>,
    /// The tool's in its link's.
    pub tool: PlacementElements<Expr>,
    /// The link that carries the tool.
    pub carrier: usize,
}

/// The frame of every joint up to the tool's link before its screw about z, and the tool's.
fn poses(b: &Builder, arm: &ArmElements<Expr>, ends: &Ends) -> (Vec<Pose>, Pose) {
    let (joints, last) = links(b, arm, ends);
    (joints, last.placed(b, &ends.tool))
}

/// The frame of every joint up to the tool's link before its screw about z, and of that link.
fn links(b: &Builder, arm: &ArmElements<Expr>, ends: &Ends) -> (Vec<Pose>, Pose) {
    let mut state = Pose::BASE.placed(b, &ends.base);
    let mut joints = Vec::with_capacity(arm.joints.len());
    for joint in &arm.joints[..=ends.carrier] {
        if arm.convention == Convention::Modified {
            state = state.about_x(b, joint);
        }
        joints.push(state);
        state = state.about_z(b, joint);
        if arm.convention == Convention::Standard {
            state = state.about_x(b, joint);
        }
    }
    (joints, state)
}

/// The homogeneous transform of the tool's frame to the base (the root link's frame), row-major 4 × 4.
pub fn forward_kinematics(b: &Builder, arm: &ArmElements<Expr>, ends: &Ends) -> Vec<Expr> {
    let last = poses(b, arm, ends).1;
    let mut rows = Vec::with_capacity(16);
    for i in 0..3 {
        rows.extend([last.axes[0][i], last.axes[1][i], last.axes[2][i], last.origin[i]]);
    }
    rows.extend([Expr::ZERO, Expr::ZERO, Expr::ZERO, Expr::ONE]);
    rows
}

/// The geometric Jacobian, row-major 6 × n: velocity of the tool's origin above its angular velocity, in base
/// axes.
pub fn jacobian(b: &Builder, arm: &ArmElements<Expr>, ends: &Ends) -> Vec<Expr> {
    let (joints, last) = poses(b, arm, ends);
    // Joints beyond the tool's link do not move it.
    let n = arm.joints.len();
    let mut rows = vec![Expr::ZERO; 6 * n];
    for (j, (pose, joint)) in joints.iter().zip(&arm.joints).enumerate() {
        let z = pose.axes[2];
        let (linear, angular) = match joint.kind {
            JointKind::Revolute => {
                let arm: Vector = std::array::from_fn(|i| b.sub(&last.origin[i], &pose.origin[i]));
                (b.cross(&z, &arm), z)
            }
            JointKind::Prismatic => (z, super::body::ZERO),
        };
        for i in 0..3 {
            rows[i * n + j] = linear[i];
            rows[(i + 3) * n + j] = angular[i];
        }
    }
    rows
}

/// The Jacobian in the axes of the tool's frame, row-major 6 × n.
pub fn body_jacobian(b: &Builder, arm: &ArmElements<Expr>, ends: &Ends) -> Vec<Expr> {
    let (axes, n) = (poses(b, arm, ends).1.axes, arm.joints.len());
    let jacobian = jacobian(b, arm, ends);
    let entry = |i: usize, j: usize| {
        let part = i / 3 * 3;
        b.dot(&axes[i % 3], &std::array::from_fn(|k| jacobian[(part + k) * n + j]))
    };
    (0..6 * n).map(|k| entry(k / n, k % n)).collect()
}

/// The Jacobian about the base's origin, row-major 6 × n: v + p×ω above ω, for the tool's origin p.
pub fn spatial_jacobian(b: &Builder, arm: &ArmElements<Expr>, ends: &Ends) -> Vec<Expr> {
    // A joint's axis passes through its own origin, whatever the tool is.
    let n = arm.joints.len();
    let mut rows = vec![Expr::ZERO; 6 * n];
    for (j, (pose, joint)) in links(b, arm, ends).0.iter().zip(&arm.joints).enumerate() {
        let z = pose.axes[2];
        let (linear, angular) = match joint.kind {
            JointKind::Revolute => (b.cross(&pose.origin, &z), z),
            JointKind::Prismatic => (z, super::body::ZERO),
        };
        for i in 0..3 {
            rows[i * n + j] = linear[i];
            rows[(i + 3) * n + j] = angular[i];
        }
    }
    rows
}

/// J̇·q̇: acceleration of the tool's origin above its angular acceleration where q̈ = 0, in base axes.
pub fn jacobian_rate_times_velocity(
    b: &Builder,
    arm: &ArmElements<Expr>,
    chain: &Chain,
    link: &LinkGeometry<Expr>,
    ends: &Ends,
    drive: &Drive,
) -> Vec<Expr> {
    let (_, last) = links(b, arm, ends);
    let motions = motions(b, chain, drive);
    let members = chain.stages.iter().flat_map(|stage| &stage.members);
    let all = members.zip(motions.iter().flat_map(|stage| &stage.links));
    let Some((_, motion)) = { all }.find(|(member, _)| member.joint == ends.carrier) else {
        return vec![Expr::ZERO; 6];
    };
    let (sin, cos) = link.file_turn;
    let to_base = |v: &Vector| -> [Expr; 3] {
        let v = turn_x(b, &sin, &cos, v);
        std::array::from_fn(|i| b.dot(&[last.axes[0][i], last.axes[1][i], last.axes[2][i]], &v))
    };
    // The link's own spin carries the tool's origin along.
    let place = plus(b, &link.file_origin, &back_x(b, link.file_turn, &ends.tool.origin));
    let acceleration = plus(b, &motion.acceleration, &motion.spin.times(b, &place));
    let turning = std::array::from_fn(|axis| motion.spin.alpha(b, axis));
    [to_base(&acceleration), to_base(&turning)].concat()
}
