//! A planar arm of N links with point masses at their ends, in closed form, and its motion; the control laws
//! are tested on it.
//!
//! Absolute angles φ = S·q make it short: B = Sᵀ·[m_ij·l_i·l_j·cos(φ_i − φ_j)]·S + rotors.

use crate::dynamics::{ArmModel, State, ToolModel};
use nalgebra::{Matrix4, SMatrix, SVector, Vector6};

/// Links of 0.4 m with 1 kg at their ends, rotors of 0.2 kg·m², gravity along −y.
#[derive(Clone, Debug)]
pub(super) struct Planar<const N: usize> {
    length: [f64; N],
    mass: [f64; N],
    rotor: f64,
}

impl<const N: usize> Default for Planar<N> {
    fn default() -> Self {
        Planar { length: [0.4; N], mass: [1.0; N], rotor: 0.2 }
    }
}

impl<const N: usize> Planar<N> {
    fn absolute(&self, x: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|i, _| x.iter().take(i + 1).sum())
    }

    /// Sᵀ·x.
    fn to_joints(&self, x: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|i, _| x.iter().skip(i).sum())
    }

    fn beyond(&self, i: usize, j: usize) -> f64 {
        self.mass.iter().skip(i.max(j)).sum::<f64>() * self.length[i] * self.length[j]
    }

    /// The end's position.
    fn end(&self, q: &SVector<f64, N>) -> [f64; 2] {
        let angles = self.absolute(q);
        let sum = |f: fn(f64) -> f64| angles.iter().zip(&self.length).map(|(a, l)| l * f(*a)).sum();
        [sum(f64::cos), sum(f64::sin)]
    }

    pub(super) fn potential(&self, q: &SVector<f64, N>) -> f64 {
        let angles = self.absolute(q);
        (0..N).map(|i| 9.81 * self.mass[i..].iter().sum::<f64>() * self.length[i] * angles[i].sin()).sum()
    }
}

impl<const N: usize> ArmModel<f64, N> for Planar<N> {
    fn mass_matrix(&self, q: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        let angles = self.absolute(q);
        let m = SMatrix::<f64, N, N>::from_fn(|i, j| self.beyond(i, j) * (angles[i] - angles[j]).cos());
        let s = SMatrix::<f64, N, N>::from_fn(|i, j| f64::from(u8::from(j <= i)));
        s.transpose() * m * s + SMatrix::from_diagonal_element(self.rotor)
    }
    fn coriolis_times_velocity(&self, q: &SVector<f64, N>, dq: &SVector<f64, N>) -> SVector<f64, N> {
        let (angles, rates) = (self.absolute(q), self.absolute(dq));
        let part =
            |i: usize, j: usize| self.beyond(i, j) * (angles[i] - angles[j]).sin() * rates[j] * rates[j];
        self.to_joints(&SVector::from_fn(|i, _| (0..N).map(|j| part(i, j)).sum()))
    }
    /// ∂T/∂q, which Cᵀ·q̇ is for Christoffel's C.
    fn coriolis_transpose_times_velocity(
        &self,
        q: &SVector<f64, N>,
        dq: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        let (angles, rates) = (self.absolute(q), self.absolute(dq));
        let part =
            |i: usize, j: usize| -self.beyond(i, j) * (angles[i] - angles[j]).sin() * rates[i] * rates[j];
        self.to_joints(&SVector::from_fn(|i, _| (0..N).map(|j| part(i, j)).sum()))
    }
    fn gravity(&self, q: &SVector<f64, N>) -> SVector<f64, N> {
        let angles = self.absolute(q);
        let part = |i: usize| 9.81 * self.mass[i..].iter().sum::<f64>() * self.length[i] * angles[i].cos();
        self.to_joints(&SVector::from_fn(|i, _| part(i)))
    }
}

