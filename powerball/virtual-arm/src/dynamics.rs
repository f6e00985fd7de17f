//! Recursive Newton–Euler in numbers, and the quantities that follow from it by superposition.
//!
//! This is the virtual arm's own physics. It shares no code with the generator, so that each can test the
//! other. Everything is in SI units; forces and moments of link i are expressed in frame i, about its origin.
//!
//! The module also has the mass of a link and its rotor, as the eleven parameters of Eq.

use nalgebra::{Matrix3, Vector3};
use powerball_logs::chain::Chain;

/// The largest number of joints that the recursion can hold.
const ROOM: usize = dyngen::arm::MAX_JOINTS;

/// A chain with the bodies that it carries: the rigid-body dynamics of Eq. 14 without friction.
#[derive(Clone, Debug)]
pub struct Dynamics {
    chain: Chain,
    bodies: Vec<Body>,
}

/// Motion and external forces: the arguments of one pass of the recursion.
#[derive(Clone, Copy)]
struct Pass<'a> {
    q: &'a [f64],
    dq: &'a [f64],
    ddq: &'a [f64],
    gravity: Vector3<f64>,
    /// Force in N at the last frame's origin and moment in N·m, from outside, in the base frame.
    outside: [Vector3<f64>; 2],
}

impl Dynamics {
    /// The dynamics of a chain with one body a joint; `None` where their numbers differ.
    pub fn new(chain: Chain, bodies: Vec<Body>) -> Option<Self> {
        (chain.dof() == bodies.len()).then_some(Dynamics { chain, bodies })
    }

    /// The chain.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// The way of joint `joint` that is drawn where a turning joint turns by 1 rad: 1 rad, or 0.2 m for a
    /// sliding one.
    pub fn usual_way(&self, joint: usize) -> f64 {
        if self.chain.rows()[joint].is_revolute() { 1.0 } else { 0.2 }
    }

    /// The bodies from the first link on.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The number of joints n.
    pub fn dof(&self) -> usize {
        self.bodies.len()
    }

    /// Joint torques τ = B(q)q̈ + C(q, q̇)q̇ + g(q); N·m, or N at prismatic joints.
    pub fn inverse(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let gravity = self.chain.gravity;
        self.run(&self.bodies, Pass { q, dq, ddq, gravity, outside: [Vector3::zeros(); 2] })
    }

    /// Like [`inverse`](Self::inverse), with an external force (N) at the last frame's origin and an external
    /// moment (N·m), both in the base frame.
    pub fn inverse_in_contact(
        &self,
        q: &[f64],
        dq: &[f64],
        ddq: &[f64],
        force: [f64; 3],
        moment: [f64; 3],
    ) -> Vec<f64> {
        let outside = [Vector3::from(force), Vector3::from(moment)];
        self.run(&self.bodies, Pass { q, dq, ddq, gravity: self.chain.gravity, outside })
    }

    /// The regressor of all parameters, n × 11n, row-major: column c is the torque of unit parameter c alone.
    pub fn regressor(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let n = self.dof();
        let mut out = vec![0.0; n * n * PER_LINK];
        let mut unit = vec![Body::from_parameters(&[0.0; PER_LINK]); n];
        for link in 0..n {
            for k in 0..PER_LINK {
                let mut one = [0.0; PER_LINK];
                one[k] = 1.0;
                unit[link] = Body::from_parameters(&one);
                let pass = Pass { q, dq, ddq, gravity: self.chain.gravity, outside: [Vector3::zeros(); 2] };
                for (joint, torque) in self.run(&unit, pass).into_iter().enumerate() {
                    out[joint * n * PER_LINK + link * PER_LINK + k] = torque;
                }
            }
            unit[link] = Body::from_parameters(&[0.0; PER_LINK]);
        }
        out
    }

