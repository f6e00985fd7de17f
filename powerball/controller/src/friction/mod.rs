//! Joint friction as a function of joint velocity: the five-parameter model of the paper's Eq. 16.

mod tanh;

pub use tanh::TanhFriction;

/// The source of this model, which `powerball generate` copies into a controller's file.
pub const SOURCE: &str = include_str!("tanh.rs");

/// Table 2 of the paper: γ1 … γ5 of the six joints of the LWA 4P.
pub const TABLE_2: [[f64; 5]; 6] = [
    [4.58, 215.56, 2.11, 4.70, 14.76],
    [4.73, 216.73, 2.89, 5.11, 17.04],
    [4.59, 224.53, 2.42, 4.95, 15.94],
    [4.51, 200.66, 1.91, 3.33, 12.14],
    [0.05, 11.36, 0.28, 793.63, 0.41],
    [0.05, 10.59, 0.27, 782.43, 0.37],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_odd_dissipative_and_its_slope_is_its_derivative() {
        for gamma in TABLE_2 {
            let friction = TanhFriction::new(gamma);
            for dq in [-0.55, -0.02, -0.001, 0.0, 0.0005, 0.03, 0.4] {
                assert_eq!(friction.torque(-dq), -friction.torque(dq));
                assert!(friction.torque(dq) * dq >= 0.0);
                let h = 1e-7;
                let difference = (friction.torque(dq + h) - friction.torque(dq - h)) / (2.0 * h);
                // Central differences lose h²·f‴/6, and f‴ grows with the cube of the steepness.
                approx::assert_relative_eq!(
                    friction.slope(dq),
                    difference,
                    max_relative = 1e-4,
                    epsilon = 1e-4
                );
            }
        }
    }
}
