//! Cartesian impedance at the tool, with damping of joint motion that does not move the tool.

use super::number;
use crate::dynamics::{State, ToolModel};
use nalgebra::{Matrix3, Matrix4, Matrix6, RealField, SMatrix, SVector, Vector3, Vector6};

/// Reference motion of the tool, in base axes, linear above angular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal<T> {
    /// Pose of the tool's frame, m.
    pub pose: Matrix4<T>,
    /// Twist of the frame, m/s above rad/s.
    pub twist: Vector6<T>,
    /// Acceleration of the frame, m/s² above rad/s²; `None` for the passive form, which a fixed or slow goal
    /// wants.
    pub acceleration: Option<Vector6<T>>,
}

/// τ = Jᵀ·(K·e + D·ė) + g(q) + τ_n with e from the tool's pose to the goal's (m above rad, a rotation vector)
/// and the null-space damping τ_n = −d·(B − JᵀΛJ)·q̇, Λ = (J·B⁻¹·Jᵀ + λ²·I)⁻¹ (Hogan 1985; Albu-Schäffer,
/// Ott, Hirzinger, *A unified passivity-based control framework*, IJRR 26, 2007; Khatib, *A unified approach
/// for motion and force control*, 1987).
///
/// B − JᵀΛJ is positive semidefinite for every λ and vanishes on what moves the tool where λ = 0, so the
/// damping takes energy and no force from the tool. At a fixed goal V = ½·q̇ᵀB·q̇ + ½·eᵀK·e (small rotations)
/// has V̇ = −ẋᵀD·ẋ − d·q̇ᵀ(B − JᵀΛJ)·q̇ + q̇ᵀτ_ext ≤ q̇ᵀτ_ext: passive. With an acceleration C·q̇ and
/// Jᵀ·Λ·(ẍ_r − J̇·q̇) come to it: away from singularities Λ·ë + D·ė + K·e = 0 (Khatib).
///
/// Near a singularity λ grows (Nakamura and Hanafusa 1986): where the least mobility of the tool falls below
/// `least`, forces that Λ would ask for stay finite. The passive form needs Λ for its damping alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianImpedance<T> {
    /// Diagonal of K, N/m above N·m/rad.
    pub stiffness: Vector6<T>,
    /// Damping ratio ζ: D_i = 2·ζ·√(K_i·Λ_ii).
    pub ratio: T,
    /// d, 1/s.
    pub null_damping: T,
    /// λ², 1/kg: added to the mobility J·B⁻¹·Jᵀ where its least eigenvalue falls below it, in full at 0.
    pub least: T,
}

impl<T: RealField + Copy> CartesianImpedance<T> {
    /// Springs of these stiffnesses (N/m, N·m/rad), critically damped; null space damped with 5/s; `least` =
    /// 0.01/kg.
    #[must_use]
    pub fn new(translation: T, rotation: T) -> Self {
        CartesianImpedance {
            stiffness: Vector6::from_fn(|i, _| if i < 3 { translation } else { rotation }),
            ratio: T::one(),
            null_damping: number(5.0),
            least: number(0.01),
        }
    }

    /// The torque, N·m; `None` where B is not a mass matrix.
    #[must_use]
    pub fn torque<const N: usize>(
        &self,
        model: &impl ToolModel<T, N>,
        state: &State<T, N>,
        goal: &Goal<T>,
    ) -> Option<SVector<T, N>> {
        let State { q, dq } = state;
        let (inertia, jacobian) = (model.mass_matrix(q), model.jacobian(q));
        let task = self.task_inertia(&inertia, &jacobian)?;
        let error = pose_error(&goal.pose, &model.forward_kinematics(q));
        let rate = goal.twist - jacobian * dq;
        let damping = self.damping(&task);
        let mut force = self.stiffness.component_mul(&error) + damping.component_mul(&rate);
        let mut torque = model.gravity(q);
        if let Some(acceleration) = goal.acceleration {
            force += task * (acceleration - model.jacobian_rate_times_velocity(q, dq));
            torque += model.coriolis_times_velocity(q, dq);
        }
        let shown = jacobian.transpose() * (task * (jacobian * dq));
        Some(torque + jacobian.transpose() * force - (inertia * dq - shown) * self.null_damping)
    }