    /// Gravity torques g(q).
    pub fn gravity(&self, q: &[f64]) -> Vec<f64> {
        let zero = vec![0.0; self.dof()];
        self.inverse(q, &zero, &zero)
    }

    /// The mass matrix B(q), n × n, row-major: column j is the torque of q̈ = e_j at rest without gravity.
    pub fn mass_matrix(&self, q: &[f64]) -> Vec<f64> {
        let n = self.dof();
        let zero = vec![0.0; n];
        columns(n, |unit| self.without_gravity(q, &zero, unit))
    }

    /// The Coriolis matrix of the Christoffel symbols, n × n, row-major.
    ///
    /// The velocity terms h(q, q̇) = C(q, q̇)q̇ are a quadratic form in q̇, and the Christoffel symbols are
    /// its symmetric bilinear form: C(q, q̇)v = ½(h(q̇ + v) − h(q̇) − h(v)). With v = e_j that is exact, no
    /// derivative of B is needed.
    pub fn coriolis_matrix(&self, q: &[f64], dq: &[f64]) -> Vec<f64> {
        let n = self.dof();
        let zero = vec![0.0; n];
        let h = |velocity: &[f64]| self.without_gravity(q, velocity, &zero);
        let at_dq = h(dq);
        columns(n, |unit| {
            let sum: Vec<f64> = dq.iter().zip(unit).map(|(a, b)| a + b).collect();
            let (both, alone) = (h(&sum), h(unit));
            (0..n).map(|i| 0.5 * (both[i] - at_dq[i] - alone[i])).collect()
        })
    }

    /// Joint accelerations under joint torques `tau`; `None` where the mass matrix is not positive definite,
    /// which no physically possible arm's is.
    pub fn forward(&self, q: &[f64], dq: &[f64], tau: &[f64]) -> Option<Vec<f64>> {
        let bias = self.inverse(q, dq, &vec![0.0; self.dof()]);
        let rest: Vec<f64> = tau.iter().zip(&bias).map(|(t, b)| t - b).collect();
        solve_positive_definite(self.mass_matrix(q), rest)
    }

    /// Kinetic energy ½ q̇ᵀBq̇ in J.
    pub fn kinetic_energy(&self, q: &[f64], dq: &[f64]) -> f64 {
        let zero = vec![0.0; self.dof()];
        let momentum = self.without_gravity(q, &zero, dq);
        0.5 * momentum.iter().zip(dq).map(|(p, v)| p * v).sum::<f64>()
    }

    /// Potential energy −Σ gᵀ(m p + R h) in J, zero where all mass sits at the base's origin.
    pub fn potential_energy(&self, q: &[f64]) -> f64 {
        let g = self.chain.gravity;
        let poses = self.chain.poses(q);
        -poses.iter().zip(&self.bodies).map(|((r, p), b)| g.dot(&(p * b.mass + r * b.moment))).sum::<f64>()
    }

    fn without_gravity(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        self.run(&self.bodies, Pass { q, dq, ddq, gravity: Vector3::zeros(), outside: [Vector3::zeros(); 2] })
    }

