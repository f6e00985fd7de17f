//! The closed loop as the controller runs it: sampled, and late by one cycle.

use super::number;
use nalgebra::{RealField, SMatrix};

/// Number of squarings: the 65 536th power of the loop gives its largest pole to 2·10⁻⁴ whatever its
/// eigenvectors are.
const SQUARINGS: i32 = 16;

/// The largest pole of a loop in absolute value; it is stable below 1.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct LargestPole<T>(pub T);

impl<T: RealField + Copy> LargestPole<T> {
    /// Whether errors decay, with a margin of 10⁻³ for what the number is not known to.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.0 < number(1.0 - 1e-3)
    }
}

/// The largest pole of B·q̈ = τ under τ = −K·q − D·q̇ that is measured at a SYNC, acts from the next one on
/// and holds for a cycle of `period` s. Units: kg·m², N·m/rad, N·m·s/rad.
///
/// The plant is double integrators with a hold, exactly discretised (Franklin, Powell, Workman: *Digital
/// Control of Dynamic Systems*, 3rd ed., §4.3); the state is q, q̇ and the torque that acts now. Friction is
/// left out: viscous friction only adds damping. The result holds near one pose; evaluate it with B of the
/// pose with the least inertia, and of others.
///
/// NaN if B is singular or a gain is NaN.
#[must_use]
pub fn largest_pole<T: RealField + Copy, const N: usize>(
    inertia: &SMatrix<T, N, N>,
    stiffness: &SMatrix<T, N, N>,
    damping: &SMatrix<T, N, N>,
    period: T,
) -> LargestPole<T> {
    let Some(mobility) = inertia.try_inverse() else { return LargestPole(number(f64::NAN)) };
    let (one, none) = (SMatrix::<T, N, N>::identity(), SMatrix::<T, N, N>::zeros());
    // In units of the period, so that no entry is small against the others.
    let push = mobility * (period * period);
    let mut loop_ =
        [[one, one, push * number::<T>(0.5)], [none, one, push], [-stiffness, -damping / period, none]];
    let mut exponent = T::zero();
    for step in 0..=SQUARINGS {
        let squares = loop_.iter().flatten().fold(T::zero(), |sum, block| sum + block.norm_squared());
        let norm = squares.sqrt();
        if !norm.is_finite() {
            return LargestPole(number(f64::NAN));
        }
        if norm == T::zero() {
            return LargestPole(T::zero());
        }
        exponent += norm.ln() / number::<T>(2.0).powi(step);
        loop_.iter_mut().flatten().for_each(|block| *block /= norm);
        let now = loop_;
        for (i, row) in loop_.iter_mut().enumerate() {
            for (j, block) in row.iter_mut().enumerate() {
                *block = now[i][0] * now[0][j] + now[i][1] * now[1][j] + now[i][2] * now[2][j];
            }
        }
    }
    LargestPole(exponent.exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Matrix3};

    /// The eigenvalues of the same 3 × 3 matrix by nalgebra.
    #[test]
    fn the_largest_pole_is_that_of_the_eigenvalues() {
        let (b, t) = (1.3, 0.005f64);
        for (k, d) in [(500.0, 50.0), (2000.0, 100.0), (2e4, 600.0), (-100.0, 20.0), (0.0, 10.0)] {
            let a = Matrix3::new(1.0, t, t * t / 2.0 / b, 0.0, 1.0, t / b, -k, -d, 0.0);
            let expected = a.complex_eigenvalues().iter().map(|z| z.re.hypot(z.im)).fold(0.0, f64::max);
            let found = largest_pole(&Matrix1::new(b), &Matrix1::new(k), &Matrix1::new(d), t).0;
            approx::assert_relative_eq!(found, expected, max_relative = 3e-4);
        }
    }

    #[test]
    fn gains_that_are_too_high_for_the_rate_or_negative_are_unstable() {
        let b = Matrix2::new(2.0, 0.3, 0.3, 0.5);
        let judge = |w: f64, t: f64| largest_pole(&b, &(b * w * w), &(b * 2.0 * w), t).is_stable();
        assert!(judge(20.0, 0.005) && judge(100.0, 0.001));
        assert!(!judge(200.0, 0.005) && !judge(20.0, 0.05));
        assert!(!largest_pole(&b, &(-b), &(b * 20.0), 0.005).is_stable());
        assert!(!largest_pole(&b, &(b * 400.0), &(b * -1.0), 0.005).is_stable());
        assert!(!largest_pole(&Matrix2::zeros(), &b, &b, 0.005).is_stable());
        assert!(!largest_pole(&b, &(b * f64::NAN), &b, 0.005).is_stable());
    }
}
