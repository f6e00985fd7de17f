//! The generated code of the test arms behind one interface, so that a test can go through all of it.

use nalgebra::SVector;

/// A state with parameter values: one sample.
pub type Call<'a> = dyngen::Samples<'a>;

/// The results of the functions of `dyngen::Function::common`, row-major, in their order.
pub type Results = Vec<Vec<f64>>;

/// One generated file.
#[derive(Clone, Copy, Debug)]
pub struct Generated {
    /// The arm's name for [`crate::arm`].
    pub arm: &'static str,
    /// The parameter set.
    pub set: dyngen::SetKind,
    /// Calls every function.
    pub call: fn(&Call<'_>) -> Results,
}

macro_rules! generated {
    ($($arm:literal $set:ident from $path:path;)*) => {
        /// Every generated file that the tests compile.
        pub const ALL: &[Generated] = &[$(Generated {
            arm: $arm,
            set: dyngen::SetKind::$set,
            call: |call| {
                use $path as arm;
                let joint = |x: &[f64]| SVector::<f64, { arm::JOINTS }>::from_column_slice(x);
                let (q, dq, ddq, tau) = (joint(call.q), joint(call.dq), joint(call.ddq), joint(call.tau));
                let (dqr, ddqr, e) = (joint(call.dqr), joint(call.ddqr), joint(call.e));
                let p = SVector::<f64, { arm::PARAMETERS }>::from_column_slice(call.parameters);
                vec![
                    arm::inverse_dynamics(&q, &dq, &ddq, &p).as_slice().to_vec(),
                    arm::inverse_dynamics_without_gravity(&q, &dq, &ddq, &p).as_slice().to_vec(),
                    arm::regressor(&q, &dq, &ddq).transpose().as_slice().to_vec(),
                    arm::regressor_transpose_times(&q, &dq, &ddq, &e).as_slice().to_vec(),
                    arm::slotine_li_regressor(&q, &dq, &dqr, &ddqr).transpose().as_slice().to_vec(),
                    arm::slotine_li_transpose_times(&q, &dq, &dqr, &ddqr, &e).as_slice().to_vec(),
                    arm::mass_matrix(&q, &p).transpose().as_slice().to_vec(),
                    arm::mass_matrix_inverse(&q, &p).transpose().as_slice().to_vec(),
                    arm::coriolis_matrix(&q, &dq, &p).transpose().as_slice().to_vec(),
                    arm::coriolis_times_velocity(&q, &dq, &p).as_slice().to_vec(),
                    arm::coriolis_transpose_times_velocity(&q, &dq, &p).as_slice().to_vec(),
                    arm::gravity(&q, &p).as_slice().to_vec(),
                    arm::forward_dynamics(&q, &dq, &tau, &p).as_slice().to_vec(),
                    arm::forward_kinematics(&q).transpose().as_slice().to_vec(),
                    arm::jacobian(&q).transpose().as_slice().to_vec(),
                    arm::jacobian_rate_times_velocity(&q, &dq).as_slice().to_vec(),
                    vec![arm::kinetic_energy(&q, &dq, &p)],
                    vec![arm::potential_energy(&q, &p)],
                    arm::kinetic_energy_regressor(&q, &dq).as_slice().to_vec(),
                    arm::potential_energy_regressor(&q).as_slice().to_vec(),
                    arm::momentum(&q, &dq, &p).as_slice().to_vec(),
                    arm::torque_by_position(&q, &dq, &ddq, &p).transpose().as_slice().to_vec(),
                    arm::torque_by_velocity(&q, &dq, &ddq, &p).transpose().as_slice().to_vec(),
                ]
            },
        }),*];
    };
}

macro_rules! files {
    ($($module:ident = $file:literal;)*) => {
        $(#[doc = concat!("Generated: ", $file)]
        pub mod $module {
            include!(concat!(env!("OUT_DIR"), "/", $file));
        })*
    };
}

files! {
    lwa4p_full = "lwa4p_full.rs";
    lwa4p_minimal = "lwa4p_minimal.rs";
    lwa4p_symbolic = "lwa4p_symbolic.rs";
    lwa4p_published = "lwa4p_published.rs";
    lwa4p_rotorless_minimal = "lwa4p_rotorless_minimal.rs";
    lwa4p_rotorless_control = "lwa4p_rotorless_control.rs";
    lwa4p_rotorless_discrete = "lwa4p_rotorless_discrete.rs";
    puma560_full = "puma560_full.rs";
    puma560_minimal = "puma560_minimal.rs";
    puma560_symbolic = "puma560_symbolic.rs";
    ur5e_full = "ur5e_full.rs";
    ur5e_minimal = "ur5e_minimal.rs";
    ur5e_symbolic = "ur5e_symbolic.rs";
    panda_full = "panda_full.rs";
    panda_minimal = "panda_minimal.rs";
    panda_symbolic = "panda_symbolic.rs";
    stanford_full = "stanford_full.rs";
    stanford_minimal = "stanford_minimal.rs";
    stanford_symbolic = "stanford_symbolic.rs";
}

generated! {
    "arm" Full from lwa4p_full;
    "arm" Minimal from lwa4p_minimal;
    "arm" Symbolic from lwa4p_symbolic;
    "arm" Published from lwa4p_published;
    "puma560" Full from puma560_full;
    "puma560" Minimal from puma560_minimal;
    "puma560" Symbolic from puma560_symbolic;
    "ur5e" Full from ur5e_full;
    "ur5e" Minimal from ur5e_minimal;
    "ur5e" Symbolic from ur5e_symbolic;
    "panda" Full from panda_full;
    "panda" Minimal from panda_minimal;
    "panda" Symbolic from panda_symbolic;
    "stanford" Full from stanford_full;
    "stanford" Minimal from stanford_minimal;
    "stanford" Symbolic from stanford_symbolic;
}
