//! Momentum, energies, and the velocity terms that momentum gives without a matrix.

use super::body::{Body, Link, Vector, ZERO};
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use super::old_wrench::{Wrench, to_joint, to_link_before};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// Angular velocity and velocity of the origin of a frame, in its axes.
#[derive(Clone, Copy, Debug)]
struct Twist {
    omega: Vector,
    velocity: Vector,
}

/// The twists at a joint: before and after its screw about z, and of the link's frame.
#[derive(Clone, Copy, Debug)]
struct JointTwist {
    before_z: Twist,
    after_z: Twist,
    link: Twist,
}

fn twists(b: &Builder, arm: &ArmElements<Expr>) -> Vec<JointTwist> {
    let mut state = Twist { omega: ZERO, velocity: ZERO };
    let mut all = Vec::with_capacity(arm.joints.len());
    for joint in &arm.joints {
        let before_z = match arm.convention {
            Convention::Standard => state,
            Convention::Modified => about_x(b, joint, &state),
        };
        let after_z = about_z(b, joint, &before_z);
        let link = match arm.convention {
            Convention::Standard => about_x(b, joint, &after_z),
            Convention::Modified => after_z,
        };
        all.push(JointTwist { before_z, after_z, link });
        state = link;
    }
    all
}

fn about_x(b: &Builder, joint: &JointElements<Expr>, from: &Twist) -> Twist {
    let [_, wy, wz] = from.omega;
    let mut velocity = from.velocity;
    velocity[1] = b.add(&velocity[1], &b.mul(&joint.a, &wz));
    velocity[2] = b.sub(&velocity[2], &b.mul(&joint.a, &wy));
    let turn = |v: &Vector| turn_x(b, &joint.sin_alpha, &joint.cos_alpha, v);
    Twist { omega: turn(&from.omega), velocity: turn(&velocity) }
}

fn about_z(b: &Builder, joint: &JointElements<Expr>, from: &Twist) -> Twist {
    let [wx, wy, _] = from.omega;
    let mut velocity = from.velocity;
    velocity[0] = b.add(&velocity[0], &b.mul(&joint.shift, &wy));
    velocity[1] = b.sub(&velocity[1], &b.mul(&joint.shift, &wx));
    let turn = |v: &Vector| turn_z(b, &joint.sin, &joint.cos, v);
    let (mut omega, mut velocity) = (turn(&from.omega), turn(&velocity));
    let moved = match joint.kind {
        JointKind::Revolute => &mut omega[2],
        JointKind::Prismatic => &mut velocity[2],
    };
    *moved = b.add(moved, &joint.speed);
    Twist { omega, velocity }
}

/// Momentum of a body: p = m v + ω×s, and about the origin h = I ω + s×v.
fn body_momentum(b: &Builder, body: &Body, twist: &Twist) -> Wrench {
    let turned = b.cross(&twist.omega, &body.moment);
    let lever = b.cross(&body.moment, &twist.velocity);
    let spin = body.inertia_times(b, &twist.omega);
    Wrench {
        force: std::array::from_fn(|i| b.add(&b.mul(&body.mass, &twist.velocity[i]), &turned[i])),
        moment: std::array::from_fn(|i| b.add(&spin[i], &lever[i])),
    }
}

/// Carries the momentum of all links outside each joint inwards; `at` sees it at the joint, before the rotor's share.
fn momenta(
    b: &Builder,
    arm: &ArmElements<Expr>,
    links: &[Link],
    mut at: impl FnMut(usize, &JointTwist, &Wrench),
) {
    let twists = twists(b, arm);
    let mut outer = Wrench::NONE;
    for i in (0..links.len()).rev() {
        let joint = &arm.joints[i];
        let total = body_momentum(b, &links[i].body, &twists[i].link).plus(b, &outer);
        let here = to_joint(b, arm.convention, joint, &total);
        at(i, &twists[i], &here);
        let mut before = here.back_z(b, joint);
        if let Some(ratio) = joint.ratio {
            let spin = b.mul(&b.mul(&ratio, &links[i].rotor), &joint.speed);
            before = before.plus(b, &Wrench { force: ZERO, moment: [Expr::ZERO, Expr::ZERO, spin] });
        }
        outer = to_link_before(b, arm.convention, joint, &before);
    }
}

/// The generalised momentum B·q̇ = ∂T/∂q̇.
pub fn momentum(b: &Builder, arm: &ArmElements<Expr>, links: &[Link]) -> Vec<Expr> {
    let mut result = vec![Expr::ZERO; links.len()];
    momenta(b, arm, links, |i, twist, here| {
        result[i] = here.along_joint(arm.joints[i].kind);
        if let Some(ratio) = arm.joints[i].ratio {
            let turning = b.add(&b.mul(&ratio, &arm.joints[i].speed), &twist.before_z.omega[2]);
            let rotor = b.mul(&ratio, &links[i].rotor);
            result[i] = b.add(&result[i], &b.mul(&rotor, &turning));
        }
    });
    result
}

/// Cᵀ·q̇, which for Christoffel symbols is ∂T/∂q = −z·(ω×h + v×p) at each joint (what a momentum observer needs).
pub fn coriolis_transpose_times_speed(b: &Builder, arm: &ArmElements<Expr>, links: &[Link]) -> Vec<Expr> {
    let mut result = vec![Expr::ZERO; links.len()];
    let along_z = |u: &Vector, v: &Vector| b.sub(&b.mul(&u[0], &v[1]), &b.mul(&u[1], &v[0]));
    momenta(b, arm, links, |i, twist, here| {
        let Twist { omega, velocity } = &twist.after_z;
        result[i] = match arm.joints[i].kind {
            JointKind::Revolute => -b.add(&along_z(omega, &here.moment), &along_z(velocity, &here.force)),
            JointKind::Prismatic => -along_z(omega, &here.force),
        };
    });
    result
}

/// T = ½ q̇ᵀ·B·q̇.
pub fn kinetic_energy(b: &Builder, arm: &ArmElements<Expr>, links: &[Link]) -> Expr {
    let momentum = momentum(b, arm, links);
    let twice = arm
        .joints
        .iter()
        .zip(&momentum)
        .fold(Expr::ZERO, |sum, (joint, p)| b.add(&sum, &b.mul(&joint.speed, p)));
    b.mul(&b.constant(&crate::exact::rational::Rational::new(1.into(), 2.into())), &twice)
}
