//! The arm's own consistency tests, emitted next to its functions: identities that hold between them, in
//! floating point.

use super::Options;
use crate::arm::{Arm, ParameterKind};
use crate::consistency;
use crate::dynamics::Function;
use crate::model::{Error, Model};
use proc_macro2::{Literal, TokenStream};
use quote::quote;
use std::collections::BTreeSet;

/// The test module for the functions of a file; each test needs those that it compares.
///
/// # Errors
/// As [`Model::function`].
pub(super) fn module(model: &Model, options: &Options) -> Result<TokenStream, Error> {
    use Function::*;
    let set = model.set(options.parameters)?;
    let values = match &options.values {
        Some(values) => values.clone(),
        None => model.set_values(set, &sample_bodies(model.arm())),
    };
    // Forward dynamics and definiteness are for values that a real arm can have.
    let possible = consistency::check(model, options.parameters, &values)?.possible;
    let baked = options.values.is_some();
    let p = if baked { quote!() } else { quote!(, &parameters()) };
    let of_any_values: [(&[Function], TokenStream); 4] = [
        (&[InverseDynamics, MassMatrix, CoriolisMatrix, Gravity], sum_of_parts(&p)),
        (&[InverseDynamics, Regressor], regressor_times_parameters(&p, baked)),
        (&[MassMatrix, CoriolisMatrix], skewness(&p)),
        (&[InverseDynamics, KineticEnergy, PotentialEnergy], energy_balance(&p)),
    ];
    let of_real_arms: [(&[Function], TokenStream); 2] =
        [(&[MassMatrix], definiteness(&p)), (&[InverseDynamics, ForwardDynamics], inverse_after_forward(&p))];
    let all = of_any_values.into_iter().chain(of_real_arms.into_iter().filter(|_| possible));
    let tests: Vec<TokenStream> = all
        .filter(|(needed, _)| needed.iter().all(|f| options.functions.contains(f)))
        .map(|(_, test)| quote!(#[test] #test))
        .collect();
    if tests.is_empty() {
        return Ok(quote!());
    }
    let parameters = (!baked).then(|| parameters(&values));
    let support = support(model.arm());
    Ok(quote! {
        #[cfg(test)]
        mod tests {
            use super::*;

            #parameters

            #support

            #(#tests)*
        }
    })
}

/// τ = M·q̈ + C·q̇ + g; `p` is how functions are given the parameters.
fn sum_of_parts(p: &TokenStream) -> TokenStream {
    quote! {
        fn the_torque_is_the_sum_of_its_parts() {
            for [q, dq, ddq] in states() {
                let parts = mass_matrix(&q #p) * ddq + coriolis_matrix(&q, &dq #p) * dq + gravity(&q #p);
                assert_close(&inverse_dynamics(&q, &dq, &ddq #p), &parts, 1e-9);
            }
        }
    }
}

/// τ = Y·π
fn regressor_times_parameters(p: &TokenStream, baked: bool) -> TokenStream {
    let values = if baked { quote!(SVector::from(PARAMETER_VALUES)) } else { quote!(parameters()) };
    quote! {
        fn the_torque_is_the_regressor_times_the_parameters() {
            for [q, dq, ddq] in states() {
                let product = regressor(&q, &dq, &ddq) * #values;
                assert_close(&inverse_dynamics(&q, &dq, &ddq #p), &product, 1e-9);
            }
        }
    }
}

/// Ṁ = C + Cᵀ
fn skewness(p: &TokenStream) -> TokenStream {
    quote! {
        fn the_rate_of_the_mass_matrix_less_twice_the_coriolis_matrix_is_skew() {
            let step = 1e-5;
            for [q, dq, _] in states() {
                let ahead = mass_matrix(&(q + dq * step) #p);
                let behind = mass_matrix(&(q - dq * step) #p);
                let rate = (ahead - behind) / (2.0 * step);
                let coriolis = coriolis_matrix(&q, &dq #p);
                assert_close(&(coriolis + coriolis.transpose()), &rate, 1e-6);
            }
        }
    }
}

/// q̇·τ is the rate of the energy.
fn energy_balance(p: &TokenStream) -> TokenStream {
    quote! {
        fn the_power_of_the_torques_is_the_change_of_energy() {
            let step = 1e-5;
            for [q, dq, ddq] in states() {
                let energy = |t: f64| {
                    let (place, velocity) = (q + dq * t + ddq * (0.5 * t * t), dq + ddq * t);
                    kinetic_energy(&place, &velocity #p) + potential_energy(&place #p)
                };
                let rate = SVector::<f64, 1>::new((energy(step) - energy(-step)) / (2.0 * step));
                let power = SVector::<f64, 1>::new(dq.dot(&inverse_dynamics(&q, &dq, &ddq #p)));
                assert_close(&power, &rate, 1e-6);
            }
        }
    }
}

/// M = Mᵀ > 0
fn definiteness(p: &TokenStream) -> TokenStream {
    quote! {
        fn the_mass_matrix_is_symmetric_and_positive_definite() {
            for [q, ..] in states() {
                let mass = mass_matrix(&q #p);
                assert_close(&mass, &mass.transpose(), 1e-12);
                assert!(mass.cholesky().is_some(), "not positive definite at {q}");
            }
        }
    }
}

/// Inverse dynamics of what forward dynamics makes of τ is τ.
fn inverse_after_forward(p: &TokenStream) -> TokenStream {
    quote! {
        fn inverse_after_forward_dynamics_gives_the_torque_back() {
            for [q, dq, tau] in states() {
                let ddq = forward_dynamics(&q, &dq, &tau #p);
                assert_close(&inverse_dynamics(&q, &dq, &ddq #p), &tau, 1e-7);
            }
        }
    }
}

/// The function that gives tests their parameters.
fn parameters(values: &[f64]) -> TokenStream {
    let values = values.iter().map(|x| Literal::f64_suffixed(*x));
    quote! {
        /// Values that a body of each link can have.
        fn parameters() -> SVector<f64, PARAMETERS> {
            SVector::from([#(#values),*])
        }
    }
}

/// Lines that move coordinates of some q to where loops close: about the middle of their joints' limits.
fn where_loops_close(arm: &Arm) -> Option<TokenStream> {
    let drives = arm.drives();
    let moved: BTreeSet<(usize, usize)> = arm
        .linkages()
        .map(|linkage| (drives[linkage.joint].coordinate, drives[linkage.joint].joint))
        .collect();
    let line = |(coordinate, joint): (usize, usize)| {
        let [lower, upper] = arm.joints[joint].position?;
        // States are within 1.5.
        let [middle, factor] =
            [0.5 * (lower + upper), (upper - lower).abs() / 6.0].map(Literal::f64_suffixed);
        let coordinate = Literal::usize_unsuffixed(coordinate);
        Some(quote!(q[#coordinate] = #middle + #factor * q[#coordinate];))
    };
    let lines: Vec<TokenStream> = moved.into_iter().filter_map(line).collect();
    (!lines.is_empty()).then(|| {
        quote! {
            .map(|[mut q, dq, ddq]| {
                #(#lines)*
                [q, dq, ddq]
            })
        }
    })
}

/// The states that tests take, and how they compare.
fn support(arm: &Arm) -> TokenStream {
    let where_loops_close = where_loops_close(arm);
    quote! {
        /// Positions, velocities, and accelerations or torques.
        fn states() -> impl Iterator<Item = [SVector<f64, JOINTS>; 3]> {
            (0..5_u8).map(|k| {
                [0.3, 1.7, 2.9].map(|phase| {
                    let mut angle = f64::from(k) * 2.1 + phase;
                    SVector::from_fn(|_, _| {
                        angle += 1.3;
                        1.5 * nalgebra::ComplexField::sin(angle)
                    })
                })
            })
            #where_loops_close
        }

        fn assert_close<const R: usize, const C: usize>(
            a: &SMatrix<f64, R, C>,
            b: &SMatrix<f64, R, C>,
            tolerance: f64,
        ) {
            let scale = a.abs().max().max(b.abs().max()).max(1.0);
            let error = (a - b).abs().max();
            assert!(error <= tolerance * scale, "{a} and {b} differ by {error}");
        }
    }
}

/// Eleven parameters a link of bodies that keep the declared symmetries: a compact body whose mass shrinks
/// outwards.
fn sample_bodies(arm: &Arm) -> Vec<f64> {
    let mut all = Vec::with_capacity(11 * arm.links());
    for link in 0..arm.links() {
        let mass = 4.0 / (1.0 + link as f64);
        let keeps = |kind| arm.keeps(crate::arm::Parameter { link, kind });
        let place = |kind, x: f64| if keeps(kind) { x } else { 0.0 };
        use ParameterKind::*;
        let r = [place(Mx, 0.04), place(My, -0.03), place(Mz, 0.05)];
        for kind in ParameterKind::ALL {
            // About the frame's origin: a ball of radius of gyration 0.2 m, moved by r (Huygens and Steiner).
            let across = |i: usize, j: usize| mass * (0.04 + r[i] * r[i] + r[j] * r[j]);
            let value = match kind {
                M => mass,
                Mx => mass * r[0],
                My => mass * r[1],
                Mz => mass * r[2],
                Ixx => across(1, 2),
                Iyy => across(0, 2),
                Izz => across(0, 1),
                Ixy => mass * r[0] * r[1],
                Ixz => mass * r[0] * r[2],
                Iyz => mass * r[1] * r[2],
                Im => 0.01,
            };
            all.push(place(kind, value));
        }
    }
    all
}
