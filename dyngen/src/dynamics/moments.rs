//! Mass, first and second moments of a body about the origin of a frame.
//!
//! Second moments J = ∫ r rᵀ dm instead of the inertia tensor: a mass distribution on a joint axis (m, z and
//! zz) belongs to the link on either side of the joint, so these three vanish once they are regrouped, and
//! the moment of each other entry has only two or three components.

use crate::exact::algebra::Algebra;
use crate::lagrangian::elements::{PlacementElements, turn_x, turn_z};

/// A body's moments.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments<V> {
    /// ∫ dm
    pub mass: V,
    /// ∫ r dm
    pub first: [V; 3],
    /// ∫ x², y², z² dm
    pub square: [V; 3],
    /// ∫ yz, xz, xy dm
    pub mixed: [V; 3],
}

/// Entries of [`Moments`], in order: m, x y z, xx yy zz, yz xz xy.
pub const ENTRIES: usize = 10;

impl<V: Clone> Moments<V> {
    /// No mass.
    pub fn none<A: Algebra<Value = V>>(alg: &A) -> Self {
        Self::from_entries(&std::array::from_fn(|_| alg.integer(0)))
    }

    /// From the entries in order.
    pub fn from_entries(v: &[V; ENTRIES]) -> Self {
        let three = |i: usize| [v[i].clone(), v[i + 1].clone(), v[i + 2].clone()];
        Moments { mass: v[0].clone(), first: three(1), square: three(4), mixed: three(7) }
    }

    /// The moments of a body with the ten inertial parameters m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz;
    /// `half` is ½.
    pub fn of_parameters<A: Algebra<Value = V>>(alg: &A, half: &V, parameters: &[V; ENTRIES]) -> Self {
        let [m, x, y, z, xx, xy, xz, yy, yz, zz] = parameters.clone();
        // J = ½ tr(I) − I
        let trace = alg.mul(half, &alg.add(&alg.add(&xx, &yy), &zz));
        let square = [&xx, &yy, &zz].map(|i| alg.sub(&trace, i));
        Moments { mass: m, first: [x, y, z], square, mixed: [yz, xz, xy] }
    }

    /// The entries in order.
    pub fn entries(&self) -> [V; ENTRIES] {
        std::array::from_fn(|i| match i {
            0 => self.mass.clone(),
            1..=3 => self.first[i - 1].clone(),
            4..=6 => self.square[i - 4].clone(),
            _ => self.mixed[i - 7].clone(),
        })
    }

    /// The sum of two bodies about one origin.
    pub fn plus<A: Algebra<Value = V>>(&self, alg: &A, other: &Self) -> Self {
        let (a, b) = (self.entries(), other.entries());
        Self::from_entries(&std::array::from_fn(|i| alg.add(&a[i], &b[i])))
    }

    /// Seen from a frame that comes to this one by a turn about x: Rx·r.
    pub fn turned_back_x<A: Algebra<Value = V>>(&self, alg: &A, sin: &V, cos: &V) -> Self {
        let back = alg.neg(sin);
        let [xx, yy, zz] = &self.square;
        let [yz, xz, xy] = &self.mixed;
        let [_, xy, xz] = turn_x(alg, &back, cos, &[alg.integer(0), xy.clone(), xz.clone()]);
        let (yy, zz, yz) = turn_block(alg, sin, cos, yy, zz, yz);
        Moments {
            mass: self.mass.clone(),
            first: turn_x(alg, &back, cos, &self.first),
            square: [xx.clone(), yy, zz],
            mixed: [yz, xz, xy],
        }
    }

    /// Seen from a frame that comes to this one by a turn about y: Ry·r.
    pub fn turned_back_y<A: Algebra<Value = V>>(&self, alg: &A, sin: &V, cos: &V) -> Self {
        // With the axes renamed y, z, x it is a turn about x.
        self.renamed(1).turned_back_x(alg, sin, cos).renamed(2)
    }

    /// With the axes named further by `places` places.
    fn renamed(&self, places: usize) -> Self {
        let mut renamed = self.clone();
        for v in [&mut renamed.first, &mut renamed.square, &mut renamed.mixed] {
            v.rotate_left(places);
        }
        renamed
    }

