//! Graph against Lagrangian: every function, exactly, at random points of a 61-bit prime field.
//!
//! The Lagrangian is evaluated over jets, which gives the Euler–Lagrange equations without any recursion. A
//! wrong formula is a polynomial that is not zero; with degrees below 100 it vanishes at one random point
//! with probability below 2⁻⁵⁴, and at both points with probability below 2⁻¹⁰⁸.

mod point;
mod series;
mod state;
mod total;
mod varied;

use crate::arm::Arm;
use crate::base::Sets;
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::prime::{Draws, Fp};
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::graph::differentiate::Direction;
use crate::parameters::ParameterSet;
pub(crate) use point::Point;
use series::PoseSeries;
use std::fmt;

/// Random points for each function.
pub const POINTS: usize = 2;

/// A function that does not agree with the Lagrangian.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disagreement {
    /// Which function.
    pub function: Function,
    /// Row and column of the first result that differs, from 0.
    pub entry: (usize, usize),
}

impl fmt::Display for Disagreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (row, column) = self.entry;
        write!(
            f,
            "{} does not agree with the Lagrangian of the arm (row {}, column {}): nothing is written",
            self.function,
            row + 1,
            column + 1
        )
    }
}

impl std::error::Error for Disagreement {}

/// Proves a function of an arm for a parameter set against the Lagrangian with all the arm's parameters.
///
/// # Errors
/// The first result that differs.
pub fn prove(
    arm: &Arm,
    symbols: &AngleSymbols,
    sets: &Sets,
    set: &ParameterSet,
    function: &FunctionGraph,
    baked: Option<&[Rational]>,
) -> Result<(), Disagreement> {
    // The seed is fixed: a proof that passed passes again, on every machine.
    let mut draws = Draws::new(0x0070_726f_6f66);
    for _ in 0..POINTS {
        let mut point = Point::draw(arm, symbols, sets, &mut draws);
        if let Some(values) = baked {
            point.carry(set, values);
        }
        let mut expected = expected(&point, set, function.function);
        let mut actual = point.evaluate(set, function);
        if function.function == Function::PotentialEnergy {
            // A potential energy is known up to a constant, which regrouped parameters leave out.
            let zero = point.at_zero();
            expected[0] = expected[0] - self::expected(&zero, set, function.function)[0];
            actual = actual.zip(zero.evaluate(set, function)).map(|(a, b)| vec![a[0] - b[0]]);
        }
        let same = |(i, value): (usize, &Fp)| actual.as_ref().is_some_and(|a| a[i] == *value);
        if let Some(wrong) = expected.iter().enumerate().position(|pair| !same(pair)) {
            let columns = function.shape.1;
            return Err(Disagreement {
                function: function.function,
                entry: (wrong / columns, wrong % columns),
            });
        }
    }
    Ok(())
}

/// Whether the Jacobian of the tool's frame has rank six anywhere: then it has it almost everywhere.
pub fn has_full_rank(arm: &Arm, symbols: &AngleSymbols, sets: &Sets) -> bool {
    let point = Point::draw(arm, symbols, sets, &mut Draws::new(0x0000_7261_6e6b));
    let jacobian = jacobian(&point);
    let square = times(&jacobian, &transposed(&jacobian, arm.dof()), arm.dof());
    // A sum of squares modulo a prime can be zero by chance, in one of 2⁶¹ draws.
    arm.dof() >= 6 && inverse(square, 6).iter().any(|x| *x != Fp::ZERO)
}

