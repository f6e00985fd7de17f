//! Mass, centre of mass and momentum of the whole arm, from its Lagrangian: momentum is the derivative of the
//! kinetic energy by a velocity of the root link, first moments that of the potential energy by gravity.

use super::half;
use super::point::{Motion as Follows, Point};
use super::varied::Varied;
use crate::exact::algebra::Algebra;
use crate::exact::dual::Duals;
use crate::exact::prime::{Fp, PrimeField};
use crate::lagrangian::elements::{ArmElements, JointElements};
use crate::lagrangian::{Motion, twice_lagrangian_on};

type Dual = (Fp, Fp);

const DUALS: Duals<PrimeField> = Duals(PrimeField);

/// The infinitesimal change of L where the root link's velocity, angular velocity or gravity changes, with
/// the values of the point's parameters.
fn change(point: &Point<'_>, velocities: &[Fp], root: Motion<Dual>) -> Fp {
    let mut varied = Varied { algebra: DUALS, point, change: vec![DUALS.integer(0); point.dof()] };
    let base = varied.placement(&point.arm.base);
    let mut elements = ArmElements::build(&DUALS, point.arm, point.symbols, &mut varied);
    move_joints(point, velocities, &mut elements.joints);
    let columns = twice_lagrangian_on(&DUALS, &elements, root.placed(&DUALS, &base));
    let changes: Vec<Vec<Fp>> = columns.iter().map(|(_, change)| vec![half() * *change]).collect();
    point.weigh(&changes)[0]
}

/// Gives the joints and their motors velocities.
fn move_joints(point: &Point<'_>, velocities: &[Fp], joints: &mut [JointElements<Dual>]) {
    for (joint, follows) in joints.iter_mut().zip(&point.drives) {
        let Follows { coordinate, ratio, .. } = follows;
        joint.velocity = (*ratio * velocities[*coordinate], Fp::ZERO);
        joint.motor_velocity = joint.velocity;
    }
    let of_joints: Vec<Dual> = joints.iter().map(|joint| joint.velocity).collect();
    for (motor, joint) in joints.iter_mut().enumerate() {
        let Some(row) = point.arm.coupled_motor(motor) else { continue };
        joint.motor_velocity = row.iter().fold(DUALS.integer(0), |sum, (i, factor)| {
            let factor = (Fp::from_rational(factor).unwrap_or(Fp::ZERO), Fp::ZERO);
            DUALS.add(&sum, &DUALS.mul(&factor, &of_joints[*i]))
        });
    }
}

/// The root link at rest without gravity.
fn still() -> Motion<Dual> {
    let zero = || std::array::from_fn(|_| DUALS.integer(0));
    Motion { omega: zero(), velocity: zero(), gravity: zero(), height: DUALS.integer(0) }
}

const EPSILON: Dual = (Fp::ZERO, Fp::ONE);

/// Linear momentum above angular momentum about the root link's origin.
pub(super) fn momentum(point: &Point<'_>, velocities: &[Fp]) -> Vec<Fp> {
    let along = |i: usize| {
        let mut root = still();
        match i {
            0..3 => root.velocity[i] = EPSILON,
            _ => root.omega[i - 3] = EPSILON,
        }
        change(point, velocities, root)
    };
    (0..6).map(along).collect()
}

/// The sum of the masses.
pub(super) fn mass(point: &Point<'_>) -> Fp {
    // L changes by the mass where the height of everything does.
    change(point, &vec![Fp::ZERO; point.dof()], Motion { height: EPSILON, ..still() })
}

/// First moments by the mass.
pub(super) fn centre_of_mass(point: &Point<'_>) -> Vec<Fp> {
    let inverse = mass(point).inverse().unwrap_or(Fp::ZERO);
    let along = |axis: usize| {
        let mut root = still();
        root.gravity[axis] = EPSILON;
        inverse * change(point, &vec![Fp::ZERO; point.dof()], root)
    };
    (0..3).map(along).collect()
}
