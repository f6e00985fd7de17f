//! The columns of the energies: Eq. 5 and 6 themselves.

use super::body::constant;
use crate::arm::Arm;
use crate::exact::algebra::Algebra;
use crate::exact::constant::ConstantField;
use crate::exact::rational;
use crate::graph::{Builder, Expr};
use crate::lagrangian::elements::ArmElements;
use crate::lagrangian::twice_lagrangian;
use crate::parameters::ParameterSet;

/// One row, 1 × p: T = row·π.
pub fn kinetic_regressor(
    b: &Builder,
    arm: &Arm,
    elements: &ArmElements<Expr>,
    set: &ParameterSet,
    field: &ConstantField,
) -> Vec<Expr> {
    let mut weightless = elements.clone();
    weightless.gravity = [Expr::ZERO; 3];
    of_set(b, arm, &weightless, set, field, false)
}

/// One row, 1 × p: U = row·π, zero where every mass is at the base's origin.
pub fn potential_regressor(
    b: &Builder,
    arm: &Arm,
    elements: &ArmElements<Expr>,
    set: &ParameterSet,
    field: &ConstantField,
) -> Vec<Expr> {
    let mut still = elements.clone();
    for joint in &mut still.joints {
        (joint.velocity, joint.motor_velocity) = (Expr::ZERO, Expr::ZERO);
    }
    of_set(b, arm, &still, set, field, true)
}

fn of_set(
    b: &Builder,
    arm: &Arm,
    elements: &ArmElements<Expr>,
    set: &ParameterSet,
    field: &ConstantField,
    negate: bool,
) -> Vec<Expr> {
    debug_assert_eq!(arm.links(), elements.joints.len());
    let half = b.constant(&rational::ratio(1, 2));
    let half = if negate { -half } else { half };
    let columns = twice_lagrangian(b, elements);
    let column = |carriers: &crate::parameters::Combination| {
        carriers.iter().fold(Expr::ZERO, |sum, (p, factor)| {
            b.add(&sum, &b.mul(&constant(b, field, factor), &columns[p.index()]))
        })
    };
    set.parameters.iter().map(|p| b.mul(&half, &column(&p.carriers))).collect()
}
