//! The forward pass: how every frame of the arm moves.

use super::body::{Vector, ZERO};
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// The motion of a frame relative to the base, in the frame's own axes.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Angular velocity ω.
    pub omega: Vector,
    /// Angular acceleration.
    pub alpha: Vector,
    /// Acceleration of the origin, less gravity.
    pub acceleration: Vector,
}

/// How the frames at a joint move. One of its two screws turns by the twist about x, the other holds the joint and turns about z.
#[derive(Clone, Copy, Debug)]
pub struct JointMotion {
    /// Before the screw about x.
    pub before_x: Motion,
    /// Before the screw about z: z is the joint axis, fixed in the link before.
    pub before_z: Motion,
    /// After the screw about z: z is the joint axis, the frame moves with the joint.
    pub after_z: Motion,
    /// The link's own frame.
    pub link: Motion,
}

/// Runs from the base to the last link. `accelerations` may be zeros, and gravity may be left out.
pub fn motions(
    b: &Builder,
    arm: &ArmElements<Expr>,
    accelerations: &[Expr],
    with_gravity: bool,
) -> Vec<JointMotion> {
    let gravity = if with_gravity { arm.gravity.map(|g| -g) } else { ZERO };
    let mut state = Motion { omega: ZERO, alpha: ZERO, acceleration: gravity };
    let mut all = Vec::with_capacity(arm.joints.len());
    for (joint, acceleration) in arm.joints.iter().zip(accelerations) {
        let start = state;
        let motion = match arm.convention {
            Convention::Standard => {
                let after_z = about_z(b, joint, *acceleration, &start);
                let link = about_x(b, joint, &after_z);
                JointMotion { before_x: after_z, before_z: start, after_z, link }
            }
            Convention::Modified => {
                let before_z = about_x(b, joint, &start);
                let link = about_z(b, joint, *acceleration, &before_z);
                JointMotion { before_x: start, before_z, after_z: link, link }
            }
        };
        state = motion.link;
        all.push(motion);
    }
    all
}

/// One column of U = [α×] + [ω×][ω×]: the acceleration of a point at unit distance along an axis, relative to the origin.
pub fn spin_column(b: &Builder, motion: &Motion, axis: usize) -> Vector {
    let [w, a] = [&motion.omega, &motion.alpha];
    let (i, j, k) = (axis, (axis + 1) % 3, (axis + 2) % 3);
    let mut column = ZERO;
    column[i] = -b.add(&b.mul(&w[j], &w[j]), &b.mul(&w[k], &w[k]));
    column[j] = b.add(&b.mul(&w[i], &w[j]), &a[k]);
    column[k] = b.sub(&b.mul(&w[i], &w[k]), &a[j]);
    column
}

/// v + length·u
pub fn plus_scaled(b: &Builder, v: &Vector, length: Expr, u: &Vector) -> Vector {
    std::array::from_fn(|i| b.add(&v[i], &b.mul(&length, &u[i])))
}

/// Rx(α) Tx(a): nothing moves here.
fn about_x(b: &Builder, joint: &JointElements<Expr>, from: &Motion) -> Motion {
    let mut acceleration = from.acceleration;
    if joint.a != Expr::ZERO {
        acceleration = plus_scaled(b, &acceleration, joint.a, &spin_column(b, from, 0));
    }
    let turn = |v: &Vector| turn_x(b, &joint.sin_alpha, &joint.cos_alpha, v);
    Motion { omega: turn(&from.omega), alpha: turn(&from.alpha), acceleration: turn(&acceleration) }
}

/// Rz(θ) Tz(d) with the joint's own motion.
fn about_z(b: &Builder, joint: &JointElements<Expr>, ddq: Expr, from: &Motion) -> Motion {
    let mut acceleration = from.acceleration;
    if joint.shift != Expr::ZERO {
        acceleration = plus_scaled(b, &acceleration, joint.shift, &spin_column(b, from, 2));
    }
    let turn = |v: &Vector| turn_z(b, &joint.sin, &joint.cos, v);
    let (mut omega, mut alpha, mut acceleration) =
        (turn(&from.omega), turn(&from.alpha), turn(&acceleration));
    let dq = joint.speed;
    match joint.kind {
        JointKind::Revolute => {
            // ω×(q̇ z) of the frame that turns.
            alpha[0] = b.add(&alpha[0], &b.mul(&omega[1], &dq));
            alpha[1] = b.sub(&alpha[1], &b.mul(&omega[0], &dq));
            alpha[2] = b.add(&alpha[2], &ddq);
            omega[2] = b.add(&omega[2], &dq);
        }
        JointKind::Prismatic => {
            // Coriolis acceleration 2 ω×(q̇ z).
            let twice = b.mul(&b.integer(2), &dq);
            acceleration[0] = b.add(&acceleration[0], &b.mul(&omega[1], &twice));
            acceleration[1] = b.sub(&acceleration[1], &b.mul(&omega[0], &twice));
            acceleration[2] = b.add(&acceleration[2], &ddq);
        }
    }
    Motion { omega, alpha, acceleration }
}
