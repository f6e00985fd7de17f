//! The rigid dynamics that control laws require of an arm: what generated code gives.

use nalgebra::{Matrix4, RealField, SMatrix, SVector, Vector6};

/// Dynamics of an arm of `N` joints in SI units: B(q)·q̈ + C(q, q̇)·q̇ + g(q) = τ, with C of Christoffel
/// symbols, so that Ḃ − 2C is skew. Friction is not part of it.
///
/// For code of `dyngen` with baked-in values, [`Functions`] is the implementation; for code that takes
/// parameters, an implementation on the struct that holds them calls the functions of the same names.
pub trait ArmModel<T: RealField + Copy, const N: usize> {
    /// B(q), kg·m², rotors included.
    fn mass_matrix(&self, q: &SVector<T, N>) -> SMatrix<T, N, N>;
    /// C(q, q̇)·q̇, N·m.
    fn coriolis_times_velocity(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, N>;
    /// C(q, q̇)ᵀ·q̇, N·m.
    fn coriolis_transpose_times_velocity(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, N>;
    /// g(q), N·m.
    fn gravity(&self, q: &SVector<T, N>) -> SVector<T, N>;
    /// B(q)·q̇, N·m·s.
    fn momentum(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, N> {
        self.mass_matrix(q) * dq
    }
}

/// Kinematics of the tool's frame, linear above angular, in base axes.
pub trait ToolModel<T: RealField + Copy, const N: usize>: ArmModel<T, N> {
    /// Pose of the tool's frame in the base frame, m.
    fn forward_kinematics(&self, q: &SVector<T, N>) -> Matrix4<T>;
    /// J(q): twist of the tool = J·q̇, m/s above rad/s.
    fn jacobian(&self, q: &SVector<T, N>) -> SMatrix<T, 6, N>;
    /// J̇(q, q̇)·q̇, m/s² above rad/s².
    fn jacobian_rate_times_velocity(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> Vector6<T>;
}

/// A function of positions.
type OfPosition<R, T, const N: usize> = fn(&SVector<T, N>) -> R;
/// A function of positions and velocities.
type OfMotion<R, T, const N: usize> = fn(&SVector<T, N>, &SVector<T, N>) -> R;

/// Generated functions of these names, with the values baked in or taken from a constant.
///
#[cfg_attr(feature = "lwa4p", doc = "```")]
#[cfg_attr(not(feature = "lwa4p"), doc = "```ignore")]
/// use nalgebra::SVector;
/// use powerball_controller::dynamics::{ArmModel, Functions, Reference, State};
/// use powerball_controller::laws::ComputedTorque;
/// use powerball_controller::model::minimal;
/// // What was identified.
/// fn values() -> SVector<f64, { minimal::PARAMETERS }> {
///     SVector::from_element(0.1)
/// }
/// let arm = Functions::<f64, 6> {
///     mass_matrix: |q| minimal::mass_matrix(q, &values()),
///     coriolis_times_velocity: |q, dq| minimal::coriolis_times_velocity(q, dq, &values()),
///     coriolis_transpose_times_velocity: |q, dq| {
///         minimal::coriolis_transpose_times_velocity(q, dq, &values())
///     },
///     gravity: |q| minimal::gravity(q, &values()),
///     forward_kinematics: |q| minimal::forward_kinematics(q),
///     jacobian: |q| minimal::jacobian(q),
///     jacobian_rate_times_velocity: |q, dq| minimal::jacobian_rate_times_velocity(q, dq),
/// };
/// // In the loop, each 5 ms.
/// let law = ComputedTorque::for_period(0.005);
/// let state = State { q: SVector::from_element(0.3), dq: SVector::zeros() };
/// let goal = Reference::at_rest(state.q);
/// assert!((law.torque(&arm, &state, &goal) - arm.gravity(&state.q)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Functions<T: RealField + Copy, const N: usize> {
    /// B(q).
    pub mass_matrix: OfPosition<SMatrix<T, N, N>, T, N>,
    /// C·q̇.
    pub coriolis_times_velocity: OfMotion<SVector<T, N>, T, N>,
    /// Cᵀ·q̇.
    pub coriolis_transpose_times_velocity: OfMotion<SVector<T, N>, T, N>,
    /// g(q).
    pub gravity: OfPosition<SVector<T, N>, T, N>,
    /// Pose of the tool.
    pub forward_kinematics: OfPosition<Matrix4<T>, T, N>,
    /// J(q).
    pub jacobian: OfPosition<SMatrix<T, 6, N>, T, N>,
    /// J̇·q̇.
    pub jacobian_rate_times_velocity: OfMotion<Vector6<T>, T, N>,
}

impl<T: RealField + Copy, const N: usize> ArmModel<T, N> for Functions<T, N> {
    fn mass_matrix(&self, q: &SVector<T, N>) -> SMatrix<T, N, N> {
        (self.mass_matrix)(q)
    }
    fn coriolis_times_velocity(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, N> {
        (self.coriolis_times_velocity)(q, dq)
    }
    fn coriolis_transpose_times_velocity(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, N> {
        (self.coriolis_transpose_times_velocity)(q, dq)
    }
    fn gravity(&self, q: &SVector<T, N>) -> SVector<T, N> {
        (self.gravity)(q)
    }
}

impl<T: RealField + Copy, const N: usize> ToolModel<T, N> for Functions<T, N> {
    fn forward_kinematics(&self, q: &SVector<T, N>) -> Matrix4<T> {
        (self.forward_kinematics)(q)
    }
    fn jacobian(&self, q: &SVector<T, N>) -> SMatrix<T, 6, N> {
        (self.jacobian)(q)
    }
    fn jacobian_rate_times_velocity(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> Vector6<T> {
        (self.jacobian_rate_times_velocity)(q, dq)
    }
}

/// Positions and velocities of the joints, rad and rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T, const N: usize> {
    /// q.
    pub q: SVector<T, N>,
    /// q̇.
    pub dq: SVector<T, N>,
}

/// Reference motion of the joints: position, rad; velocity, rad/s; acceleration, rad/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<T, const N: usize> {
    /// q_r.
    pub q: SVector<T, N>,
    /// q̇_r.
    pub dq: SVector<T, N>,
    /// q̈_r.
    pub ddq: SVector<T, N>,
}

impl<T: RealField + Copy, const N: usize> Reference<T, N> {
    /// A reference at rest at a position.
    #[must_use]
    pub fn at_rest(q: SVector<T, N>) -> Self {
        Reference { q, dq: SVector::zeros(), ddq: SVector::zeros() }
    }
}
