//! The forward pass: how every frame of the arm moves.

use super::body::{Vector, ZERO};
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// The motion of a frame relative to the base, in the frame's own axes.
///
/// Accelerations are J·q̈ᵣ + J̇(q, q̇)·q̇ᵣ, symmetric in the speeds q̇ and the reference speeds q̇ᵣ; with q̇ᵣ = q̇ they are the
/// accelerations of the motion itself.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Angular velocity ω at the speeds q̇.
    pub omega: Vector,
    /// Angular velocity ωᵣ at the reference speeds.
    pub reference: Vector,
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

/// What drives the recursion beside the joints' positions and speeds.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Reference speeds q̇ᵣ; `None` where they are the speeds themselves.
    pub reference: Option<Vec<Expr>>,
    /// Accelerations q̈, or reference accelerations q̈ᵣ.
    pub accelerations: Vec<Expr>,
    /// Whether gravity acts.
    pub gravity: bool,
}

/// Runs from the base to the last link.
pub fn motions(b: &Builder, arm: &ArmElements<Expr>, drive: &Drive) -> Vec<JointMotion> {
    let gravity = if drive.gravity { arm.gravity.map(|g| -g) } else { ZERO };
    let mut state = Motion { omega: ZERO, reference: ZERO, alpha: ZERO, acceleration: gravity };
    let mut all = Vec::with_capacity(arm.joints.len());
    for (i, joint) in arm.joints.iter().enumerate() {
        let start = state;
        let rates = Rates {
            speed: joint.speed,
            reference: drive.reference.as_ref().map_or(joint.speed, |r| r[i]),
            acceleration: drive.accelerations[i],
        };
        let motion = match arm.convention {
            Convention::Standard => {
                let after_z = about_z(b, joint, &rates, &start);
                let link = about_x(b, joint, &after_z);
                JointMotion { before_x: after_z, before_z: start, after_z, link }
            }
            Convention::Modified => {
                let before_z = about_x(b, joint, &start);
                let link = about_z(b, joint, &rates, &before_z);
                JointMotion { before_x: start, before_z, after_z: link, link }
            }
        };
        state = motion.link;
        all.push(motion);
    }
    all
}

/// Rates of one joint.
#[derive(Clone, Copy)]
struct Rates {
    speed: Expr,
    reference: Expr,
    acceleration: Expr,
}

/// ½(uᵢ·rⱼ + rᵢ·uⱼ), which is uᵢ·uⱼ where r is u.
fn symmetric_product(b: &Builder, u: &Vector, r: &Vector, i: usize, j: usize) -> Expr {
    if u == r {
        return b.mul(&u[i], &u[j]);
    }
    if i == j {
        return b.mul(&u[i], &r[i]);
    }
    let half = b.constant(&crate::exact::rational::Rational::new(1.into(), 2.into()));
    b.mul(&half, &b.add(&b.mul(&u[i], &r[j]), &b.mul(&r[i], &u[j])))
}

impl Motion {
    /// The product ωᵢ·ωⱼ, symmetric in ω and ωᵣ.
    pub fn product(&self, b: &Builder, i: usize, j: usize) -> Expr {
        symmetric_product(b, &self.omega, &self.reference, i, j)
    }

    /// One column of U = α× + ω×ω×, with v× the matrix of the cross product: the acceleration of a point at unit distance along an axis, relative to the
    /// origin.
    pub fn spin_column(&self, b: &Builder, axis: usize) -> Vector {
        let a = &self.alpha;
        let (i, j, k) = (axis, (axis + 1) % 3, (axis + 2) % 3);
        let mut column = ZERO;
        column[i] = -b.add(&self.product(b, j, j), &self.product(b, k, k));
        column[j] = b.add(&self.product(b, i, j), &a[k]);
        column[k] = b.sub(&self.product(b, i, k), &a[j]);
        column
    }

    /// q̇·ω×z for a joint axis z that is fixed in the frame, symmetric in speeds and reference speeds.
    pub fn axis_turn(&self, b: &Builder, speed: Expr, reference: Expr) -> Vector {
        let across = |i: usize| {
            let u = [self.omega[i], speed, Expr::ZERO];
            let r = [self.reference[i], reference, Expr::ZERO];
            symmetric_product(b, &u, &r, 0, 1)
        };
        [across(1), -across(0), Expr::ZERO]
    }
}

/// v + length·u
pub fn plus_scaled(b: &Builder, v: &Vector, length: Expr, u: &Vector) -> Vector {
    std::array::from_fn(|i| b.add(&v[i], &b.mul(&length, &u[i])))
}

/// Rx(α) Tx(a): nothing moves here.
fn about_x(b: &Builder, joint: &JointElements<Expr>, from: &Motion) -> Motion {
    let mut acceleration = from.acceleration;
    if joint.a != Expr::ZERO {
        acceleration = plus_scaled(b, &acceleration, joint.a, &from.spin_column(b, 0));
    }
    let turn = |v: &Vector| turn_x(b, &joint.sin_alpha, &joint.cos_alpha, v);
    Motion {
        omega: turn(&from.omega),
        reference: turn(&from.reference),
        alpha: turn(&from.alpha),
        acceleration: turn(&acceleration),
    }
}

/// Rz(θ) Tz(d) with the joint's own motion.
fn about_z(b: &Builder, joint: &JointElements<Expr>, rates: &Rates, from: &Motion) -> Motion {
    let mut acceleration = from.acceleration;
    if joint.shift != Expr::ZERO {
        acceleration = plus_scaled(b, &acceleration, joint.shift, &from.spin_column(b, 2));
    }
    let turn = |v: &Vector| turn_z(b, &joint.sin, &joint.cos, v);
    let mut to = Motion {
        omega: turn(&from.omega),
        reference: turn(&from.reference),
        alpha: turn(&from.alpha),
        acceleration: turn(&acceleration),
    };
    let crossed = to.axis_turn(b, rates.speed, rates.reference);
    match joint.kind {
        JointKind::Revolute => {
            to.alpha = std::array::from_fn(|i| b.add(&to.alpha[i], &crossed[i]));
            to.alpha[2] = b.add(&to.alpha[2], &rates.acceleration);
            to.omega[2] = b.add(&to.omega[2], &rates.speed);
            to.reference[2] = b.add(&to.reference[2], &rates.reference);
        }
        JointKind::Prismatic => {
            // Coriolis acceleration 2 ω×(q̇ z).
            let twice = b.integer(2);
            to.acceleration = plus_scaled(b, &to.acceleration, twice, &crossed);
            to.acceleration[2] = b.add(&to.acceleration[2], &rates.acceleration);
        }
    }
    to
}