    /// One pass outwards for motion and one inwards for forces.
    fn run(&self, bodies: &[Body], pass: Pass<'_>) -> Vec<f64> {
        let n = bodies.len();
        let rows = self.chain.rows();
        let mut tau = vec![0.0; n];
        let mut rotation = [Matrix3::zeros(); ROOM];
        let mut origin = [Vector3::zeros(); ROOM];
        let mut force = [Vector3::zeros(); ROOM];
        let mut moment = [Vector3::zeros(); ROOM];

        // Outwards. Gravity is an acceleration of the base against it. `to_base` turns frame i into the base
        // frame.
        let (mut w, mut dw, mut acc) = (Vector3::zeros(), Vector3::zeros(), -pass.gravity);
        let mut to_base = Matrix3::identity();
        for i in 0..n {
            let (row, body) = (&rows[i], &bodies[i]);
            let (r, p) = row.pose(pass.q[i]);
            let (z, dq, ddq) = (row.axis(), pass.dq[i], pass.ddq[i]);

            // Rotor i sits on link i−1 and spins about the joint's axis with the angular momentum k·Im·μ·z
            // more than link i−1 gives it, μ its motor's velocity before the gear: q̇, or what a transmission
            // makes of several joints' q̇. Its rate of change is a moment on link i−1 (frame i−1 here), and
            // its share in the rotor's own equation of motion, times k, comes onto the joints that turn it.
            let spin = row.ratio() * body.rotor;
            if spin != 0.0 {
                let (rate, change) = (self.chain.motor_rate(i, pass.dq), self.chain.motor_rate(i, pass.ddq));
                if i > 0 {
                    moment[i - 1] += spin * (change * z + rate * w.cross(&z));
                }
                let torque = row.ratio() * spin * change + spin * z.dot(&dw);
                self.chain.add_motor_torque(i, torque, &mut tau);
            }

            // Link i, still expressed in frame i−1.
            let turning = if row.is_revolute() { z * dq } else { Vector3::zeros() };
            let mut w_new = w + turning;
            let mut dw_new = dw + w.cross(&turning);
            if row.is_revolute() {
                dw_new += z * ddq;
            }
            // The offset between the origins is carried by link i or by link i−1.
            let (cw, cdw) = if row.offset_turns() { (w_new, dw_new) } else { (w, dw) };
            acc += cdw.cross(&p) + cw.cross(&cw.cross(&p));
            if !row.is_revolute() {
                acc += 2.0 * w.cross(&(z * dq)) + z * ddq;
            }

            // And now in frame i.
            let inwards = r.transpose();
            w_new = inwards * w_new;
            dw_new = inwards * dw_new;
            acc = inwards * acc;
            (w, dw) = (w_new, dw_new);
            to_base *= r;
            (rotation[i], origin[i]) = (r, p);
            let h = body.moment;
            force[i] = body.mass * acc + dw.cross(&h) + w.cross(&w.cross(&h));
            moment[i] = body.inertia * dw + w.cross(&(body.inertia * w)) + h.cross(&acc);
        }

        // Inwards. What comes from outside need not come from the joints.
        if n > 0 {
            force[n - 1] -= to_base.transpose() * pass.outside[0];
            moment[n - 1] -= to_base.transpose() * pass.outside[1];
        }
        for i in (0..n).rev() {
            let row = &rows[i];
            let (r, p, z) = (rotation[i], origin[i], row.axis());
            let (f, m) = (r * force[i], r * moment[i]);
            tau[i] += if row.is_revolute() {
                let arm = p - row.point_on_axis(p);
                z.dot(&(m + arm.cross(&f)))
            } else {
                z.dot(&f)
            };
            if i > 0 {
                force[i - 1] += f;
                moment[i - 1] += m + p.cross(&f);
            }
        }
        tau
    }
}

/// A row-major n × n matrix from its columns, each a function of the unit vector.
fn columns(n: usize, mut column: impl FnMut(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    let mut unit = vec![0.0; n];
    for j in 0..n {
        unit[j] = 1.0;
        for (i, value) in column(&unit).into_iter().enumerate() {
            out[i * n + j] = value;
        }
        unit[j] = 0.0;
    }
    out
}

/// Solves A x = b by Cholesky, A symmetric, n × n, row-major; `None` where A is not positive definite.
pub fn solve_positive_definite(mut a: Vec<f64>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                a[i * n + j] -= a[i * n + k] * a[j * n + k];
            }
        }
        let pivot = a[j * n + j];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        for i in j..n {
            a[i * n + j] /= root;
        }
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i * n + k] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k * n + i] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    Some(b)
}

// The mass of a link and its rotor, as the eleven parameters of Eq. 10 order them.

/// Parameters of one link.
pub const PER_LINK: usize = 11;

