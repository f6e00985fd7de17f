//! Forces and moments carried inwards, from a frame to the one before.

use super::body::Vector;
use super::elements::{JointElements, turn_x, turn_z};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// A force and a moment about the origin of a frame, in its axes.
#[derive(Clone, Copy, Debug)]
pub struct Wrench {
    /// Force.
    pub force: Vector,
    /// Moment about the origin.
    pub moment: Vector,
}

impl Wrench {
    /// No force, no moment.
    pub const NONE: Wrench = Wrench { force: super::body::ZERO, moment: super::body::ZERO };

    /// The sum of two wrenches about one origin.
    pub fn plus(&self, b: &Builder, other: &Wrench) -> Wrench {
        let sum = |u: &Vector, v: &Vector| std::array::from_fn(|i| b.add(&u[i], &v[i]));
        Wrench { force: sum(&self.force, &other.force), moment: sum(&self.moment, &other.moment) }
    }

    /// Seen from the frame before the screw about x: turned back, its moment about the origin there.
    pub fn back_x(&self, b: &Builder, joint: &JointElements<Expr>) -> Wrench {
        let turn = |v: &Vector| turn_x(b, &-joint.sin_alpha, &joint.cos_alpha, v);
        let (force, mut moment) = (turn(&self.force), turn(&self.moment));
        // (a, 0, 0) × f
        moment[1] = b.sub(&moment[1], &b.mul(&joint.a, &force[2]));
        moment[2] = b.add(&moment[2], &b.mul(&joint.a, &force[1]));
        Wrench { force, moment }
    }

    /// Seen from the frame before the screw about z.
    pub fn back_z(&self, b: &Builder, joint: &JointElements<Expr>) -> Wrench {
        let turn = |v: &Vector| turn_z(b, &-joint.sin, &joint.cos, v);
        let (force, mut moment) = (turn(&self.force), turn(&self.moment));
        // (0, 0, d) × f
        moment[0] = b.sub(&moment[0], &b.mul(&joint.shift, &force[1]));
        moment[1] = b.add(&moment[1], &b.mul(&joint.shift, &force[0]));
        Wrench { force, moment }
    }

    /// Its component along the joint, in a frame whose z is the joint axis: torque or force.
    pub fn along_joint(&self, kind: JointKind) -> Expr {
        match kind {
            JointKind::Revolute => self.moment[2],
            JointKind::Prismatic => self.force[2],
        }
    }
}

/// Carries a wrench about the origin of a link's frame to its joint (z the joint axis, before the twist of a standard
/// frame).
pub fn to_joint(b: &Builder, convention: Convention, joint: &JointElements<Expr>, wrench: &Wrench) -> Wrench {
    match convention {
        Convention::Standard => wrench.back_x(b, joint),
        Convention::Modified => *wrench,
    }
}

/// Carries a wrench from before the joint's screw about z to the frame of the link before.
pub fn to_link_before(
    b: &Builder,
    convention: Convention,
    joint: &JointElements<Expr>,
    wrench: &Wrench,
) -> Wrench {
    match convention {
        Convention::Standard => *wrench,
        Convention::Modified => wrench.back_x(b, joint),
    }
}