/// The function's result by the Lagrangian, row-major.
pub(crate) fn expected(point: &Point<'_>, set: &ParameterSet, function: Function) -> Vec<Fp> {
    let n = point.dof();
    let zeros = vec![Fp::ZERO; n];
    let motion = |gravity| point.state(&point.velocities, &point.accelerations, gravity);
    let of_set = |columns: &[Vec<Fp>]| point.of_set(set, columns);
    let loaded = |function| expected(&point.with_payload(), set, function);
    match function {
        Function::InverseDynamics => motion(true).torques(),
        Function::InverseDynamicsWithoutGravity => motion(false).torques(),
        Function::Regressor => of_set(&motion(true).columns()),
        Function::RegressorTransposeTimes => transpose_times(&of_set(&motion(true).columns()), &point.errors),
        Function::SlotineLiRegressor => of_set(&slotine_li_columns(point)),
        Function::SlotineLiTransposeTimes => {
            transpose_times(&of_set(&slotine_li_columns(point)), &point.errors)
        }
        Function::MassMatrix => mass_matrix(point),
        Function::MassMatrixInverse => inverse(mass_matrix(point), n),
        Function::CoriolisMatrix => coriolis_matrix(point),
        Function::CoriolisTimesVelocity => point.state(&point.velocities, &zeros, false).torques(),
        Function::CoriolisTransposeTimesVelocity => {
            transpose_times(&coriolis_matrix(point), &point.velocities)
        }
        Function::Gravity => point.state(&zeros, &zeros, true).torques(),
        Function::ForwardDynamics => point.accelerations.clone(),
        Function::ForwardKinematics => PoseSeries::along(point, &zeros).pose(),
        Function::Jacobian => jacobian(point),
        Function::JacobianRateTimesVelocity => PoseSeries::along(point, &point.velocities).acceleration(),
        Function::KineticEnergy => point.weigh(&singles(motion(false).values())),
        Function::PotentialEnergy => point.weigh(&singles(potential(point))),
        Function::KineticEnergyRegressor => of_set(&singles(motion(false).values())),
        Function::PotentialEnergyRegressor => of_set(&singles(potential(point))),
        Function::Momentum => motion(false).momentum(),
        Function::TorqueByPosition => torque_derivatives(point, Direction::Position),
        Function::TorqueByVelocity => torque_derivatives(point, Direction::Velocity),
        Function::AccelerationByPosition => acceleration_derivatives(point, Direction::Position),
        Function::AccelerationByVelocity => acceleration_derivatives(point, Direction::Velocity),
        Function::MassMatrixRate => mass_matrix_rate(point),
        Function::MassMatrixTimesByPosition => {
            let torques = point.state(&zeros, &point.errors, false);
            transpose(&(0..n).map(|j| torques.torque_derivative(Direction::Position(j))).collect::<Vec<_>>())
        }
        Function::JacobianRate => {
            let column = |j: usize| PoseSeries::mixed(point, &point.velocities, &unit(n, j)).acceleration();
            transpose(&(0..n).map(column).collect::<Vec<_>>())
        }
        Function::JacobianTransposeTimes => transpose_times(&jacobian(point), &point.wrench),
        Function::JacobianTransposeTimesByPosition => {
            let entry = |k: usize| {
                let second = PoseSeries::mixed(point, &unit(n, k % n), &unit(n, k / n)).acceleration();
                second.iter().zip(&point.wrench).fold(Fp::ZERO, |sum, (x, f)| sum + *x * *f)
            };
            (0..n * n).map(entry).collect()
        }
        Function::TaskInertiaInverse => task_inertia_inverse(point),
        Function::TaskInertia => inverse(task_inertia_inverse(point), 6),
        Function::BodyJacobian => {
            series::in_tool_axes(&PoseSeries::along(point, &zeros).pose(), &jacobian(point), n)
        }
        Function::SpatialJacobian => {
            series::about_base(&PoseSeries::along(point, &zeros).pose(), &jacobian(point), n)
        }
        Function::Twist => PoseSeries::along(point, &point.velocities).velocity(),
        Function::TwistRate => {
            let driven = PoseSeries::along(point, &point.accelerations).velocity();
            let carried = PoseSeries::along(point, &point.velocities).acceleration();
            driven.into_iter().zip(carried).map(|(x, y)| x + y).collect()
        }
        Function::InverseDynamicsWithPayload => loaded(Function::InverseDynamics),
        Function::MassMatrixWithPayload => loaded(Function::MassMatrix),
        Function::CoriolisMatrixWithPayload => loaded(Function::CoriolisMatrix),
        Function::GravityWithPayload => loaded(Function::Gravity),
        Function::ForwardDynamicsWithPayload => loaded(Function::ForwardDynamics),
        Function::PayloadRegressor => {
            let point = point.with_payload();
            let columns = point.state(&point.velocities, &point.accelerations, true).columns();
            transpose(&columns[point.arm.all_parameters().len()..])
        }
        Function::TorqueHessianTimes => {
            let along = (&point.position_direction[..], &point.velocity_direction[..]);
            let motion = motion(true);
            let entry = |direction: Direction| {
                let second = motion.torque_second_derivative(along, direction);
                second.iter().zip(&point.errors).fold(Fp::ZERO, |sum, (x, e)| sum + *x * *e)
            };
            (0..n).flat_map(|j| [entry(Direction::Position(j)), entry(Direction::Velocity(j))]).collect()
        }
        Function::CentreOfMass => total::centre_of_mass(point),
        Function::CentreOfMassJacobian => {
            let mass = total::mass(point).inverse().unwrap_or(Fp::ZERO);
            total_momentum_matrix(point)[..3 * n].iter().map(|x| *x * mass).collect()
        }
        Function::TotalMomentum => total::momentum(point, &point.velocities),
        Function::TotalMomentumMatrix => total_momentum_matrix(point),
        Function::ConsistentInverse => {
            let accelerations = times(&inverse(mass_matrix(point), n), &transposed(&jacobian(point), n), n);
            times(&accelerations, &inverse(task_inertia_inverse(point), 6), 6)
        }
    }
}