impl<const N: usize> ToolModel<f64, N> for Planar<N> {
    fn forward_kinematics(&self, q: &SVector<f64, N>) -> Matrix4<f64> {
        let ([x, y], (s, c)) = (self.end(q), q.sum().sin_cos());
        Matrix4::new(c, -s, 0.0, x, s, c, 0.0, y, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    }
    fn jacobian(&self, q: &SVector<f64, N>) -> SMatrix<f64, 6, N> {
        let angles = self.absolute(q);
        let x = self.to_joints(&SVector::from_fn(|i, _| -self.length[i] * angles[i].sin()));
        let y = self.to_joints(&SVector::from_fn(|i, _| self.length[i] * angles[i].cos()));
        SMatrix::from_fn(|row, j| match row {
            0 => x[j],
            1 => y[j],
            5 => 1.0,
            _ => 0.0,
        })
    }
    fn jacobian_rate_times_velocity(&self, q: &SVector<f64, N>, dq: &SVector<f64, N>) -> Vector6<f64> {
        let (angles, rates) = (self.absolute(q), self.absolute(dq));
        let part = |f: fn(f64) -> f64| {
            -(0..N).map(|i| self.length[i] * f(angles[i]) * rates[i] * rates[i]).sum::<f64>()
        };
        Vector6::new(part(f64::cos), part(f64::sin), 0.0, 0.0, 0.0, 0.0)
    }
}

/// The arm in time, with what touches it.
pub(super) struct Sampled<'a, const N: usize> {
    arm: &'a Planar<N>,
    pub(super) state: State<f64, N>,
    /// External torques on the joints, N·m.
    pub(super) external: SVector<f64, N>,
    /// Coulomb friction of each joint, N·m, as tanh(500·q̇).
    pub(super) friction: f64,
    /// Joint 2 meets a wall there, rad, with a stiffness, N·m/rad, and a loss, N·m·s/rad.
    pub(super) wall: Option<(f64, f64, f64)>,
}

impl<'a, const N: usize> Sampled<'a, N> {
    pub(super) fn new(arm: &'a Planar<N>, q: SVector<f64, N>, dq: SVector<f64, N>) -> Self {
        let state = State { q, dq };
        Sampled { arm, state, external: SVector::zeros(), friction: 0.0, wall: None }
    }

    fn acceleration(&self, state: &State<f64, N>, torque: &SVector<f64, N>) -> SVector<f64, N> {
        let State { q, dq } = state;
        let mut push = torque + self.external
            - self.arm.coriolis_times_velocity(q, dq)
            - self.arm.gravity(q)
            - dq.map(|v| self.friction * (500.0 * v).tanh());
        if let Some((place, stiffness, loss)) = self.wall.filter(|(place, ..)| q[1] > *place) {
            // A wall pushes and does not pull.
            push[1] -= (stiffness * (q[1] - place) + loss * dq[1]).max(0.0);
        }
        self.arm.mass_matrix(q).cholesky().unwrap().solve(&push)
    }

    /// A torque that holds for `time` s, in steps of the midpoint rule.
    pub(super) fn advance(&mut self, torque: &SVector<f64, N>, time: f64, steps: usize) {
        let h = time / steps as f64;
        for _ in 0..steps {
            let State { q, dq } = self.state;
            let a = self.acceleration(&self.state, torque);
            let middle = State { q: q + dq * (h / 2.0), dq: dq + a * (h / 2.0) };
            let a = self.acceleration(&middle, torque);
            self.state = State { q: q + middle.dq * h, dq: dq + a * h };
        }
    }
}

/// The arm's own identities, by differences: what every law below stands on.
#[test]
fn the_test_arm_is_an_arm() {
    let arm = Planar::<4>::default();
    let (q, dq) = (SVector::from([0.3, -0.7, 1.1, 0.4]), SVector::from([0.5, -0.4, 0.9, 1.2]));
    let h = 1e-6;
    let [next, last] = [q + dq * h, q - dq * h];
    let rate = (arm.mass_matrix(&next) - arm.mass_matrix(&last)) / (2.0 * h);
    // C·q̇ + Cᵀ·q̇ = Ḃ·q̇.
    let sum = arm.coriolis_times_velocity(&q, &dq) + arm.coriolis_transpose_times_velocity(&q, &dq);
    assert!((sum - rate * dq).norm() < 1e-7);
    let slope = (arm.potential(&next) - arm.potential(&last)) / (2.0 * h);
    assert!((slope - arm.gravity(&q).dot(&dq)).abs() < 1e-7);
    let place = |q| arm.forward_kinematics(q).fixed_view::<2, 1>(0, 3).into_owned();
    let twist = arm.jacobian(&q) * dq;
    assert!(((place(&next) - place(&last)) / (2.0 * h) - twist.fixed_rows::<2>(0)).norm() < 1e-7);
    let change = (arm.jacobian(&next) - arm.jacobian(&last)) / (2.0 * h) * dq;
    assert!((change - arm.jacobian_rate_times_velocity(&q, &dq)).norm() < 1e-7);
}
