//! The Coriolis matrix of Christoffel symbols, for which Ḃ − 2C is skew-symmetric.
//!
//! A point of the arm at x moves by ẋ = Σ Jⱼ q̇ⱼ, and ∂Jⱼ/∂qₖ = ∂²x/∂qⱼ∂qₖ is symmetric in j and k, so
//! C = Σ m JᵀJ̇ over all points is the matrix of Christoffel symbols. With r from the origin of a frame,
//! Jⱼ = yⱼ + zⱼ×r and J̇ⱼ = ẏⱼ + żⱼ×r + zⱼ×ṙ, so beside a composite's mass, first moment s and inertia I only
//! Q = Σ m ṙ and K = Σ m ṙ rᵀ are needed. One pass inwards carries them; nothing is differentiated.

use super::body::{Body, Link, Vector, ZERO};
use super::old_composite::{body_back_x, body_back_z};
use super::elements::{ArmElements, JointElements, turn_x, turn_z};
use super::old_motion::{Drive, JointMotion, Motion, motions};
use super::old_wrench::{Wrench, to_joint, to_link_before};
use crate::arm::{Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// A composite body with its momentum relative to the origin.
#[derive(Clone, Copy, Debug)]
struct Moving {
    body: Body,
    /// Q = Σ m ṙ
    momentum: Vector,
    /// K = Σ m ṙ rᵀ, by columns.
    spread: [Vector; 3],
}

/// What a row of C below the diagonal is made of: C_ij = ẏⱼ·force + żⱼ·moment + zⱼ·drift.
#[derive(Clone, Copy, Debug)]
struct Row {
    wrench: Wrench,
    drift: Vector,
}

/// C(q, q̇), row-major n × n.
pub fn coriolis_matrix(b: &Builder, arm: &ArmElements<Expr>, links: &[Link]) -> Vec<Expr> {
    let n = links.len();
    let still = Drive { reference: None, accelerations: vec![Expr::ZERO; n], gravity: false };
    let motions = motions(b, arm, &still);
    let mut matrix = vec![Expr::ZERO; n * n];
    let mut outer = Moving::NONE;
    for i in (0..n).rev() {
        let (joint, motion) = (&arm.joints[i], &motions[i]);
        let composite = Moving::of_link(b, &links[i].body, &motion.link).plus(b, &outer);
        let at_joint = match arm.convention {
            Convention::Standard => composite.back_x(b, joint, &motion.before_x),
            Convention::Modified => composite,
        };
        let column = at_joint.column(b, joint.kind, &motion.after_z);
        let row = at_joint.row(b, joint.kind);
        matrix[i * n + i] = column.along_joint(joint.kind);

        let mut column = column.back_z(b, joint);
        let mut row = row.back_z(b, joint, &motion.before_z);
        let mut before = at_joint.back_z(b, joint, &motion.before_z);
        if let Some(ratio) = joint.ratio {
            let rotor = b.mul(&ratio, &links[i].rotor);
            add_rotor(b, rotor, joint.speed, &motion.before_z, &mut column, &mut row, &mut before);
        }
        project(b, arm, &motions, i, column, row, |j, upper, lower| {
            matrix[j * n + i] = upper;
            matrix[i * n + j] = lower;
        });
        outer = match arm.convention {
            Convention::Standard => before,
            Convention::Modified => before.back_x(b, joint, &motion.before_x),
        };
    }
    matrix
}

/// The rotor's terms: with κ = k·Im, C_ij and C_ji get ½κ(ω×zᵢ)·zⱼ, C_ij also κ zᵢ·żⱼ, and for two joints further in
/// C_jl gets ½κ q̇ᵢ zⱼ·(zₗ×zᵢ), which is what −½κ q̇ᵢ [zᵢ×] adds to tr K − K.
fn add_rotor(
    b: &Builder,
    rotor: Expr,
    dq: Expr,
    before: &Motion,
    column: &mut Wrench,
    row: &mut Row,
    composite: &mut Moving,
) {
    let half = b.constant(&crate::exact::rational::Rational::new(1.into(), 2.into()));
    let half_rotor = b.mul(&half, &rotor);
    let [wx, wy, _] = before.omega;
    let turning = [b.mul(&half_rotor, &wy), -b.mul(&half_rotor, &wx), Expr::ZERO];
    let add = |v: &mut Vector, u: &Vector| *v = std::array::from_fn(|i| b.add(&v[i], &u[i]));
    add(&mut column.moment, &turning);
    add(&mut row.drift, &turning);
    add(&mut row.wrench.moment, &[Expr::ZERO, Expr::ZERO, rotor]);
    // [z×] has columns y and −x.
    let spin = b.mul(&half_rotor, &dq);
    composite.spread[0][1] = b.add(&composite.spread[0][1], &spin);
    composite.spread[1][0] = b.sub(&composite.spread[1][0], &spin);
}

/// Carries a column and a row from before joint i's screw about z inwards and reports C_ji and C_ij.
fn project(
    b: &Builder,
    arm: &ArmElements<Expr>,
    motions: &[JointMotion],
    i: usize,
    column: Wrench,
    row: Row,
    mut entry: impl FnMut(usize, Expr, Expr),
) {
    let (mut column, mut row) = match arm.convention {
        Convention::Standard => (column, row),
        Convention::Modified => {
            let before = &motions[i].before_x;
            (column.back_x(b, &arm.joints[i]), row.back_x(b, &arm.joints[i], before))
        }
    };
    for j in (0..i).rev() {
        let (joint, motion) = (&arm.joints[j], &motions[j]);
        let column_here = to_joint(b, arm.convention, joint, &column);
        let row_here = match arm.convention {
            Convention::Standard => row.back_x(b, joint, &motion.before_x),
            Convention::Modified => row,
        };
        entry(j, column_here.along_joint(joint.kind), row_here.entry(b, joint.kind, &motion.after_z));
        column = to_link_before(b, arm.convention, joint, &column_here.back_z(b, joint));
        let row_before = row_here.back_z(b, joint, &motion.before_z);
        row = match arm.convention {
            Convention::Standard => row_before,
            Convention::Modified => row_before.back_x(b, joint, &motion.before_x),
        };
    }
}

/// The rate of change of a joint's axis z: ω×z, in a frame that has it as z.
fn axis_rate(motion: &Motion) -> Vector {
    [motion.omega[1], -motion.omega[0], Expr::ZERO]
}

const Z: Vector = [Expr::ZERO, Expr::ZERO, Expr::ONE];

impl Moving {
    const NONE: Moving = Moving { body: Body::NONE, momentum: ZERO, spread: [ZERO; 3] };

    /// A link moving with its frame: Q = ω×s and K = [ω×] J, with J = ½ tr(I) − I the second moments.
    fn of_link(b: &Builder, body: &Body, motion: &Motion) -> Moving {
        let half = b.constant(&crate::exact::rational::Rational::new(1.into(), 2.into()));
        let [xx, yy, zz] = body.inertia;
        let second = |p: Expr, q: Expr, r: Expr| b.mul(&half, &b.sub(&b.add(&p, &q), &r));
        let [yz, xz, xy] = body.products;
        let columns =
            [[second(yy, zz, xx), xy, xz], [xy, second(zz, xx, yy), yz], [xz, yz, second(xx, yy, zz)]];
        Moving {
            body: *body,
            momentum: b.cross(&motion.omega, &body.moment),
            spread: columns.map(|column| b.cross(&motion.omega, &column)),
        }
    }

    fn plus(&self, b: &Builder, other: &Moving) -> Moving {
        let sum = |u: &Vector, v: &Vector| -> Vector { std::array::from_fn(|i| b.add(&u[i], &v[i])) };
        Moving {
            body: self.body.plus(b, &other.body),
            momentum: sum(&self.momentum, &other.momentum),
            spread: std::array::from_fn(|i| sum(&self.spread[i], &other.spread[i])),
        }
    }

    /// (tr K − K)·z, or (tr K − Kᵀ)·z.
    fn spread_times_z(&self, b: &Builder, transposed: bool) -> Vector {
        let k = &self.spread;
        let (x, y) = if transposed { (k[0][2], k[1][2]) } else { (k[2][0], k[2][1]) };
        [-x, -y, b.add(&k[0][0], &k[1][1])]
    }

    /// Force and moment that column j of C makes on the composite: Σ m J̇ and Σ r × m J̇, seen at the joint.
    fn column(&self, b: &Builder, kind: JointKind, motion: &Motion) -> Wrench {
        let rate = axis_rate(motion);
        let s = &self.body.moment;
        match kind {
            JointKind::Revolute => {
                let (turned, carried) = (b.cross(&rate, s), b.cross(&Z, &self.momentum));
                let (inertia, spread) = (self.body.inertia_times(b, &rate), self.spread_times_z(b, false));
                Wrench {
                    force: std::array::from_fn(|i| b.add(&turned[i], &carried[i])),
                    moment: std::array::from_fn(|i| b.add(&inertia[i], &spread[i])),
                }
            }
            JointKind::Prismatic => {
                Wrench { force: rate.map(|r| b.mul(&self.body.mass, &r)), moment: b.cross(s, &rate) }
            }
        }
    }

    /// What row i of C makes of the axes of the joints before it.
    fn row(&self, b: &Builder, kind: JointKind) -> Row {
        let wrench = super::old_composite::unit_acceleration(&self.body, kind);
        let drift = match kind {
            JointKind::Revolute => self.spread_times_z(b, true),
            JointKind::Prismatic => b.cross(&self.momentum, &Z),
        };
        Row { wrench, drift }
    }

    fn back_x(&self, b: &Builder, joint: &JointElements<Expr>, before: &Motion) -> Moving {
        let turn = |v: &Vector| turn_x(b, &-joint.sin_alpha, &joint.cos_alpha, v);
        let rate = x_rate(b, joint, before);
        self.moved(b, body_back_x(b, joint, &self.body), turn, 0, joint.a, &rate)
    }

    fn back_z(&self, b: &Builder, joint: &JointElements<Expr>, before: &Motion) -> Moving {
        let turn = |v: &Vector| turn_z(b, &-joint.sin, &joint.cos, v);
        let rate = z_rate(b, joint, before);
        self.moved(b, body_back_z(b, joint, &self.body), turn, 2, joint.shift, &rate)
    }

    /// About another origin, from which this one lies at p along an axis and moves by ṗ: Q + m ṗ, and
    /// K + Q pᵀ + ṗ (s + m p)ᵀ.
    fn moved(
        &self,
        b: &Builder,
        body: Body,
        turn: impl Fn(&Vector) -> Vector,
        axis: usize,
        length: Expr,
        rate: &Vector,
    ) -> Moving {
        let momentum = turn(&self.momentum);
        let rows: [Vector; 3] = {
            let columns = self.spread.map(|c| turn(&c));
            std::array::from_fn(|r| turn(&std::array::from_fn(|c| columns[c][r])))
        };
        let mut spread: [Vector; 3] = std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]));
        for (c, column) in spread.iter_mut().enumerate() {
            for r in 0..3 {
                if c == axis {
                    column[r] = b.add(&column[r], &b.mul(&length, &momentum[r]));
                }
                column[r] = b.add(&column[r], &b.mul(&rate[r], &body.moment[c]));
            }
        }
        let momentum = std::array::from_fn(|i| b.add(&momentum[i], &b.mul(&body.mass, &rate[i])));
        Moving { body, momentum, spread }
    }
}

