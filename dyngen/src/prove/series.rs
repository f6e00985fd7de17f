//! The pose as a power series in time, modulo the prime: what kinematics is proven against.

use super::point::Point;
use crate::arm::{Convention, Placement};
use crate::exact::algebra::Algebra;
use crate::exact::dual::Duals;
use crate::exact::prime::{Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::lagrangian::elements::{ArmElements, PlacementElements, Source};

/// x₀ + x₁ t + x₂ t²
type Series = [Fp; 3];

/// Power series to second order.
struct SeriesAlgebra;

impl Algebra for SeriesAlgebra {
    type Value = Series;
    fn integer(&self, value: i64) -> Series {
        [Fp::from_integer(value), Fp::ZERO, Fp::ZERO]
    }
    fn is_zero(&self, a: &Series) -> bool {
        *a == [Fp::ZERO; 3]
    }
    fn add(&self, a: &Series, b: &Series) -> Series {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
    }
    fn neg(&self, a: &Series) -> Series {
        a.map(|x| -x)
    }
    fn mul(&self, a: &Series, b: &Series) -> Series {
        [a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[1] * b[1] + a[2] * b[0]]
    }
}

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

/// The tool frame's transform along a motion of constant joint velocities.
pub(super) struct PoseSeries(Matrix<Series>);

impl PoseSeries {
    pub(super) fn along(point: &Point<'_>, velocities: &[Fp]) -> PoseSeries {
        let of = |x| [x, Fp::ZERO, Fp::ZERO];
        PoseSeries(tool(&SeriesAlgebra, point, &mut SeriesSource { point, velocities }, &of))
    }

    /// ∂/∂s of the tool's velocity under q̇ = v, where q changes by s·u: linear above angular.
    pub(super) fn mixed(point: &Point<'_>, u: &[Fp], v: &[Fp]) -> Vec<Fp> {
        let alg = Duals(Duals(PrimeField));
        let of = |x| ((x, Fp::ZERO), (Fp::ZERO, Fp::ZERO));
        let pose = tool(&alg, point, &mut MixedSource { point, u, v }, &of);
        // A value is ((x, ∂x/∂s), (∂x/∂t, ∂²x/∂s∂t)); ω is in ∂R/∂t·Rᵀ.
        let spin = |i: usize, j: usize| {
            (0..3).fold(Fp::ZERO, |sum, k| {
                let (_, (by_t, both)) = pose[i][k];
                let ((x, by_s), _) = pose[j][k];
                sum + both * x + by_t * by_s
            })
        };
        let origin = (0..3).map(|i| pose[i][3].1.1);
        origin.chain([spin(2, 1), spin(0, 2), spin(1, 0)]).collect()
    }

    /// The transform itself, row-major.
    pub(super) fn pose(&self) -> Vec<Fp> {
        self.0.iter().flatten().map(|x| x[0]).collect()
    }

    /// Velocity of the origin and angular velocity: ṗ, and ω from Ṙ·Rᵀ.
    pub(super) fn velocity(&self) -> Vec<Fp> {
        let spin = |i: usize, j: usize| (0..3).fold(Fp::ZERO, |s, k| s + self.0[i][k][1] * self.0[j][k][0]);
        [self.origin(1).to_vec(), vec![spin(2, 1), spin(0, 2), spin(1, 0)]].concat()
    }

    /// Acceleration of the origin and angular acceleration: p̈, and from d/dt(Ṙ·Rᵀ).
    pub(super) fn acceleration(&self) -> Vec<Fp> {
        let two = Fp::from_integer(2);
        let spin = |i: usize, j: usize| {
            (0..3).fold(Fp::ZERO, |s, k| {
                let (a, b) = (self.0[i][k], self.0[j][k]);
                s + two * a[2] * b[0] + a[1] * b[1]
            })
        };
        [self.origin(2).map(|x| two * x).to_vec(), vec![spin(2, 1), spin(0, 2), spin(1, 0)]].concat()
    }

    fn origin(&self, order: usize) -> [Fp; 3] {
        std::array::from_fn(|i| self.0[i][3][order])
    }
}

struct SeriesSource<'p, 'a> {
    point: &'p Point<'a>,
    velocities: &'p [Fp],
}

/// The arm's quantities where q changes by s·u + t·v.
struct MixedSource<'p, 'a> {
    point: &'p Point<'a>,
    u: &'p [Fp],
    v: &'p [Fp],
}

type Mixed = ((Fp, Fp), (Fp, Fp));

impl MixedSource<'_, '_> {
    fn rates(&self, joint: usize) -> (Fp, Fp) {
        let drive = &self.point.drives[joint];
        (drive.ratio * self.u[drive.coordinate], drive.ratio * self.v[drive.coordinate])
    }
}

fn mixed(x: Fp) -> Mixed {
    ((x, Fp::ZERO), (Fp::ZERO, Fp::ZERO))
}

fn mixed_number(value: &Rational) -> Mixed {
    mixed(Fp::from_rational(value).unwrap_or(Fp::ZERO))
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
        mixed(Fp::ZERO)
    }
    fn a(&mut self, joint: usize) -> Mixed {
        mixed_number(&self.point.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Mixed {
        mixed_number(&self.point.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Mixed {
        mixed_number(&self.point.arm.joints[joint].d)
    }
    fn ratio(&mut self, _: usize) -> Mixed {
        mixed(Fp::ZERO)
    }
    fn coupling(&mut self, _: &Rational) -> Mixed {
        mixed(Fp::ZERO)
    }
    fn gravity(&mut self, _: usize) -> Mixed {
        mixed(Fp::ZERO)
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Mixed {
        mixed(self.point.sets.field.modular_symbol(index, sine))
    }
}

fn number(value: &Rational) -> Series {
    [Fp::from_rational(value).unwrap_or(Fp::ZERO), Fp::ZERO, Fp::ZERO]
}

impl SeriesSource<'_, '_> {
    /// Of a joint of the chain.
    fn rate(&self, joint: usize) -> Fp {
        let drive = &self.point.drives[joint];
        drive.ratio * self.velocities[drive.coordinate]
    }
}

impl Source<Series> for SeriesSource<'_, '_> {
    fn joint_trig(&mut self, joint: usize) -> (Series, Series) {
        let ((s, c), v) = (self.point.joint_trig(joint), self.rate(joint));
        let half = v * v * Fp::from_integer(2).inverse().unwrap_or(Fp::ONE);
        ([s, c * v, -(s * half)], [c, -(s * v), -(c * half)])
    }
    fn position(&mut self, joint: usize) -> Series {
        [self.point.joint_position(joint), self.rate(joint), Fp::ZERO]
    }
    fn velocity(&mut self, joint: usize) -> Series {
        [self.rate(joint), Fp::ZERO, Fp::ZERO]
    }
    fn a(&mut self, joint: usize) -> Series {
        number(&self.point.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Series {
        number(&self.point.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Series {
        number(&self.point.arm.joints[joint].d)
    }
    fn ratio(&mut self, _: usize) -> Series {
        [Fp::ZERO; 3]
    }
    fn coupling(&mut self, _: &Rational) -> Series {
        [Fp::ZERO; 3]
    }
    fn gravity(&mut self, _: usize) -> Series {
        [Fp::ZERO; 3]
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Series {
        [self.point.sets.field.modular_symbol(index, sine), Fp::ZERO, Fp::ZERO]
    }
}
