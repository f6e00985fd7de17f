//! The pose with its first and mixed second derivatives, modulo the prime: what kinematics is proven against.

use super::point::Point;
use crate::arm::{Convention, Placement};
use crate::exact::algebra::Algebra;
use crate::exact::dual::Duals;
use crate::exact::prime::{Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::lagrangian::elements::{ArmElements, PlacementElements, Source};

/// A value where q changes by s·u + t·v: ((x, ∂x/∂s), (∂x/∂t, ∂²x/∂s∂t)).
type Mixed = ((Fp, Fp), (Fp, Fp));

type Matrix<V> = [[V; 4]; 4];

fn times<A: Algebra>(alg: &A, a: &Matrix<A::Value>, b: &Matrix<A::Value>) -> Matrix<A::Value> {
    let entry = |i: usize, j: usize| {
        (0..4).fold(alg.integer(0), |sum, k| alg.add(&sum, &alg.mul(&a[i][k], &b[k][j])))
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// A turn about an axis of a frame: rows and columns `i` and `j` turn into each other.
fn turn<A: Algebra>(alg: &A, (i, j): (usize, usize), sin: &A::Value, cos: &A::Value) -> Matrix<A::Value> {
    let mut matrix = same(alg);
    (matrix[i][i], matrix[j][j]) = (cos.clone(), cos.clone());
    (matrix[i][j], matrix[j][i]) = (alg.neg(sin), sin.clone());
    matrix
}

fn same<A: Algebra>(alg: &A) -> Matrix<A::Value> {
    std::array::from_fn(|i| std::array::from_fn(|j| alg.integer(i64::from(i == j))))
}

fn shift<A: Algebra>(alg: &A, by: [&A::Value; 3]) -> Matrix<A::Value> {
    let mut matrix = same(alg);
    by.into_iter().enumerate().for_each(|(i, x)| matrix[i][3] = x.clone());
    matrix
}

/// The transforms that lead to a placed frame, in order; none without one.
fn fixed<A: Algebra>(
    alg: &A,
    point: &Point<'_>,
    placement: &Option<Placement>,
    of: &dyn Fn(Fp) -> A::Value,
) -> Vec<Matrix<A::Value>> {
    let Some(placement) = placement else { return Vec::new() };
    let number = |x: &Rational| of(Fp::from_rational(x).unwrap_or(Fp::ZERO));
    let symbol = |index, sine| of(point.sets.field.modular_symbol(index, sine));
    let frame = PlacementElements::build(alg, Some(placement), point.symbols, number, symbol);
    let [x, y, z] = &frame.origin;
    let [(sr, cr), (sp, cp), (sy, cy)] = &frame.rpy;
    vec![
        shift(alg, [x, y, z]),
        turn(alg, (0, 1), sy, cy),
        turn(alg, (2, 0), sp, cp),
        turn(alg, (1, 2), sr, cr),
    ]
}

/// The tool frame's transform over an algebra in which positions are given by `source`.
fn tool<A: Algebra>(
    alg: &A,
    point: &Point<'_>,
    source: &mut impl Source<A::Value>,
    of: &dyn Fn(Fp) -> A::Value,
) -> Matrix<A::Value> {
    let elements = ArmElements::build(alg, point.arm, point.symbols, source);
    let along = |pose: Matrix<A::Value>, step: &Matrix<A::Value>| times(alg, &pose, step);
    let mut pose = fixed(alg, point, &point.arm.base, of).iter().fold(same(alg), along);
    let zero = alg.integer(0);
    for joint in &elements.joints[..=point.arm.tool_carrier()] {
        let about_z =
            times(alg, &turn(alg, (0, 1), &joint.sin, &joint.cos), &shift(alg, [&zero, &zero, &joint.shift]));
        let about_x = times(
            alg,
            &shift(alg, [&joint.a, &joint.b, &zero]),
            &turn(alg, (1, 2), &joint.sin_alpha, &joint.cos_alpha),
        );
        let steps = match point.arm.convention {
            Convention::Standard => [about_z, about_x],
            Convention::Modified => [about_x, about_z],
        };
        pose = steps.iter().fold(pose, along);
    }
    fixed(alg, point, &point.arm.tool, of).iter().fold(pose, along)
}

/// The tool frame's transform where q changes by s·u + t·v.
pub(super) struct PoseSeries(Matrix<Mixed>);

impl PoseSeries {
    /// Along a motion of constant joint velocities v.
    pub(super) fn along(point: &Point<'_>, v: &[Fp]) -> PoseSeries {
        PoseSeries::mixed(point, v, v)
    }

    pub(super) fn mixed(point: &Point<'_>, u: &[Fp], v: &[Fp]) -> PoseSeries {
        let alg = Duals(Duals(PrimeField));
        PoseSeries(tool(&alg, point, &mut MixedSource { point, u, v }, &constant))
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

/// The arm's quantities where q changes by s·u + t·v.
struct MixedSource<'p, 'a> {
    point: &'p Point<'a>,
    u: &'p [Fp],
    v: &'p [Fp],
}

impl MixedSource<'_, '_> {
    fn rates(&self, joint: usize) -> (Fp, Fp) {
        let drive = &self.point.drives[joint];
        (drive.ratio * self.u[drive.coordinate], drive.ratio * self.v[drive.coordinate])
    }
}

fn constant(x: Fp) -> Mixed {
    ((x, Fp::ZERO), (Fp::ZERO, Fp::ZERO))
}

fn number(value: &Rational) -> Mixed {
    constant(Fp::from_rational(value).unwrap_or(Fp::ZERO))
}

impl Source<Mixed> for MixedSource<'_, '_> {
    fn joint_trig(&mut self, joint: usize) -> (Mixed, Mixed) {
        let ((s, c), (u, v)) = (self.point.joint_trig(joint), self.rates(joint));
        (((s, c * u), (c * v, -(s * u * v))), ((c, -(s * u)), (-(s * v), -(c * u * v))))
    }
    fn position(&mut self, joint: usize) -> Mixed {
        let (u, v) = self.rates(joint);
        ((self.point.joint_position(joint), u), (v, Fp::ZERO))
    }
    fn velocity(&mut self, _: usize) -> Mixed {
        constant(Fp::ZERO)
    }
    fn a(&mut self, joint: usize) -> Mixed {
        number(&self.point.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Mixed {
        number(&self.point.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Mixed {
        number(&self.point.arm.joints[joint].d)
    }
    fn ratio(&mut self, _: usize) -> Mixed {
        constant(Fp::ZERO)
    }
    fn coupling(&mut self, _: &Rational) -> Mixed {
        constant(Fp::ZERO)
    }
    fn gravity(&mut self, _: usize) -> Mixed {
        constant(Fp::ZERO)
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Mixed {
        constant(self.point.sets.field.modular_symbol(index, sine))
    }
}
