//! The motion of frames: ω, and the accelerations of their points.

use super::body::Vector;
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};
use crate::lagrangian::elements::{turn_x, turn_z};

/// The motion of a frame in its own axes.
///
/// Accelerations are those of Christoffel symbols: J·q̈ᵣ + J̇(q, q̇)·q̇ᵣ, symmetric in the velocities q̇ and
/// reference velocities q̇ᵣ; where those are the same they are the accelerations of the motion itself.
#[derive(Clone, Copy, Debug)]
pub struct Spin {
    /// Angular velocity at the velocities.
    pub omega: Vector,
    /// Angular velocity at the reference velocities.
    pub reference: Vector,
    /// `U = [ω̇×] + [ω×][ω×]` by rows: the acceleration of a point at r, relative to the origin, is U·r.
    pub rows: [Vector; 3],
}

impl Spin {
    /// A frame at rest.
    pub const REST: Spin = {
        let zero = super::body::ZERO;
        Spin { omega: zero, reference: zero, rows: [zero; 3] }
    };

    /// The acceleration of the point at unit distance along an axis, relative to the origin.
    pub fn column(&self, axis: usize) -> Vector {
        std::array::from_fn(|i| self.rows[i][axis])
    }

    /// The acceleration of a point relative to the origin.
    pub fn times(&self, b: &Builder, r: &Vector) -> Vector {
        std::array::from_fn(|i| b.dot(&self.rows[i], r))
    }

    /// ω_i ω_j, symmetric in ω and ωᵣ.
    pub fn product(&self, b: &Builder, i: usize, j: usize) -> Expr {
        let twice = self.twice_product(b, i, j);
        let half = b.constant(&crate::exact::rational::ratio(1, 2));
        if self.omega == self.reference || i == j {
            return b.mul(&self.omega[i], &self.reference[j]);
        }
        b.mul(&half, &twice)
    }

    /// 2 ω_i ω_j, symmetric in ω and ωᵣ.
    fn twice_product(&self, b: &Builder, i: usize, j: usize) -> Expr {
        if self.omega == self.reference {
            // The third component doubled serves both of its products.
            let (i, j) = if j == 2 { (j, i) } else { (i, j) };
            return b.mul(&b.add(&self.omega[i], &self.omega[i]), &self.omega[j]);
        }
        let [u, r] = [&self.omega, &self.reference];
        b.add(&b.mul(&u[i], &r[j]), &b.mul(&r[i], &u[j]))
    }

    /// U_xx − U_yy = ω_x² − ω_y², from ω_x² and the inherited U_zz alone.
    pub fn squares_across(&self, b: &Builder) -> Expr {
        let x2 = self.product(b, 0, 0);
        b.add(&b.add(&self.rows[2][2], &x2), &x2)
    }

    /// Angular acceleration about an axis.
    pub fn alpha(&self, b: &Builder, axis: usize) -> Expr {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        b.sub(&self.rows[k][j], &self.product(b, j, k))
    }

    /// Angular acceleration about z.
    pub fn alpha_z(&self, b: &Builder) -> Expr {
        b.sub(&self.product(b, 0, 1), &self.rows[0][1])
    }

    /// This motion in axes that are turned about x.
    pub fn turned_x(&self, b: &Builder, (sin, cos): (Expr, Expr)) -> Spin {
        let turn = |v: &Vector| turn_x(b, &sin, &cos, v);
        Spin {
            omega: turn(&self.omega),
            reference: turn(&self.reference),
            rows: turned_tensor(&self.rows, turn),
        }
    }

    /// The motion of a frame that turns about this one's z by an angle with the given sine and cosine,
    /// velocity, reference velocity and acceleration.
    ///
    /// Points of the axis move alike in both frames, so U's column along z is the same vector. What else U
    /// holds follows from it, from ω, and from the angular acceleration about z.
    pub fn joined(
        &self,
        b: &Builder,
        trig: (Expr, Expr),
        velocity: Expr,
        reference: Expr,
        acceleration: Expr,
    ) -> Spin {
        let (sin, cos) = trig;
        let mut omega = turn_z(b, &sin, &cos, &self.omega);
        let mut omega_r = turn_z(b, &sin, &cos, &self.reference);
        omega[2] = b.add(&omega[2], &velocity);
        omega_r[2] = b.add(&omega_r[2], &reference);
        let [xz, yz, zz] = turn_z(b, &sin, &cos, &self.column(2));
        let mut to = Spin { omega, reference: omega_r, rows: self.rows };
        let alpha = b.add(&self.alpha_z(b), &acceleration);
        let xy = to.product(b, 0, 1);
        let [x2, z2] = [to.product(b, 0, 0), to.product(b, 2, 2)];
        // −(ω_y² + ω_z²) with ω_y² = −U_zz − ω_x²
        let xx = b.add(&zz, &b.sub(&x2, &z2));
        let yy = -b.add(&x2, &z2);
        to.rows = [
            [xx, b.sub(&xy, &alpha), xz],
            [b.add(&xy, &alpha), yy, yz],
            [b.sub(&to.twice_product(b, 0, 2), &xz), b.sub(&to.twice_product(b, 1, 2), &yz), zz],
        ];
        to
    }
}

/// Turns both indices of a tensor given by rows.
pub fn turned_tensor(rows: &[Vector; 3], turn: impl Fn(&Vector) -> Vector) -> [Vector; 3] {
    let rows = rows.map(|row| turn(&row));
    let columns: [Vector; 3] = std::array::from_fn(|j| turn(&std::array::from_fn(|i| rows[i][j])));
    std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]))
}
