//! The regressor: each parameter's wrench projected onto the joints before it.

use super::body::{Vector, ZERO};
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use super::old_inverse::{rotor_moment, rotor_torque};
use super::old_motion::{Drive, JointMotion, Motion, motions};
use super::old_wrench::Wrench;
use crate::arm::{Arm, Convention, JointKind, Parameter, ParameterKind};
use crate::base::ParameterSet;
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::graph::{Builder, Expr};

/// A joint's axis as seen from a frame further out: what a unit of its speed gives the frame.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Angular velocity of the frame.
    angular: Vector,
    /// Velocity of the frame's origin.
    linear: Vector,
}

/// Y(q, q̇, q̈), row-major n × p: τ = Y·π for the parameters of a set; with reference speeds the regressor of Slotine and
/// Li, Y(q, q̇, q̇ᵣ, q̈ᵣ)·π = B·q̈ᵣ + C·q̇ᵣ + g.
pub fn regressor(
    b: &Builder,
    arm: &Arm,
    elements: &ArmElements<Expr>,
    set: &ParameterSet,
    field: &ConstantField,
    drive: &Drive,
) -> Vec<Expr> {
    let (n, p) = (arm.dof(), set.parameters.len());
    let motions = motions(b, elements, drive);
    let axes = axes(b, elements);
    let mut rows = vec![Expr::ZERO; n * p];
    for (column, parameter) in set.parameters.iter().enumerate() {
        for (carrier, factor) in &parameter.carriers {
            let factor = super::body::constant(b, field, factor);
            let torques = column_of(b, elements, &motions, &axes, drive, *carrier);
            for (row, torque) in torques.into_iter().enumerate() {
                let entry = &mut rows[row * p + column];
                *entry = b.add(entry, &b.mul(&factor, &torque));
            }
        }
    }
    rows
}

/// The torques of a unit of one parameter.
fn column_of(
    b: &Builder,
    arm: &ArmElements<Expr>,
    motions: &[JointMotion],
    axes: &[JointAxes],
    drive: &Drive,
    parameter: Parameter,
) -> Vec<Expr> {
    let i = parameter.link;
    let mut column = vec![Expr::ZERO; arm.joints.len()];
    let (wrench, seen) = if parameter.kind == ParameterKind::Im {
        let Some(ratio) = arm.joints[i].ratio else { return column };
        let (speed, ddq) = (arm.joints[i].speed, drive.accelerations[i]);
        let reference = drive.reference.as_ref().map_or(speed, |r| r[i]);
        column[i] = rotor_torque(b, ratio, ratio, ddq, &motions[i]);
        let moment = rotor_moment(b, ratio, (speed, reference), ddq, &motions[i].before_z);
        (Wrench { force: ZERO, moment }, &axes[i].before_z)
    } else {
        (unit_wrench(b, parameter.kind, &motions[i].link), &axes[i].link)
    };
    for (j, axis) in seen.iter().enumerate() {
        let torque = b.add(&b.dot(&axis.angular, &wrench.moment), &b.dot(&axis.linear, &wrench.force));
        column[j] = b.add(&column[j], &torque);
    }
    column
}

/// The wrench of a unit of one inertial parameter about the origin of its link's frame.
fn unit_wrench(b: &Builder, kind: ParameterKind, motion: &Motion) -> Wrench {
    let [ax, ay, az] = motion.acceleration;
    let first = |axis: usize, moment: Vector| Wrench { force: motion.spin_column(b, axis), moment };
    match kind {
        ParameterKind::M => Wrench { force: motion.acceleration, moment: ZERO },
        ParameterKind::Mx => first(0, [Expr::ZERO, -az, ay]),
        ParameterKind::My => first(1, [az, Expr::ZERO, -ax]),
        ParameterKind::Mz => first(2, [-ay, ax, Expr::ZERO]),
        ParameterKind::Im => Wrench::NONE,
        _ => Wrench { force: ZERO, moment: inertia_moment(b, kind, motion) },
    }
}

/// I α + ω×(I ω) for a tensor with one unit entry.
fn inertia_moment(b: &Builder, kind: ParameterKind, motion: &Motion) -> Vector {
    let a = &motion.alpha;
    let product = |i: usize, j: usize| motion.product(b, i, j);
    let square_difference = |i: usize, j: usize| b.sub(&product(i, i), &product(j, j));
    let plus = |i: usize, x: Expr| b.add(&a[i], &x);
    let minus = |i: usize, x: Expr| b.sub(&a[i], &x);
    let negated = |v: Vector| v.map(|x| -x);
    match kind {
        ParameterKind::Ixx => [a[0], product(0, 2), -product(0, 1)],
        ParameterKind::Iyy => [-product(1, 2), a[1], product(0, 1)],
        ParameterKind::Izz => [product(1, 2), -product(0, 2), a[2]],
        // The tensor's element is minus the product of inertia.
        ParameterKind::Ixy => {
            negated([minus(1, product(0, 2)), plus(0, product(1, 2)), square_difference(0, 1)])
        }
        ParameterKind::Ixz => {
            negated([plus(2, product(0, 1)), square_difference(2, 0), minus(0, product(1, 2))])
        }
        ParameterKind::Iyz => {
            negated([square_difference(1, 2), minus(2, product(0, 1)), plus(1, product(0, 2))])
        }
        _ => ZERO,
    }
}

/// The axes of the joints up to one, seen from two frames at it.
#[derive(Clone, Debug)]
pub struct JointAxes {
    /// Seen from before its screw about z: the joints before it.
    pub before_z: Vec<Axis>,
    /// Seen from its link's frame: the joints up to it.
    pub link: Vec<Axis>,
}

/// Carries every joint's axis outwards.
pub fn axes(b: &Builder, arm: &ArmElements<Expr>) -> Vec<JointAxes> {
    let mut seen: Vec<Axis> = Vec::new();
    let mut all = Vec::with_capacity(arm.joints.len());
    for joint in &arm.joints {
        if arm.convention == Convention::Modified {
            seen.iter_mut().for_each(|axis| about_x(b, joint, axis));
        }
        let before_z = seen.clone();
        seen.iter_mut().for_each(|axis| about_z(b, joint, axis));
        let unit = [Expr::ZERO, Expr::ZERO, Expr::ONE];
        seen.push(match joint.kind {
            JointKind::Revolute => Axis { angular: unit, linear: ZERO },
            JointKind::Prismatic => Axis { angular: ZERO, linear: unit },
        });
        if arm.convention == Convention::Standard {
            seen.iter_mut().for_each(|axis| about_x(b, joint, axis));
        }
        all.push(JointAxes { before_z, link: seen.clone() });
    }
    all
}

fn about_x(b: &Builder, joint: &JointElements<Expr>, axis: &mut Axis) {
    let [_, wy, wz] = axis.angular;
    axis.linear[1] = b.add(&axis.linear[1], &b.mul(&joint.a, &wz));
    axis.linear[2] = b.sub(&axis.linear[2], &b.mul(&joint.a, &wy));
    for v in [&mut axis.angular, &mut axis.linear] {
        *v = turn_x(b, &joint.sin_alpha, &joint.cos_alpha, v);
    }
}

fn about_z(b: &Builder, joint: &JointElements<Expr>, axis: &mut Axis) {
    let [wx, wy, _] = axis.angular;
    axis.linear[0] = b.add(&axis.linear[0], &b.mul(&joint.shift, &wy));
    axis.linear[1] = b.sub(&axis.linear[1], &b.mul(&joint.shift, &wx));
    for v in [&mut axis.angular, &mut axis.linear] {
        *v = turn_z(b, &joint.sin, &joint.cos, v);
    }
}