/// −B⁻¹ times the derivatives of the torques.
fn acceleration_derivatives(point: &Point<'_>, direction: fn(usize) -> Direction) -> Vec<Fp> {
    let n = point.dof();
    let product = times(&inverse(mass_matrix(point), n), &torque_derivatives(point, direction), n);
    product.into_iter().map(|x| -x).collect()
}

/// Σ q̇ₖ·∂B/∂qₖ, column by column.
fn mass_matrix_rate(point: &Point<'_>) -> Vec<Fp> {
    let n = point.dof();
    let zeros = vec![Fp::ZERO; n];
    let column = |j: usize| {
        let unit = unit(n, j);
        let torques = point.state(&zeros, &unit, false);
        (0..n).fold(vec![Fp::ZERO; n], |sum, k| {
            let by_position = torques.torque_derivative(Direction::Position(k));
            sum.iter().zip(by_position).map(|(s, x)| *s + point.velocities[k] * x).collect()
        })
    };
    transpose(&(0..n).map(column).collect::<Vec<_>>())
}

/// The momentum of the whole arm for a unit of each joint's velocity, 6 × n.
fn total_momentum_matrix(point: &Point<'_>) -> Vec<Fp> {
    let n = point.dof();
    transpose(&(0..n).map(|j| total::momentum(point, &unit(n, j))).collect::<Vec<_>>())
}

fn half() -> Fp {
    Fp::from_integer(2).inverse().unwrap_or(Fp::ONE)
}

/// J, 6 × n.
fn jacobian(point: &Point<'_>) -> Vec<Fp> {
    let n = point.dof();
    let column = |j: usize| PoseSeries::along(point, &unit(n, j)).velocity();
    transpose(&(0..n).map(column).collect::<Vec<_>>())
}

/// J·B⁻¹·Jᵀ
fn task_inertia_inverse(point: &Point<'_>) -> Vec<Fp> {
    let (n, jacobian) = (point.dof(), jacobian(point));
    times(&times(&jacobian, &inverse(mass_matrix(point), n), n), &transposed(&jacobian, n), n)
}

/// The product of two row-major matrices; `inner` is the first one's number of columns.
fn times(a: &[Fp], b: &[Fp], inner: usize) -> Vec<Fp> {
    let columns = b.len() / inner;
    let entry = |k: usize| {
        let (i, j) = (k / columns, k % columns);
        (0..inner).fold(Fp::ZERO, |sum, l| sum + a[i * inner + l] * b[l * columns + j])
    };
    (0..a.len() / inner * columns).map(entry).collect()
}

/// The transpose of a row-major matrix with `columns` columns.
fn transposed(matrix: &[Fp], columns: usize) -> Vec<Fp> {
    (0..columns).flat_map(|j| matrix.iter().skip(j).step_by(columns).copied()).collect()
}

/// −L of an arm that stands still.
fn potential(point: &Point<'_>) -> Vec<Fp> {
    let zeros = vec![Fp::ZERO; point.dof()];
    point.state(&zeros, &zeros, true).values().into_iter().map(|x| -x).collect()
}

fn singles(values: Vec<Fp>) -> Vec<Vec<Fp>> {
    values.into_iter().map(|x| vec![x]).collect()
}

