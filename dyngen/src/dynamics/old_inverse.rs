//! Inverse dynamics by the Newton–Euler recursion, and gravity as its part without motion.

use super::body::{Body, Link, Vector, ZERO};
use super::elements::ArmElements;
use super::old_motion::{Drive, JointMotion, Motion, motions};
use super::old_wrench::{Wrench, to_joint, to_link_before};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// The torques that a motion needs: τ = B(q)·q̈ + C(q, q̇)·q̇ + g(q).
pub fn inverse_dynamics(
    b: &Builder,
    arm: &ArmElements<Expr>,
    links: &[Link],
    accelerations: &[Expr],
    gravity: bool,
) -> Vec<Expr> {
    let drive = Drive { reference: None, accelerations: accelerations.to_vec(), gravity };
    let motions = motions(b, arm, &drive);
    let mut torques = vec![Expr::ZERO; links.len()];
    let mut outer = Wrench::NONE;
    for i in (0..links.len()).rev() {
        let (joint, motion, link) = (&arm.joints[i], &motions[i], &links[i]);
        let total = body_wrench(b, &link.body, &motion.link).plus(b, &outer);
        let at_joint = to_joint(b, arm.convention, joint, &total);
        torques[i] = at_joint.along_joint(joint.kind);
        let mut before = at_joint.back_z(b, joint);
        if let Some(ratio) = joint.ratio {
            let rotor = b.mul(&ratio, &link.rotor);
            torques[i] = b.add(&torques[i], &rotor_torque(b, rotor, ratio, accelerations[i], motion));
            let speeds = (joint.speed, joint.speed);
            let moment = rotor_moment(b, rotor, speeds, accelerations[i], &motion.before_z);
            before = before.plus(b, &Wrench { force: ZERO, moment });
        }
        outer = to_link_before(b, arm.convention, joint, &before);
    }
    torques
}

/// The torques that hold the arm still: g(q) = ∂U/∂q.
pub fn gravity(b: &Builder, arm: &ArmElements<Expr>, links: &[Link]) -> Vec<Expr> {
    let mut still = arm.clone();
    still.joints.iter_mut().for_each(|joint| joint.speed = Expr::ZERO);
    inverse_dynamics(b, &still, links, &vec![Expr::ZERO; links.len()], true)
}

/// What a body's motion needs: f = m a + U s, n = I α + ω×(I ω) + s×a, with s its first moment.
fn body_wrench(b: &Builder, body: &Body, motion: &Motion) -> Wrench {
    let mut force: Vector = std::array::from_fn(|i| b.mul(&body.mass, &motion.acceleration[i]));
    for (axis, moment) in body.moment.iter().enumerate() {
        if *moment != Expr::ZERO {
            force = super::old_motion::plus_scaled(b, &force, *moment, &motion.spin_column(b, axis));
        }
    }
    let euler = body.inertia_times(b, &motion.alpha);
    let gyroscopic = b.cross(&motion.omega, &body.inertia_times(b, &motion.omega));
    let lever = b.cross(&body.moment, &motion.acceleration);
    let moment = std::array::from_fn(|i| b.add(&b.add(&euler[i], &gyroscopic[i]), &lever[i]));
    Wrench { force, moment }
}

/// On the joint's own torque: k·Im·(k q̈ + z·α of the link before).
pub fn rotor_torque(b: &Builder, rotor: Expr, ratio: Expr, ddq: Expr, motion: &JointMotion) -> Expr {
    b.mul(&rotor, &b.add(&b.mul(&ratio, &ddq), &motion.before_z.alpha[2]))
}

/// On the link before: the rate of the rotor's own angular momentum, k·Im·(q̈ z + q̇ ω×z); `speeds` are q̇ and q̇ᵣ.
pub fn rotor_moment(b: &Builder, rotor: Expr, speeds: (Expr, Expr), ddq: Expr, before: &Motion) -> Vector {
    let turned = before.axis_turn(b, speeds.0, speeds.1);
    [b.mul(&rotor, &turned[0]), b.mul(&rotor, &turned[1]), b.mul(&rotor, &ddq)]
}