/// A link's inertia in its frame and about the frame's origin, and the rotor that drives its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass: f64,
    /// First moment: mass times the centre of mass in the link's frame, kg·m.
    pub moment: Vector3<f64>,
    /// Inertia tensor about the frame's origin, kg·m²; its off-diagonal elements are −Ixy, −Ixz, −Iyz.
    pub inertia: Matrix3<f64>,
    /// Inertia of the rotor that drives this link's joint, on the motor's side, kg·m².
    pub rotor: f64,
}

impl Body {
    /// The body from `m mx my mz Ixx Ixy Ixz Iyy Iyz Izz Im`.
    pub fn from_parameters(p: &[f64; PER_LINK]) -> Self {
        let [mass, mx, my, mz, xx, xy, xz, yy, yz, zz, rotor] = *p;
        Body {
            mass,
            moment: Vector3::new(mx, my, mz),
            inertia: Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz),
            rotor,
        }
    }

    /// A body from its mass in kg, its centre of mass in the link's frame in m, and its tensor about the
    /// centre of mass in kg·m².
    pub fn about_centre(mass: f64, centre: Vector3<f64>, tensor: Matrix3<f64>, rotor: f64) -> Self {
        // Steiner: I = Ic + m (c·c E − c cᵀ).
        let shift = Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
        Body { mass, moment: mass * centre, inertia: tensor + mass * shift, rotor }
    }

    /// A box of even density with edges along the frame's axes: mass in kg, centre and edges in m.
    pub fn even_box(mass: f64, centre: [f64; 3], edges: [f64; 3], rotor: f64) -> Self {
        let [x, y, z] = edges.map(|e| e * e * mass / 12.0);
        let tensor = Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y));
        Body::about_centre(mass, Vector3::from(centre), tensor, rotor)
    }

    /// This body moved by `by`, m, without turning it.
    #[must_use]
    pub fn moved(&self, by: Vector3<f64>) -> Self {
        let centre = self.moment / self.mass;
        let shift = Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
        Body::about_centre(self.mass, centre + by, self.inertia - self.mass * shift, self.rotor)
    }

    /// The eleven parameters in order.
    pub fn parameters(&self) -> [f64; PER_LINK] {
        let (h, i) = (&self.moment, &self.inertia);
        [
            self.mass,
            h.x,
            h.y,
            h.z,
            i[(0, 0)],
            -i[(0, 1)],
            -i[(0, 2)],
            i[(1, 1)],
            -i[(1, 2)],
            i[(2, 2)],
            self.rotor,
        ]
    }
}

/// The bodies of a vector of parameters, eleven a link; `None` where its length is not a multiple of eleven.
pub fn bodies(parameters: &[f64]) -> Option<Vec<Body>> {
    let (links, rest) = parameters.as_chunks::<PER_LINK>();
    rest.is_empty().then(|| links.iter().map(Body::from_parameters).collect())
}

#[cfg(test)]
mod body_tests {
    use super::*;

    #[test]
    fn parameters_round_trip() {
        let body = Body::even_box(2.0, [0.1, -0.2, 0.3], [0.05, 0.1, 0.2], 3e-5);
        assert_eq!(Body::from_parameters(&body.parameters()), body);
        // The product of inertia of a point mass is m·x·y, with its own sign.
        let point = Body::even_box(2.0, [0.1, 0.2, 0.0], [0.0; 3], 0.0).parameters();
        approx::assert_relative_eq!(point[5], 0.04, max_relative = 1e-14);
        let there_and_back = body.moved(Vector3::new(0.1, 0.2, 0.3)).moved(Vector3::new(-0.1, -0.2, -0.3));
        approx::assert_relative_eq!(
            there_and_back.inertia,
            body.inertia,
            max_relative = 1e-13,
            epsilon = 1e-15
        );
        assert!(bodies(&[0.0; 12]).is_none());
    }
}
