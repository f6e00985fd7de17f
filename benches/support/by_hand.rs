//! A recursive Newton–Euler as one writes it by hand for speed: fixed arrays, nothing on the heap, numbers
//! from a table.

use powerball_workspace::root;

/// The ten inertial parameters of a link about its frame's origin: m, m·x … m·z, Ixx, Ixy, Ixz, Iyy, Iyz,
/// Izz, the products with the sign of the arm file.
pub(crate) type Link = [f64; 10];

/// A Denavit–Hartenberg row with what does not change computed before.
#[derive(Clone, Copy, Debug)]
struct Row {
    theta: f64,
    sin_alpha: f64,
    cos_alpha: f64,
    /// From the frame before to this frame's origin, in this frame.
    offset: [f64; 3],
}

/// An arm of six revolute joints.
#[derive(Clone, Debug)]
pub(crate) struct Arm {
    rows: [Row; 6],
    links: [Link; 6],
    gravity: f64,
}

type Vector = [f64; 3];

#[inline(always)]
fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn inertia(l: &Link, v: Vector) -> Vector {
    let [xx, xy, xz, yy, yz, zz] = [l[4], -l[5], -l[6], l[7], -l[8], l[9]];
    [xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2], xz * v[0] + yz * v[1] + zz * v[2]]
}

impl Row {
    /// A vector of the frame before in this frame: two plane rotations.
    #[inline(always)]
    fn inwards(&self, s: f64, c: f64, v: Vector) -> Vector {
        let (x, y) = (c * v[0] + s * v[1], c * v[1] - s * v[0]);
        [x, self.cos_alpha * y + self.sin_alpha * v[2], self.cos_alpha * v[2] - self.sin_alpha * y]
    }

    /// A vector of this frame in the frame before.
    #[inline(always)]
    fn outwards(&self, s: f64, c: f64, v: Vector) -> Vector {
        let y = self.cos_alpha * v[1] - self.sin_alpha * v[2];
        [c * v[0] - s * y, s * v[0] + c * y, self.sin_alpha * v[1] + self.cos_alpha * v[2]]
    }
}

impl Arm {
    /// The arm of a file with standard frames, revolute joints and gravity along −z, with its links.
    pub(crate) fn new(file: &str, links: [Link; 6]) -> Arm {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        let arm = dyngen::Arm::parse(&text, file).unwrap();
        let number = dyngen::exact::rational::to_f64;
        let rows = std::array::from_fn(|i| {
            let joint = &arm.joints[i];
            let (sin_alpha, cos_alpha) = joint.alpha.sin_cos();
            let (a, d) = (number(&joint.a), number(&joint.d));
            Row {
                theta: joint.theta.radians(),
                sin_alpha,
                cos_alpha,
                offset: [a, d * sin_alpha, d * cos_alpha],
            }
        });
        Arm { rows, links, gravity: 9.81 }
    }

    /// τ.
    #[inline(never)]
    pub(crate) fn inverse_dynamics(&self, q: &[f64; 6], dq: &[f64; 6], ddq: &[f64; 6]) -> [f64; 6] {
        let (mut w, mut dw, mut a) = ([0.0; 3], [0.0; 3], [0.0, 0.0, self.gravity]);
        let (mut sines, mut cosines) = ([0.0; 6], [0.0; 6]);
        let (mut forces, mut moments) = ([[0.0; 3]; 6], [[0.0; 3]; 6]);
        for i in 0..6 {
            let (row, link) = (&self.rows[i], &self.links[i]);
            let (s, c) = (q[i] + row.theta).sin_cos();
            (sines[i], cosines[i]) = (s, c);
            // q̈·z + ω × q̇·z, in the frame before.
            let turn = [w[1] * dq[i], -w[0] * dq[i], ddq[i]];
            dw = row.inwards(s, c, add(dw, turn));
            w = row.inwards(s, c, [w[0], w[1], w[2] + dq[i]]);
            a = row.inwards(s, c, a);
            a = add(a, add(cross(dw, row.offset), cross(w, cross(w, row.offset))));
            let first = [link[1], link[2], link[3]];
            let turning = add(cross(dw, first), cross(w, cross(w, first)));
            forces[i] = add([link[0] * a[0], link[0] * a[1], link[0] * a[2]], turning);
            moments[i] = add(add(inertia(link, dw), cross(w, inertia(link, w))), cross(first, a));
        }
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        let mut torques = [0.0; 6];
        for i in (0..6).rev() {
            let row = &self.rows[i];
            force = add(force, forces[i]);
            moment = add(moment, moments[i]);
            let about = add(moment, cross(row.offset, force));
            torques[i] = row.sin_alpha * about[1] + row.cos_alpha * about[2];
            moment = row.outwards(sines[i], cosines[i], about);
            force = row.outwards(sines[i], cosines[i], force);
        }
        torques
    }
}
