//! The pose with its first and mixed second derivatives, modulo the prime, against which kinematics is
//! proven.

use super::point::Point;
use super::varied::{MIXED, Mixed, Varied, mixed};
use crate::arm::Convention;
use crate::exact::algebra::Algebra;
use crate::exact::dual::Duals;
use crate::exact::prime::{Fp, PrimeField};
use crate::lagrangian::elements::{ArmElements, PlacementElements};

type Matrix = [[Mixed; 4]; 4];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |i: usize, j: usize| {
        (0..4).fold(MIXED.integer(0), |sum, k| MIXED.add(&sum, &MIXED.mul(&a[i][k], &b[k][j])))
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// A turn about an axis of a frame: rows and columns `i` and `j` turn into each other.
fn turn((i, j): (usize, usize), sin: &Mixed, cos: &Mixed) -> Matrix {
    let mut matrix = same();
    (matrix[i][i], matrix[j][j]) = (*cos, *cos);
    (matrix[i][j], matrix[j][i]) = (MIXED.neg(sin), *sin);
    matrix
}

fn same() -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| MIXED.integer(i64::from(i == j))))
}

fn shift(by: [&Mixed; 3]) -> Matrix {
    let mut matrix = same();
    by.into_iter().enumerate().for_each(|(i, x)| matrix[i][3] = *x);
    matrix
}

/// The transforms that lead to a placed frame, in order.
fn fixed(frame: &PlacementElements<Mixed>) -> [Matrix; 4] {
    let [x, y, z] = &frame.origin;
    let [(sr, cr), (sp, cp), (sy, cy)] = &frame.rpy;
    [shift([x, y, z]), turn((0, 1), sy, cy), turn((2, 0), sp, cp), turn((1, 2), sr, cr)]
}

/// The tool frame's transform at a varied point.
fn tool(mut varied: Varied<'_, '_, Duals<Duals<PrimeField>>>) -> Matrix {
    let arm = varied.point.arm;
    let elements = ArmElements::build(&MIXED, arm, varied.point.symbols, &mut varied);
    let along = |pose: Matrix, step: &Matrix| times(&pose, step);
    let mut pose = fixed(&varied.placement(&arm.base)).iter().fold(same(), along);
    let zero = MIXED.integer(0);
    for joint in &elements.joints[..=arm.tool_carrier()] {
        let about_z = times(&turn((0, 1), &joint.sin, &joint.cos), &shift([&zero, &zero, &joint.shift]));
        let about_x =
            times(&shift([&joint.a, &joint.b, &zero]), &turn((1, 2), &joint.sin_alpha, &joint.cos_alpha));
        let steps = match arm.convention {
            Convention::Standard => [about_z, about_x],
            Convention::Modified => [about_x, about_z],
        };
        pose = steps.iter().fold(pose, along);
    }
    fixed(&varied.placement(&arm.tool)).iter().fold(pose, along)
}

/// The tool frame's transform where q changes by s·u + t·v.
pub(super) struct PoseSeries(Matrix);

impl PoseSeries {
    /// Along a motion of constant joint velocities v.
    pub(super) fn along(point: &Point<'_>, v: &[Fp]) -> PoseSeries {
        PoseSeries::mixed(point, v, v)
    }

    pub(super) fn mixed(point: &Point<'_>, u: &[Fp], v: &[Fp]) -> PoseSeries {
        let change = u.iter().zip(v).map(|(u, v)| mixed(Fp::ZERO, *u, *v)).collect();
        PoseSeries(tool(Varied { algebra: MIXED, point, change }))
    }

    /// The transform itself, row-major.
    pub(super) fn pose(&self) -> Vec<Fp> {
        self.0.iter().flatten().map(|x| x.0.0).collect()
    }

    /// Velocity of the origin and angular velocity under q̇ = v: ∂p/∂t, and ω from ∂R/∂t·Rᵀ.
    pub(super) fn velocity(&self) -> Vec<Fp> {
        self.linear_and_angular(|x| x.1.0, |a, b| a.1.0 * b.0.0)
    }

    /// ∂/∂s of that velocity; with u = v the acceleration where v is constant.
    pub(super) fn acceleration(&self) -> Vec<Fp> {
        self.linear_and_angular(|x| x.1.1, |a, b| a.1.1 * b.0.0 + a.1.0 * b.0.1)
    }

    /// A part of the origin, and the axial vector of Σ over columns of products of two rows of R.
    fn linear_and_angular(&self, part: fn(&Mixed) -> Fp, product: fn(&Mixed, &Mixed) -> Fp) -> Vec<Fp> {
        let spin =
            |i: usize, j: usize| (0..3).fold(Fp::ZERO, |sum, k| sum + product(&self.0[i][k], &self.0[j][k]));
        let origin = (0..3).map(|i| part(&self.0[i][3]));
        origin.chain([spin(2, 1), spin(0, 2), spin(1, 0)]).collect()
    }
}

/// A Jacobian in base axes, 6 × n, in the axes of a pose: Rᵀ·v above Rᵀ·ω.
pub(super) fn in_tool_axes(pose: &[Fp], jacobian: &[Fp], n: usize) -> Vec<Fp> {
    let entry = |i: usize, j: usize| {
        (0..3).fold(Fp::ZERO, |sum, k| sum + pose[k * 4 + i % 3] * jacobian[(i / 3 * 3 + k) * n + j])
    };
    (0..6 * n).map(|k| entry(k / n, k % n)).collect()
}

/// A Jacobian in base axes, about the base's origin: v + p×ω above ω.
pub(super) fn about_base(pose: &[Fp], jacobian: &[Fp], n: usize) -> Vec<Fp> {
    let (origin, angular) =
        (|i: usize| pose[i % 3 * 4 + 3], |i: usize, j: usize| jacobian[(3 + i % 3) * n + j]);
    let entry = |i: usize, j: usize| match i {
        0..3 => jacobian[i * n + j] + origin(i + 1) * angular(i + 2, j) - origin(i + 2) * angular(i + 1, j),
        _ => jacobian[i * n + j],
    };
    (0..6 * n).map(|k| entry(k / n, k % n)).collect()
}