    /// Seen from a frame in which this one is placed: a shift, then Rz(yaw)·Ry(pitch)·Rx(roll).
    pub fn placed_back<A: Algebra<Value = V>>(&self, alg: &A, frame: &PlacementElements<V>) -> Self {
        let [(sr, cr), (sp, cp), (sy, cy)] = &frame.rpy;
        let turned = self.turned_back_x(alg, sr, cr).turned_back_y(alg, sp, cp).turned_back_z(alg, sy, cy);
        turned.shifted(alg, &frame.origin)
    }

    /// Seen from a frame that comes to this one by a turn about z: Rz·r.
    pub fn turned_back_z<A: Algebra<Value = V>>(&self, alg: &A, sin: &V, cos: &V) -> Self {
        let back = alg.neg(sin);
        let [xx, yy, zz] = &self.square;
        let [yz, xz, xy] = &self.mixed;
        let [xz, yz, _] = turn_z(alg, &back, cos, &[xz.clone(), yz.clone(), alg.integer(0)]);
        let (xx, yy, xy) = turn_block(alg, sin, cos, xx, yy, xy);
        Moments {
            mass: self.mass.clone(),
            first: turn_z(alg, &back, cos, &self.first),
            square: [xx, yy, zz.clone()],
            mixed: [yz, xz, xy],
        }
    }

    /// About the origin of a frame in which this one's lies at p: J + s pᵀ + p sᵀ + m p pᵀ.
    pub fn shifted<A: Algebra<Value = V>>(&self, alg: &A, p: &[V; 3]) -> Self {
        let mut shifted = self.clone();
        let product = |i: usize, j: usize| -> V {
            if alg.is_zero(&p[i]) && alg.is_zero(&p[j]) {
                return alg.integer(0);
            }
            // s_i p_j + (s_j + m p_j) p_i
            let carried = alg.add(&self.first[j], &alg.mul(&self.mass, &p[j]));
            alg.add(&alg.mul(&self.first[i], &p[j]), &alg.mul(&carried, &p[i]))
        };
        for i in 0..3 {
            shifted.first[i] = alg.add(&self.first[i], &alg.mul(&self.mass, &p[i]));
            shifted.square[i] = alg.add(&self.square[i], &square_shift(alg, self, p, i));
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            shifted.mixed[i] = alg.add(&self.mixed[i], &product(j, k));
        }
        shifted
    }

    /// The moment of inertia about z.
    pub fn about_z<A: Algebra<Value = V>>(&self, alg: &A) -> V {
        alg.add(&self.square[0], &self.square[1])
    }

    /// The inertia tensor (tr J − J) times a vector.
    pub fn inertia_times<A: Algebra<Value = V>>(&self, alg: &A, v: &[V; 3]) -> [V; 3] {
        let [xx, yy, zz] = &self.square;
        let [yz, xz, xy] = &self.mixed;
        let minus = |x: &V| alg.neg(x);
        [
            alg.dot(&[alg.add(yy, zz), minus(xy), minus(xz)], v),
            alg.dot(&[minus(xy), alg.add(zz, xx), minus(yz)], v),
            alg.dot(&[minus(xz), minus(yz), alg.add(xx, yy)], v),
        ]
    }
}

/// 2 s p + m p²
fn square_shift<A: Algebra>(alg: &A, body: &Moments<A::Value>, p: &[A::Value; 3], i: usize) -> A::Value {
    let reach = alg.mul(&body.mass, &p[i]);
    let twice = alg.add(&body.first[i], &body.first[i]);
    alg.mul(&p[i], &alg.add(&twice, &reach))
}

/// Turns the block (p, r; q) of second moments across an axis by an angle.
fn turn_block<A: Algebra>(
    alg: &A,
    s: &A::Value,
    c: &A::Value,
    p: &A::Value,
    r: &A::Value,
    q: &A::Value,
) -> (A::Value, A::Value, A::Value) {
    // u = s(p − r) + 2 c q; p' = p − s u, r' = r + s u, q' = c u − q
    let twice = alg.add(q, q);
    let u = alg.add(&alg.mul(s, &alg.sub(p, r)), &alg.mul(c, &twice));
    let su = alg.mul(s, &u);
    (alg.sub(p, &su), alg.add(r, &su), alg.sub(&alg.mul(c, &u), q))
}
