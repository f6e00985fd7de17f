//! The pose as a power series in time, modulo the prime: what kinematics is proven against.

use super::point::Point;
use crate::arm::{Convention, Placement};
use crate::exact::algebra::Algebra;
use crate::exact::prime::Fp;
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

type Matrix = [[Series; 4]; 4];

fn times(a: Matrix, b: &Matrix) -> Matrix {
    let alg = SeriesAlgebra;
    let entry = |i: usize, j: usize| {
        (0..4).fold(alg.integer(0), |sum, k| alg.add(&sum, &alg.mul(&a[i][k], &b[k][j])))
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The transforms that lead to a placed frame, in order; none without one.
fn fixed(point: &Point<'_>, placement: &Option<Placement>) -> Vec<Matrix> {
    let Some(placement) = placement else { return Vec::new() };
    let alg = SeriesAlgebra;
    let (zero, one) = (alg.integer(0), alg.integer(1));
    let symbol = |index, sine| [point.sets.field.modular_symbol(index, sine), Fp::ZERO, Fp::ZERO];
    let frame = PlacementElements::build(&alg, Some(placement), point.symbols, number, symbol);
    let [x, y, z] = frame.origin;
    let [(sr, cr), (sp, cp), (sy, cy)] = frame.rpy;
    let last = [zero, zero, zero, one];
    let shift = [[one, zero, zero, x], [zero, one, zero, y], [zero, zero, one, z], last];
    let yaw = [[cy, alg.neg(&sy), zero, zero], [sy, cy, zero, zero], [zero, zero, one, zero], last];
    let pitch = [[cp, zero, sp, zero], [zero, one, zero, zero], [alg.neg(&sp), zero, cp, zero], last];
    let roll = [[one, zero, zero, zero], [zero, cr, alg.neg(&sr), zero], [zero, sr, cr, zero], last];
    vec![shift, yaw, pitch, roll]
}

/// The tool frame's transform along a motion of constant joint velocities.
pub(super) struct PoseSeries(Matrix);

impl PoseSeries {
    pub(super) fn along(point: &Point<'_>, velocities: &[Fp]) -> PoseSeries {
        let alg = SeriesAlgebra;
        let elements =
            ArmElements::build(&alg, point.arm, point.symbols, &mut SeriesSource { point, velocities });
        let (zero, one) = (alg.integer(0), alg.integer(1));
        let same: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { one } else { zero }));
        let mut pose = fixed(point, &point.arm.base).iter().fold(same, times);
        for joint in &elements.joints {
            let (s, c, sa, ca) = (joint.sin, joint.cos, joint.sin_alpha, joint.cos_alpha);
            let about_z = [
                [c, alg.neg(&s), zero, zero],
                [s, c, zero, zero],
                [zero, zero, one, joint.shift],
                [zero, zero, zero, one],
            ];
            let about_x = [
                [one, zero, zero, joint.a],
                [zero, ca, alg.neg(&sa), joint.b],
                [zero, sa, ca, zero],
                [zero, zero, zero, one],
            ];
            let steps = match point.arm.convention {
                Convention::Standard => [about_z, about_x],
                Convention::Modified => [about_x, about_z],
            };
            for step in steps {
                pose = times(pose, &step);
            }
        }
        PoseSeries(fixed(point, &point.arm.tool).iter().fold(pose, times))
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
