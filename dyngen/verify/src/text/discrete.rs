#[allow(unused_imports)]
use super::*;

/// Numbers in a state: q above q̇.
pub const STATES: usize = 2 * JOINTS;

/// q above q̇.
pub type State<T> = SVector<T, STATES>;

/// ∂x⁺/∂x and ∂x⁺/∂τ.
pub type Linearised<T> = (SMatrix<T, STATES, STATES>, SMatrix<T, STATES, JOINTS>);

fn joints<T: SimdRealField + Copy>(x: &State<T>) -> (SVector<T, JOINTS>, SVector<T, JOINTS>) {
    (x.fixed_rows::<JOINTS>(0).into_owned(), x.fixed_rows::<JOINTS>(JOINTS).into_owned())
}

fn state<T: SimdRealField + Copy>(q: &SVector<T, JOINTS>, dq: &SVector<T, JOINTS>) -> State<T> {
    let mut x = State::<T>::zeros();
    x.fixed_rows_mut::<JOINTS>(0).copy_from(q);
    x.fixed_rows_mut::<JOINTS>(JOINTS).copy_from(dq);
    x
}

/// ẋ = (q̇, q̈)
fn rate<T: SimdRealField + Copy>(
    x: &State<T>,
    tau: &SVector<T, JOINTS>,
    parameters: &impl Parameters<T>,
) -> State<T> {
    let (q, dq) = joints(x);
    state(&dq, &forward_dynamics_with(&Trig::new(&q), &dq, tau, parameters))
}

/// ∂ẋ/∂x and ∂ẋ/∂τ.
fn rate_linearised<T: SimdRealField + Copy>(
    x: &State<T>,
    tau: &SVector<T, JOINTS>,
    parameters: &impl Parameters<T>,
) -> Linearised<T> {
    let (q, dq) = joints(x);
    let trig = Trig::new(&q);
    let (mut a, mut b): Linearised<T> = (SMatrix::zeros(), SMatrix::zeros());
    a.fixed_view_mut::<JOINTS, JOINTS>(0, JOINTS).fill_with_identity();
    a.fixed_view_mut::<JOINTS, JOINTS>(JOINTS, 0)
        .copy_from(&acceleration_by_position_with(&trig, &dq, tau, parameters));
    a.fixed_view_mut::<JOINTS, JOINTS>(JOINTS, JOINTS)
        .copy_from(&acceleration_by_velocity_with(&trig, &dq, tau, parameters));
    b.fixed_view_mut::<JOINTS, JOINTS>(JOINTS, 0).copy_from(&mass_matrix_inverse_with(&trig, parameters));
    (a, b)
}

/// A step of the semi-implicit Euler method: q̇⁺ = q̇ + dt·q̈, q⁺ = q + dt·q̇⁺; `dt` in s. Its error
/// is of second order in a step.
#[must_use]
pub fn semi_implicit<T: SimdRealField + Copy>(
    x: &State<T>,
    tau: &SVector<T, JOINTS>,
    parameters: &impl Parameters<T>,
    dt: T,
) -> State<T> {
    let (q, dq) = joints(x);
    let dq = dq + forward_dynamics_with(&Trig::new(&q), &dq, tau, parameters) * dt;
    state(&(q + dq * dt), &dq)
}

/// A and B of that step.
#[must_use]
pub fn semi_implicit_linearised<T: SimdRealField + Copy>(
    x: &State<T>,
    tau: &SVector<T, JOINTS>,
    parameters: &impl Parameters<T>,
    dt: T,
) -> Linearised<T> {
    let (a, b) = rate_linearised(x, tau, parameters);
    let (mut a, mut b) = (a * dt, b * dt);
    // The rows of q̇⁺; those of q⁺ are dt times them, and both add to what was there.
    a.fixed_view_mut::<JOINTS, JOINTS>(0, JOINTS).fill(T::zero());
    for i in 0..JOINTS {
        a[(JOINTS + i, JOINTS + i)] += T::one();
        for j in 0..STATES {
            a[(i, j)] = a[(JOINTS + i, j)] * dt;
        }
        a[(i, i)] += T::one();
        for j in 0..JOINTS {
            b[(i, j)] = b[(JOINTS + i, j)] * dt;
        }
    }
    (a, b)
}

/// A step of the classical Runge-Kutta method; `dt` in s. Its error is of fifth order in a step.
#[must_use]
pub fn runge_kutta<T: SimdRealField + Copy>(
    x: &State<T>,
    tau: &SVector<T, JOINTS>,
    parameters: &impl Parameters<T>,
    dt: T,
) -> State<T> {
    let parameters = &parameters.prepared();
    let half: T = dt * nalgebra::convert(0.5f64);
    let k1 = rate(x, tau, parameters);
    let k2 = rate(&(x + k1 * half), tau, parameters);
    let k3 = rate(&(x + k2 * half), tau, parameters);
    let k4 = rate(&(x + k3 * dt), tau, parameters);
    x + (k1 + k4 + (k2 + k3) * nalgebra::convert::<f64, T>(2f64)) * (dt / nalgebra::convert(6f64))
}

/// A and B of that step, exactly: the derivatives of its four stages.
#[must_use]
pub fn runge_kutta_linearised<T: SimdRealField + Copy>(
    x: &State<T>,
    tau: &SVector<T, JOINTS>,
    parameters: &impl Parameters<T>,
    dt: T,
) -> Linearised<T> {
    let parameters = &parameters.prepared();
    let half: T = dt * nalgebra::convert(0.5f64);
    let mut k = State::<T>::zeros();
    let (mut by_x, mut by_tau): Linearised<T> = (SMatrix::zeros(), SMatrix::zeros());
    let (mut a, mut b): Linearised<T> = (SMatrix::identity(), SMatrix::zeros());
    // How far each stage goes along the slope of the one before, and its weight in sixths.
    for (step, weight) in [(T::zero(), 1f64), (half, 2f64), (half, 2f64), (dt, 1f64)] {
        let at = x + k * step;
        let (slope_x, slope_tau) = rate_linearised(&at, tau, parameters);
        by_tau = slope_x * by_tau * step + slope_tau;
        by_x = slope_x + slope_x * by_x * step;
        k = rate(&at, tau, parameters);
        let weight: T = dt * nalgebra::convert(weight) / nalgebra::convert(6f64);
        a += by_x * weight;
        b += by_tau * weight;
    }
    (a, b)
}
