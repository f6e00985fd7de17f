//! The arm over one step of time, with its linearisation, for predictive controllers; composed of the file's
//! own functions.

use super::Options;
use crate::dynamics::Function;
use proc_macro2::TokenStream;
use quote::quote;

/// The functions that the module is composed of.
const NEEDED: [Function; 4] = [
    Function::ForwardDynamics,
    Function::MassMatrixInverse,
    Function::AccelerationByPosition,
    Function::AccelerationByVelocity,
];

/// The module `discrete`, where the file has what it needs.
pub(super) fn module(options: &Options) -> Option<TokenStream> {
    if !NEEDED.iter().all(|f| options.functions.contains(f)) {
        return None;
    }
    Some(text(options.values.is_some()))
}

/// The text of the module: where values are baked in functions take no parameters.
pub(crate) fn text(baked: bool) -> TokenStream {
    let signature = if baked { quote!() } else { quote!(, parameters: &impl Parameters<T>) };
    let passed = if baked { quote!() } else { quote!(, parameters) };
    let prepared = if baked { quote!() } else { quote!(let parameters = &parameters.prepared();) };
    let rates = rates(&signature, &passed);
    let semi_implicit = semi_implicit(&signature, &passed);
    let runge_kutta = runge_kutta(&signature, &passed, &prepared);
    quote! {
        /// The state x = (q, q̇) after a step of time under torques that stay the same, and its linearisation
        /// x⁺ ≈ A·δx + B·δτ, without friction.
        pub mod discrete {
            #[allow(unused_imports)]
            use super::*;

            /// Numbers in a state: q above q̇.
            pub const STATES: usize = 2 * JOINTS;

            /// q above q̇.
            pub type State<T> = SVector<T, STATES>;

            /// ∂x⁺/∂x and ∂x⁺/∂τ.
            pub type Linearised<T> = (SMatrix<T, STATES, STATES>, SMatrix<T, STATES, JOINTS>);

            #rates

            #semi_implicit

            #runge_kutta
        }
    }
}

/// ẋ and its derivatives.
fn rates(signature: &TokenStream, passed: &TokenStream) -> TokenStream {
    quote! {
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
        fn rate<T: SimdRealField + Copy>(x: &State<T>, tau: &SVector<T, JOINTS> #signature) -> State<T> {
            let (q, dq) = joints(x);
            state(&dq, &forward_dynamics_with(&Trig::new(&q), &dq, tau #passed))
        }

        /// ∂ẋ/∂x and ∂ẋ/∂τ.
        fn rate_linearised<T: SimdRealField + Copy>(
            x: &State<T>,
            tau: &SVector<T, JOINTS> #signature
        ) -> Linearised<T> {
            let (q, dq) = joints(x);
            let trig = Trig::new(&q);
            let (mut a, mut b): Linearised<T> = (SMatrix::zeros(), SMatrix::zeros());
            a.fixed_view_mut::<JOINTS, JOINTS>(0, JOINTS).fill_with_identity();
            a.fixed_view_mut::<JOINTS, JOINTS>(JOINTS, 0)
                .copy_from(&acceleration_by_position_with(&trig, &dq, tau #passed));
            a.fixed_view_mut::<JOINTS, JOINTS>(JOINTS, JOINTS)
                .copy_from(&acceleration_by_velocity_with(&trig, &dq, tau #passed));
            b.fixed_view_mut::<JOINTS, JOINTS>(JOINTS, 0).copy_from(&mass_matrix_inverse_with(&trig #passed));
            (a, b)
        }
    }
}

/// Euler's symplectic step.
fn semi_implicit(signature: &TokenStream, passed: &TokenStream) -> TokenStream {
    quote! {
        /// A step of the semi-implicit Euler method: q̇⁺ = q̇ + dt·q̈, q⁺ = q + dt·q̇⁺; `dt` in s. Its error
        /// is of second order in a step.
        #[must_use]
        pub fn semi_implicit<T: SimdRealField + Copy>(
            x: &State<T>,
            tau: &SVector<T, JOINTS> #signature,
            dt: T,
        ) -> State<T> {
            let (q, dq) = joints(x);
            let dq = dq + forward_dynamics_with(&Trig::new(&q), &dq, tau #passed) * dt;
            state(&(q + dq * dt), &dq)
        }

        /// A and B of that step.
        #[must_use]
        pub fn semi_implicit_linearised<T: SimdRealField + Copy>(
            x: &State<T>,
            tau: &SVector<T, JOINTS> #signature,
            dt: T,
        ) -> Linearised<T> {
            let (a, b) = rate_linearised(x, tau #passed);
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
    }
}

/// The classical method of fourth order.
fn runge_kutta(signature: &TokenStream, passed: &TokenStream, prepared: &TokenStream) -> TokenStream {
    quote! {
        /// A step of the classical Runge-Kutta method; `dt` in s. Its error is of fifth order in a step.
        #[must_use]
        pub fn runge_kutta<T: SimdRealField + Copy>(
            x: &State<T>,
            tau: &SVector<T, JOINTS> #signature,
            dt: T,
        ) -> State<T> {
            #prepared
            let half: T = dt * nalgebra::convert(0.5f64);
            let k1 = rate(x, tau #passed);
            let k2 = rate(&(x + k1 * half), tau #passed);
            let k3 = rate(&(x + k2 * half), tau #passed);
            let k4 = rate(&(x + k3 * dt), tau #passed);
            x + (k1 + k4 + (k2 + k3) * nalgebra::convert::<f64, T>(2f64)) * (dt / nalgebra::convert(6f64))
        }

        /// A and B of that step, exactly: the derivatives of its four stages.
        #[must_use]
        pub fn runge_kutta_linearised<T: SimdRealField + Copy>(
            x: &State<T>,
            tau: &SVector<T, JOINTS> #signature,
            dt: T,
        ) -> Linearised<T> {
            #prepared
            let half: T = dt * nalgebra::convert(0.5f64);
            let mut k = State::<T>::zeros();
            let (mut by_x, mut by_tau): Linearised<T> = (SMatrix::zeros(), SMatrix::zeros());
            let (mut a, mut b): Linearised<T> = (SMatrix::identity(), SMatrix::zeros());
            // How far each stage goes along the slope of the one before, and its weight in sixths.
            for (step, weight) in [(T::zero(), 1f64), (half, 2f64), (half, 2f64), (dt, 1f64)] {
                let at = x + k * step;
                let (slope_x, slope_tau) = rate_linearised(&at, tau #passed);
                by_tau = slope_x * by_tau * step + slope_tau;
                by_x = slope_x + slope_x * by_x * step;
                k = rate(&at, tau #passed);
                let weight: T = dt * nalgebra::convert(weight) / nalgebra::convert(6f64);
                a += by_x * weight;
                b += by_tau * weight;
            }
            (a, b)
        }
    }
}
