//! What a controller runs, as functions that are measured one by one: the emitted dynamics, friction, the
//! online estimator and one step of a controller, in single and in double precision.
#![no_std]

pub mod bus;
pub mod cycle;
#[cfg(target_os = "none")]
pub mod measure;
pub mod watch;

/// The LWA 4P without rotors, 19 parameters.
#[allow(dead_code)]
pub mod arm {
    include!(concat!(env!("OUT_DIR"), "/arm.rs"));
}

/// Joint positions, velocities and accelerations; rad and s.
pub const STATES: [[[f64; 6]; 3]; 4] = [
    [[0.3, -0.7, 1.1, 0.4, -1.2, 2.0], [0.5, -0.4, 0.3, 0.9, -0.8, 1.0], [1.0, 2.0, -1.5, 0.5, 3.0, -2.0]],
    [[-2.9, 1.8, -1.9, 2.9, 1.9, -2.9], [-1.2, 1.2, 1.1, -1.0, 0.9, -1.2], [4.0, -4.0, 3.0, -2.0, 1.0, 4.0]],
    [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]],
    [
        [12.5, 1.57, -0.785, 40.1, -99999.0, 1.0e-9],
        [0.01, 0.02, -0.03, 0.04, -0.05, 0.06],
        [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
    ],
];

/// Values of the 19 parameters, of the size that the arm's have.
pub const PARAMETERS: [f64; arm::PARAMETERS] = [
    1.25, -0.46, 2.9, 0.037, 0.82, 1.9, -0.21, 0.064, 0.031, 0.48, 0.0072, 0.093, 0.011, 0.0064, 0.35,
    0.0021, 0.0017, 0.12, 0.0009,
];

macro_rules! precision {
    ($(#[$doc:meta])* $scalar:ident) => {
        $(#[$doc])*
        pub mod $scalar {
            use crate::arm::{self, Prepared, Trig};
            use nalgebra::{SMatrix, SVector};
            use powerball::controller::friction::{TABLE_2, TanhFriction};
            use powerball::controller::online::SquareRoot;

            /// Joints.
            pub type Joints = SVector<$scalar, 6>;
            /// Parameters.
            pub type Parameters = SVector<$scalar, { arm::PARAMETERS }>;

            const fn cast<const N: usize>(from: [f64; N]) -> [$scalar; N] {
                let mut to = [0.0; N];
                let mut i = 0;
                while i < N {
                    to[i] = from[i] as $scalar;
                    i += 1;
                }
                to
            }

            /// [`crate::STATES`] in this precision.
            pub static STATES: [[[$scalar; 6]; 3]; 4] = {
                let mut to = [[[0.0; 6]; 3]; 4];
                let mut i = 0;
                while i < 12 {
                    to[i / 3][i % 3] = cast(crate::STATES[i / 3][i % 3]);
                    i += 1;
                }
                to
            };

            /// [`crate::PARAMETERS`] in this precision.
            pub static PARAMETERS: [$scalar; arm::PARAMETERS] = cast(crate::PARAMETERS);

            static FRICTION: [[$scalar; 5]; 6] = {
                let mut to = [[0.0; 5]; 6];
                let mut i = 0;
                while i < 6 {
                    to[i] = cast(TABLE_2[i]);
                    i += 1;
                }
                to
            };

            /// All sines and cosines.
            #[inline(never)]
            pub fn trig(q: &Joints) -> Trig<$scalar> {
                Trig::new(q)
            }

            /// What the functions take of the parameters, made once.
            #[inline(never)]
            pub fn prepared(p: &Parameters) -> Prepared<$scalar> {
                arm::prepare(p)
            }

            /// τ, with the trigonometry and the prepared parameters passed in, as everything below.
            #[inline(never)]
            pub fn tau(trig: &Trig<$scalar>, dq: &Joints, ddq: &Joints, p: &Prepared<$scalar>) -> Joints {
                arm::inverse_dynamics_with(trig, dq, ddq, p)
            }

            /// Y.
            #[inline(never)]
            pub fn regressor(trig: &Trig<$scalar>, dq: &Joints, ddq: &Joints) -> SMatrix<$scalar, 6, { arm::PARAMETERS }> {
                arm::regressor_with(trig, dq, ddq)
            }

            /// B.
            #[inline(never)]
            pub fn mass_matrix(trig: &Trig<$scalar>, p: &Prepared<$scalar>) -> SMatrix<$scalar, 6, 6> {
                arm::mass_matrix_with(trig, p)
            }

            /// C.
            #[inline(never)]
            pub fn coriolis(trig: &Trig<$scalar>, dq: &Joints, p: &Prepared<$scalar>) -> SMatrix<$scalar, 6, 6> {
                arm::coriolis_matrix_with(trig, dq, p)
            }

            /// g.
            #[inline(never)]
            pub fn gravity(trig: &Trig<$scalar>, p: &Prepared<$scalar>) -> Joints {
                arm::gravity_with(trig, p)
            }

            /// Friction of all joints, Eq. 16.
            #[inline(never)]
            pub fn friction(dq: &Joints) -> Joints {
                let mut torques = *dq;
                for (torque, gamma) in torques.iter_mut().zip(&FRICTION) {
                    *torque = TanhFriction::new(*gamma).torque(*torque);
                }
                torques
            }

            /// One row of the online estimator of all 19 parameters.
            #[inline(never)]
            pub fn estimator_row(online: &mut SquareRoot<$scalar, { arm::PARAMETERS }>, row: &Parameters, torque: $scalar) -> bool {
                online.update(row, torque, 1.0)
            }

            /// What the online estimator knows.
            #[inline(never)]
            pub fn estimate(online: &SquareRoot<$scalar, { arm::PARAMETERS }>) -> Option<Parameters> {
                online.estimate()
            }

            /// One control step: computed torque with friction, from where the joints are and should be.
            #[inline(never)]
            pub fn control(is: [&Joints; 2], wanted: [&Joints; 3], p: &Prepared<$scalar>) -> Joints {
                let [q, dq] = is;
                let [q_wanted, dq_wanted, ddq_wanted] = wanted;
                let ddq = ddq_wanted + (dq_wanted - dq) * 40.0 + (q_wanted - q) * 400.0;
                tau(&trig(q), dq, &ddq, p) + friction(dq_wanted)
            }
        }
    };
}

precision! {
    /// Single precision: no operation here, trigonometry included, is one on `f64`.
    f32
}
precision! {
    /// Double precision.
    f64
}