    /// Diagonal of D, N·s/m above N·m·s/rad, at a task inertia.
    fn damping(&self, task: &Matrix6<T>) -> Vector6<T> {
        let own = |i: usize| (self.stiffness[i] * task[(i, i)]).max(T::zero());
        Vector6::from_fn(|i, _| number::<T>(2.0) * self.ratio * own(i).sqrt())
    }

    /// Λ, damped.
    fn task_inertia<const N: usize>(
        &self,
        inertia: &SMatrix<T, N, N>,
        jacobian: &SMatrix<T, 6, N>,
    ) -> Option<Matrix6<T>> {
        let mobility = jacobian * inertia.cholesky()?.solve(&jacobian.transpose());
        // Its inverse's norm bounds the least eigenvalue from below, without a search for it.
        let nearly = mobility.cholesky().map_or(T::zero(), |c| T::one() / c.inverse().norm());
        let lack = (T::one() - nearly / self.least).max(T::zero());
        let damped = mobility + Matrix6::from_diagonal_element(self.least * lack * lack);
        damped.cholesky().map(|c| c.inverse())
    }
}

/// From one pose to another: m above the rotation vector, rad, both in base axes.
fn pose_error<T: RealField + Copy>(to: &Matrix4<T>, from: &Matrix4<T>) -> Vector6<T> {
    let rotation = |pose: &Matrix4<T>| pose.fixed_view::<3, 3>(0, 0).into_owned();
    let place = |pose: &Matrix4<T>| pose.fixed_view::<3, 1>(0, 3).into_owned();
    let shift = place(to) - place(from);
    let turn = rotation_vector(&(rotation(to) * rotation(from).transpose()));
    Vector6::new(shift[0], shift[1], shift[2], turn[0], turn[1], turn[2])
}

/// The rotation vector of a rotation. Near half a turn its axis is that of the largest column of R + Rᵀ.
fn rotation_vector<T: RealField + Copy>(r: &Matrix3<T>) -> Vector3<T> {
    let two = number::<T>(2.0);
    let sine = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) / two;
    let (s, c) = (sine.norm(), (r.trace() - T::one()) / two);
    let angle = s.atan2(c);
    if s > number(1e-6) {
        return sine * (angle / s);
    }
    if c > T::zero() {
        return sine;
    }
    let outer = r + r.transpose() + Matrix3::from_diagonal_element(T::one() - r.trace());
    let longest = (0..3).map(|i| outer.column(i).into_owned()).fold(Vector3::zeros(), |best, column| {
        if column.norm_squared() > best.norm_squared() { column } else { best }
    });
    longest * (angle / longest.norm().max(number(1e-6)))
}

#[cfg(test)]
mod tests {
    use super::super::test_arm::{Planar, Sampled};
    use super::*;
    use crate::dynamics::ArmModel;
    use nalgebra::{Rotation3, Unit, Vector4};

    fn goal(arm: &Planar<4>, q: &Vector4<f64>) -> Goal<f64> {
        Goal { pose: arm.forward_kinematics(q), twist: Vector6::zeros(), acceleration: None }
    }

    #[test]
    fn rotation_vectors_are_those_of_their_rotations() {
        let axis = Unit::new_normalize(Vector3::new(0.3, -0.5, 0.8));
        for angle in [0.0, 1e-9, 0.4, 2.9, core::f64::consts::PI - 1e-9, core::f64::consts::PI] {
            let found = rotation_vector(Rotation3::from_axis_angle(&axis, angle).matrix());
            // Half a turn has two axes.
            let off = (found - axis.as_ref() * angle).norm().min((found + axis.as_ref() * angle).norm());
            assert!(off < 1e-6, "{angle}: {found}");
        }
    }