/// ṗ of the origin after the screw about x.
fn x_rate(b: &Builder, joint: &JointElements<Expr>, before: &Motion) -> Vector {
    let [_, wy, wz] = before.omega;
    [Expr::ZERO, b.mul(&joint.a, &wz), -b.mul(&joint.a, &wy)]
}

/// ṗ of the origin after the screw about z.
fn z_rate(b: &Builder, joint: &JointElements<Expr>, before: &Motion) -> Vector {
    let [wx, wy, _] = before.omega;
    let slide = match joint.kind {
        JointKind::Revolute => Expr::ZERO,
        JointKind::Prismatic => joint.speed,
    };
    [b.mul(&joint.shift, &wy), -b.mul(&joint.shift, &wx), slide]
}

impl Row {
    /// ẏⱼ seen from the new origin is ẏⱼ + żⱼ×p + zⱼ×ṗ, so the drift gains ṗ × force.
    fn back_x(&self, b: &Builder, joint: &JointElements<Expr>, before: &Motion) -> Row {
        let wrench = self.wrench.back_x(b, joint);
        let drift = turn_x(b, &-joint.sin_alpha, &joint.cos_alpha, &self.drift);
        Row { wrench, drift: gain(b, drift, &x_rate(b, joint, before), &wrench.force) }
    }

    fn back_z(&self, b: &Builder, joint: &JointElements<Expr>, before: &Motion) -> Row {
        let wrench = self.wrench.back_z(b, joint);
        let drift = turn_z(b, &-joint.sin, &joint.cos, &self.drift);
        Row { wrench, drift: gain(b, drift, &z_rate(b, joint, before), &wrench.force) }
    }

    /// C_ij at joint j, where the origin lies on a revolute axis (yⱼ = ẏⱼ = 0) and zⱼ is z.
    fn entry(&self, b: &Builder, kind: JointKind, motion: &Motion) -> Expr {
        let rate = axis_rate(motion);
        match kind {
            JointKind::Revolute => b.add(&b.dot(&rate, &self.wrench.moment), &self.drift[2]),
            JointKind::Prismatic => b.dot(&rate, &self.wrench.force),
        }
    }
}

fn gain(b: &Builder, drift: Vector, rate: &Vector, force: &Vector) -> Vector {
    let turned = b.cross(rate, force);
    std::array::from_fn(|i| b.add(&drift[i], &turned[i]))
}
