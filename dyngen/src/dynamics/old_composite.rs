//! Composite bodies carried inwards: the mass matrix.

use super::body::{Body, Link, ZERO};
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use super::old_wrench::{Wrench, to_link_before};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// B(q), row-major n × n, by the composite rigid body recursion.
pub fn mass_matrix(b: &Builder, arm: &ArmElements<Expr>, links: &[Link]) -> Vec<Expr> {
    let n = links.len();
    let mut matrix = vec![Expr::ZERO; n * n];
    let mut outer = Body::NONE;
    for i in (0..n).rev() {
        let joint = &arm.joints[i];
        let composite = links[i].body.plus(b, &outer);
        let at_joint = body_to_joint(b, arm.convention, joint, &composite);
        let own = unit_acceleration(&at_joint, joint.kind);
        let mut before = own.back_z(b, joint);
        let mut diagonal = own.along_joint(joint.kind);
        if let Some(ratio) = joint.ratio {
            let rotor = b.mul(&ratio, &links[i].rotor);
            diagonal = b.add(&diagonal, &b.mul(&ratio, &rotor));
            before = before.plus(b, &Wrench { force: ZERO, moment: [Expr::ZERO, Expr::ZERO, rotor] });
        }
        matrix[i * n + i] = diagonal;
        project_inwards(b, arm, i, before, |j, torque| {
            matrix[i * n + j] = torque;
            matrix[j * n + i] = torque;
        });
        outer = body_to_link_before(b, arm.convention, joint, &at_joint);
    }
    matrix
}

/// Carries a wrench from before joint i's screw about z through all joints before it and reports what each feels.
pub fn project_inwards(
    b: &Builder,
    arm: &ArmElements<Expr>,
    i: usize,
    before_z: Wrench,
    mut feels: impl FnMut(usize, Expr),
) {
    let mut wrench = to_link_before(b, arm.convention, &arm.joints[i], &before_z);
    for j in (0..i).rev() {
        let joint = &arm.joints[j];
        let at_joint = super::old_wrench::to_joint(b, arm.convention, joint, &wrench);
        feels(j, at_joint.along_joint(joint.kind));
        wrench = to_link_before(b, arm.convention, joint, &at_joint.back_z(b, joint));
    }
}

/// The wrench for a unit acceleration of a joint whose axis is z: f = z×s, n = I z, or f = m z, n = s×z.
pub fn unit_acceleration(body: &Body, kind: JointKind) -> Wrench {
    let [sx, sy, _] = body.moment;
    match kind {
        JointKind::Revolute => {
            let [yz, xz, _] = body.products;
            Wrench { force: [-sy, sx, Expr::ZERO], moment: [-xz, -yz, body.inertia[2]] }
        }
        JointKind::Prismatic => {
            Wrench { force: [Expr::ZERO, Expr::ZERO, body.mass], moment: [sy, -sx, Expr::ZERO] }
        }
    }
}

/// A link's composite seen from its joint.
pub fn body_to_joint(b: &Builder, convention: Convention, joint: &JointElements<Expr>, body: &Body) -> Body {
    match convention {
        Convention::Standard => body_back_x(b, joint, body),
        Convention::Modified => *body,
    }
}

/// A composite at its joint seen from the link before.
pub fn body_to_link_before(
    b: &Builder,
    convention: Convention,
    joint: &JointElements<Expr>,
    body: &Body,
) -> Body {
    let before_z = body_back_z(b, joint, body);
    match convention {
        Convention::Standard => before_z,
        Convention::Modified => body_back_x(b, joint, &before_z),
    }
}

/// A body seen from before the screw about x.
pub fn body_back_x(b: &Builder, joint: &JointElements<Expr>, body: &Body) -> Body {
    let [xx, yy, zz] = body.inertia;
    let [yz, xz, xy] = body.products;
    let moment = turn_x(b, &-joint.sin_alpha, &joint.cos_alpha, &body.moment);
    // Products turn like a vector across the axis; the block across it turns by the double angle.
    let [_, xy, xz] = turn_x(b, &-joint.sin_alpha, &joint.cos_alpha, &[Expr::ZERO, xy, xz]);
    let (yy, zz, yz) = turn_block(b, joint.sin_alpha, joint.cos_alpha, yy, zz, yz);
    let turned = Body { mass: body.mass, moment, inertia: [xx, yy, zz], products: [yz, xz, xy] };
    shift(b, &turned, 0, joint.a)
}

/// A body seen from before the screw about z.
pub fn body_back_z(b: &Builder, joint: &JointElements<Expr>, body: &Body) -> Body {
    let [xx, yy, zz] = body.inertia;
    let [yz, xz, xy] = body.products;
    let moment = turn_z(b, &-joint.sin, &joint.cos, &body.moment);
    let [xz, yz, _] = turn_z(b, &-joint.sin, &joint.cos, &[xz, yz, Expr::ZERO]);
    let (xx, yy, xy) = turn_block(b, joint.sin, joint.cos, xx, yy, xy);
    let turned = Body { mass: body.mass, moment, inertia: [xx, yy, zz], products: [yz, xz, xy] };
    shift(b, &turned, 2, joint.shift)
}

/// Turns the 2×2 block of an inertia tensor with diagonal (p, r) and product of inertia q by an angle: the tensor's
/// off-diagonal element is −q.
fn turn_block(b: &Builder, s: Expr, c: Expr, p: Expr, r: Expr, q: Expr) -> (Expr, Expr, Expr) {
    // u = s(p − r) − 2 c q; p' = p − s u, r' = r + s u, q' = −(c u + q)
    let twice = b.add(&q, &q);
    let u = b.sub(&b.mul(&s, &b.sub(&p, &r)), &b.mul(&c, &twice));
    let su = b.mul(&s, &u);
    (b.sub(&p, &su), b.add(&r, &su), -b.add(&b.mul(&c, &u), &q))
}

/// The body about an origin that lies `length` before its own along an axis.
fn shift(b: &Builder, body: &Body, axis: usize, length: Expr) -> Body {
    if length == Expr::ZERO {
        return *body;
    }
    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut shifted = *body;
    let reach = b.mul(&length, &body.mass);
    shifted.moment[axis] = b.add(&body.moment[axis], &reach);
    // I + 2 l s + m l² across the axis
    let parallel = b.mul(&length, &b.add(&body.moment[axis], &shifted.moment[axis]));
    shifted.inertia[j] = b.add(&body.inertia[j], &parallel);
    shifted.inertia[k] = b.add(&body.inertia[k], &parallel);
    // products[k] couples the two axes other than k
    shifted.products[k] = b.add(&body.products[k], &b.mul(&length, &body.moment[j]));
    shifted.products[j] = b.add(&body.products[j], &b.mul(&length, &body.moment[k]));
    shifted
}