    #[test]
    fn the_tool_is_a_spring_and_the_null_space_takes_no_force_from_it() {
        let arm = Planar::<4>::default();
        let law = CartesianImpedance::<f64> { least: 1e-6, ..CartesianImpedance::new(500.0, 40.0) };
        let q = Vector4::new(0.5, 0.9, -0.7, 0.6);
        let goal = goal(&arm, &(q + Vector4::new(0.02, -0.01, 0.015, 0.01)));
        let rest = State { q, dq: Vector4::zeros() };
        let e = pose_error(&goal.pose, &arm.forward_kinematics(&q));
        let expected = arm.jacobian(&q).transpose() * law.stiffness.component_mul(&e) + arm.gravity(&q);
        assert!((law.torque(&arm, &rest, &goal).unwrap() - expected).norm() < 1e-9);
        // A motion that does not move the tool is damped, and the damping does not accelerate the tool.
        let j = arm.jacobian(&q);
        let rows = nalgebra::Matrix3x4::<f64>::from_fn(|i, k| j[([0, 1, 5][i], k)]);
        let still = rows.transpose() * (rows * rows.transpose()).try_inverse().unwrap() * rows;
        let dq = (nalgebra::Matrix4::identity() - still) * Vector4::new(1.0, 0.3, -0.4, 0.2);
        assert!((rows * dq).norm() < 1e-12 && dq.norm() > 0.1);
        let damping = law.torque(&arm, &State { q, dq }, &goal).unwrap() - expected;
        let inverse = arm.mass_matrix(&q).try_inverse().unwrap();
        assert!(damping.dot(&dq) < -0.1 * dq.norm_squared());
        assert!((rows * inverse * damping).norm() < 1e-4 * damping.norm(), "{}", rows * inverse * damping);
    }

    /// Thrown, through the stretched pose, where the Jacobian loses rank.
    #[test]
    fn energy_never_grows_at_a_fixed_goal_and_torques_stay_finite_at_singularities() {
        let arm = Planar::<4>::default();
        let law = CartesianImpedance::<f64>::new(60.0, 8.0);
        let goal = goal(&arm, &Vector4::new(0.2, 0.1, -0.1, 0.05));
        let mut plant =
            Sampled::new(&arm, Vector4::new(0.6, -0.5, -0.6, 0.7), Vector4::new(1.0, 0.5, 1.5, -1.0));
        let energy = |s: &State<f64, 4>| {
            let e = pose_error(&goal.pose, &arm.forward_kinematics(&s.q));
            0.5 * s.dq.dot(&arm.momentum(&s.q, &s.dq)) + 0.5 * e.dot(&law.stiffness.component_mul(&e))
        };
        let start = energy(&plant.state);
        let (mut before, mut most) = (start, 0.0f64);
        for _ in 0..60_000 {
            let torque = law.torque(&arm, &plant.state, &goal).unwrap();
            most = most.max(torque.norm());
            plant.advance(&torque, 1e-4, 1);
            let now = energy(&plant.state);
            assert!(now <= before + 1e-5 * start, "{now} after {before}");
            before = now;
        }
        assert!(before < 0.02 * start && most < 200.0, "{before} of {start} J, {most} N·m");
    }

    #[test]
    fn with_an_acceleration_the_tool_follows_a_path() {
        let arm = Planar::<4>::default();
        let law = CartesianImpedance::<f64> { least: 1e-6, ..CartesianImpedance::new(400.0, 40.0) };
        let q0 = Vector4::new(0.5, 0.9, -0.7, 0.6);
        let begin = arm.forward_kinematics(&q0);
        let mut plant = Sampled::new(&arm, q0, Vector4::zeros());
        for k in 0..20_000 {
            // x by 0.05·(1 − cos 3t).
            let t = 1e-4 * f64::from(k);
            let mut goal =
                Goal { pose: begin, twist: Vector6::zeros(), acceleration: Some(Vector6::zeros()) };
            goal.pose[(0, 3)] += 0.05 * (1.0 - (3.0 * t).cos());
            goal.twist[0] = 0.15 * (3.0 * t).sin();
            goal.acceleration = Some(Vector6::x() * (0.45 * (3.0 * t).cos()));
            let torque = law.torque(&arm, &plant.state, &goal).unwrap();
            plant.advance(&torque, 1e-4, 1);
            let off = pose_error(&goal.pose, &arm.forward_kinematics(&plant.state.q)).norm();
            assert!(off < 2e-4, "{t}: {off}");
        }
    }
}
