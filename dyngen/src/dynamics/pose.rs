//! Forward kinematics: where the last link is.

use super::body::Vector;
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use crate::arm::Convention;
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// The homogeneous transform of the last link's frame to the base, row-major 4 × 4.
pub fn forward_kinematics(b: &Builder, arm: &ArmElements<Expr>) -> Vec<Expr> {
    // Turning back the unit vectors and the point from the last frame to the base.
    let unit = |i: usize| -> Vector { std::array::from_fn(|j| if i == j { Expr::ONE } else { Expr::ZERO }) };
    let mut columns = [unit(0), unit(1), unit(2)];
    let mut point = [Expr::ZERO; 3];
    for joint in arm.joints.iter().rev() {
        let steps: [fn(&Builder, &JointElements<Expr>, &mut Vector, bool); 2] = match arm.convention {
            Convention::Standard => [back_x, back_z],
            Convention::Modified => [back_z, back_x],
        };
        for step in steps {
            columns.iter_mut().for_each(|c| step(b, joint, c, false));
            step(b, joint, &mut point, true);
        }
    }
    let mut rows = Vec::with_capacity(16);
    for i in 0..3 {
        rows.extend([columns[0][i], columns[1][i], columns[2][i], point[i]]);
    }
    rows.extend([Expr::ZERO, Expr::ZERO, Expr::ZERO, Expr::ONE]);
    rows
}

fn back_x(b: &Builder, joint: &JointElements<Expr>, v: &mut Vector, is_point: bool) {
    *v = turn_x(b, &-joint.sin_alpha, &joint.cos_alpha, v);
    if is_point {
        v[0] = b.add(&v[0], &joint.a);
    }
}

fn back_z(b: &Builder, joint: &JointElements<Expr>, v: &mut Vector, is_point: bool) {
    *v = turn_z(b, &-joint.sin, &joint.cos, v);
    if is_point {
        v[2] = b.add(&v[2], &joint.shift);
    }
}