fn torque_derivatives(point: &Point<'_>, direction: fn(usize) -> Direction) -> Vec<Fp> {
    let motion = point.state(&point.velocities, &point.accelerations, true);
    let columns: Vec<Vec<Fp>> = (0..point.dof()).map(|j| motion.torque_derivative(direction(j))).collect();
    transpose(&columns)
}

fn mass_matrix(point: &Point<'_>) -> Vec<Fp> {
    let n = point.dof();
    let zeros = vec![Fp::ZERO; n];
    let columns: Vec<Vec<Fp>> = (0..n).map(|j| point.state(&zeros, &unit(n, j), false).torques()).collect();
    transpose(&columns)
}

/// The velocity terms h(v) = Σ c_ijk vⱼ vₖ with Christoffel symbols, which are symmetric in j and k,
/// polarised: ½(h(u + v) − h(u) − h(v)) = Σ c_ijk uⱼ vₖ; for each parameter.
fn polarised(point: &Point<'_>, u: &[Fp], v: &[Fp]) -> Vec<Vec<Fp>> {
    let half = half();
    let zeros = vec![Fp::ZERO; point.dof()];
    let h = |v: &[Fp]| point.state(v, &zeros, false).columns();
    let sum: Vec<Fp> = u.iter().zip(v).map(|(a, b)| *a + *b).collect();
    let (both, one, other) = (h(&sum), h(u), h(v));
    (0..both.len())
        .map(|c| (0..point.dof()).map(|i| half * (both[c][i] - one[c][i] - other[c][i])).collect())
        .collect()
}

fn coriolis_matrix(point: &Point<'_>) -> Vec<Fp> {
    let n = point.dof();
    let column = |j: usize| point.weigh(&polarised(point, &point.velocities, &unit(n, j)));
    transpose(&(0..n).map(column).collect::<Vec<_>>())
}

/// B·q̈ᵣ + C·q̇ᵣ + g for each parameter.
fn slotine_li_columns(point: &Point<'_>) -> Vec<Vec<Fp>> {
    let zeros = vec![Fp::ZERO; point.dof()];
    let still = point.state(&zeros, &point.reference_accelerations, true).columns();
    let moving = polarised(point, &point.velocities, &point.reference_velocities);
    let sum = |(a, b): (Vec<Fp>, Vec<Fp>)| a.into_iter().zip(b).map(|(x, y)| x + y).collect();
    still.into_iter().zip(moving).map(sum).collect()
}

fn unit(n: usize, j: usize) -> Vec<Fp> {
    (0..n).map(|i| if i == j { Fp::ONE } else { Fp::ZERO }).collect()
}

fn transpose(columns: &[Vec<Fp>]) -> Vec<Fp> {
    let rows = columns.first().map_or(0, Vec::len);
    (0..rows).flat_map(|i| columns.iter().map(move |c| c[i])).collect()
}

/// Mᵀ·v of a row-major matrix.
fn transpose_times(matrix: &[Fp], v: &[Fp]) -> Vec<Fp> {
    let columns = matrix.len() / v.len().max(1);
    (0..columns)
        .map(|c| v.iter().enumerate().fold(Fp::ZERO, |sum, (i, x)| sum + matrix[i * columns + c] * *x))
        .collect()
}

/// The inverse of a row-major matrix by Gauss and Jordan; zeros where it is singular, which no result equals.
fn inverse(mut a: Vec<Fp>, n: usize) -> Vec<Fp> {
    let mut inverse: Vec<Fp> = (0..n).flat_map(|i| unit(n, i)).collect();
    for k in 0..n {
        let Some(pivot) = (k..n).find(|r| a[r * n + k] != Fp::ZERO) else { return vec![Fp::ZERO; n * n] };
        for c in 0..n {
            a.swap(k * n + c, pivot * n + c);
            inverse.swap(k * n + c, pivot * n + c);
        }
        let scale = a[k * n + k].inverse().unwrap_or(Fp::ONE);
        for c in 0..n {
            a[k * n + c] = a[k * n + c] * scale;
            inverse[k * n + c] = inverse[k * n + c] * scale;
        }
        for r in (0..n).filter(|r| *r != k) {
            let factor = a[r * n + k];
            for c in 0..n {
                a[r * n + c] = a[r * n + c] - factor * a[k * n + c];
                inverse[r * n + c] = inverse[r * n + c] - factor * inverse[k * n + c];
            }
        }
    }
    inverse
}
