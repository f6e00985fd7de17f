//! Both halves of a dependence of columns, certified at random points of the prime field by the Lagrangian
//! itself.
//!
//! The kept columns are certainly independent if a minor of their values does not vanish modulo the prime. A
//! relation is as certain as the proof of a function: a wrong one is a polynomial that is not zero and
//! vanishes at a random point with probability below 2⁻⁵⁴; as many points are taken as there are columns.

use super::steps::Sizes;
use crate::arm::{Arm, Drive, Linkage};
use crate::exact::constant::ConstantField;
use crate::exact::elimination::{Dependence, Unproven, rank};
use crate::exact::prime::{Draws, Fp, PrimeField};
use crate::exact::rational::Rational;
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{ArmElements, Source};
use crate::lagrangian::followers::{closing_angles, still_angles, with_theta};
use crate::lagrangian::linkage::{BarTurns, turns};
use crate::lagrangian::twice_lagrangian;

/// Points beyond one for each kept column.
const MORE: usize = 4;

/// Certifies a dependence of the columns of the parameters that the arm keeps.
///
/// # Errors [`Unproven`] where a kept column depends on others, a relation does not hold, or the prime
/// divides a number.
pub(super) fn certify(
    arm: &Arm,
    symbols: &AngleSymbols,
    field: &ConstantField,
    sizes: Sizes,
    dependence: &Dependence,
) -> Result<(), Unproven> {
    let mut draws = Draws::new(0x6365_7274);
    let mut relations: Vec<(usize, Vec<(usize, Fp)>)> = Vec::new();
    for parameter in arm.kept_parameters() {
        let column = parameter.index();
        if !dependence.kept.contains(&column) {
            let factor = |(position, c): &(usize, _)| Some((dependence.kept[*position], field.modular(c)?));
            let terms: Option<Vec<(usize, Fp)>> = dependence.coordinates[column].iter().map(factor).collect();
            relations.push((column, terms.ok_or(Unproven)?));
        }
    }
    let mut kept = Vec::new();
    for _ in 0..dependence.kept.len() + MORE {
        let values = Point::draw(arm, field, sizes, &mut draws).columns(symbols);
        for (column, terms) in &relations {
            let sum = terms.iter().fold(Fp::ZERO, |sum, (k, factor)| sum + *factor * values[*k]);
            if sum != values[*column] {
                return Err(Unproven);
            }
        }
        kept.push(dependence.kept.iter().map(|k| values[*k]).collect());
    }
    if rank(kept) == dependence.kept.len() { Ok(()) } else { Err(Unproven) }
}

/// The rank of the columns of all the arm's parameters, at random points.
pub(super) fn rank_of_all(arm: &Arm, symbols: &AngleSymbols, field: &ConstantField, sizes: Sizes) -> usize {
    let mut draws = Draws::new(0x7261_6e6b);
    let mut point = || Point::draw(arm, field, sizes, &mut draws).columns(symbols);
    rank((0..arm.all_parameters().len() + MORE).map(|_| point()).collect())
}

/// A random pose and motion, with random sizes where they are variables.
struct Point<'a> {
    arm: &'a Arm,
    field: &'a ConstantField,
    drives: Vec<Drive>,
    /// Sine and cosine of each joint's angle.
    angles: Vec<(Fp, Fp)>,
    /// Positions of the coordinates.
    positions: Vec<Fp>,
    velocities: Vec<Fp>,
    /// a, d, rotor ratio and b of each joint, where they are variables.
    sizes: Option<Vec<[Fp; 4]>>,
}

impl<'a> Point<'a> {
    fn draw(arm: &'a Arm, field: &'a ConstantField, sizes: Sizes, draws: &mut Draws) -> Self {
        let angles = closing_angles(arm, &number, &mut |_| draws.element().circle_point());
        let mut vector = || (0..arm.dof()).map(|_| draws.element()).collect::<Vec<Fp>>();
        let (positions, velocities) = (vector(), vector());
        let four = |draws: &mut Draws| std::array::from_fn(|_| draws.element());
        let sizes = (sizes == Sizes::Variables).then(|| arm.joints.iter().map(|_| four(draws)).collect());
        Point { arm, field, drives: arm.drives(), angles, positions, velocities, sizes }
    }

    /// The columns of all parameters, less what they are at rest where every coordinate is zero: a constant
    /// changes no torque, and columns count up to one, which depends on the sizes alone.
    fn columns(mut self, symbols: &AngleSymbols) -> Vec<Fp> {
        let columns = |point: &mut Self| {
            let elements = ArmElements::build(&PrimeField, point.arm, symbols, point);
            twice_lagrangian(&PrimeField, &elements)
        };
        let moving = columns(&mut self);
        self.rest();
        let still = columns(&mut self);
        moving.iter().zip(&still).map(|(a, b)| *a - *b).collect()
    }

    /// Every coordinate at zero, or where loops close, and still.
    fn rest(&mut self) {
        self.angles = still_angles(self.arm, &number);
        self.positions.iter_mut().chain(&mut self.velocities).for_each(|x| *x = Fp::ZERO);
    }

    fn size(&self, joint: usize, which: usize, value: Option<&Rational>) -> Fp {
        match (&self.sizes, value) {
            (Some(sizes), _) => sizes[joint][which],
            // A number with the prime in its denominator fails the certificate.
            (None, value) => value.and_then(Fp::from_rational).unwrap_or(Fp::ZERO),
        }
    }
}

/// A number with the prime in its denominator fails the certificate.
fn number(value: &Rational) -> Fp {
    Fp::from_rational(value).unwrap_or(Fp::ZERO)
}

impl Source<Fp> for Point<'_> {
    fn joint_trig(&mut self, joint: usize) -> (Fp, Fp) {
        with_theta(&PrimeField, &self.arm.joints[joint].theta, self.angles[joint])
    }
    fn position(&mut self, joint: usize) -> Fp {
        let drive = &self.drives[joint];
        number(&drive.ratio) * self.positions[drive.coordinate] + number(&drive.offset)
    }
    fn velocity(&mut self, joint: usize) -> Fp {
        let drive = &self.drives[joint];
        number(&drive.ratio) * self.velocities[drive.coordinate]
    }
    fn a(&mut self, joint: usize) -> Fp {
        self.size(joint, 0, Some(&self.arm.joints[joint].a))
    }
    fn b(&mut self, joint: usize) -> Fp {
        self.size(joint, 3, Some(&self.arm.joints[joint].b))
    }
    fn d(&mut self, joint: usize) -> Fp {
        self.size(joint, 1, Some(&self.arm.joints[joint].d))
    }
    fn ratio(&mut self, joint: usize) -> Fp {
        self.size(joint, 2, self.arm.joints[joint].rotor_ratio.as_ref())
    }
    fn exact(&mut self, value: &Rational) -> Fp {
        Fp::from_rational(value).unwrap_or(Fp::ZERO)
    }
    fn linkage(&mut self, linkage: &Linkage) -> Option<BarTurns<Fp>> {
        let turn = self.joint_trig(linkage.joint);
        turns(&PrimeField, linkage, &number, &turn)
    }
    fn gravity(&mut self, axis: usize) -> Fp {
        Fp::from_rational(&self.arm.gravity[axis]).unwrap_or(Fp::ZERO)
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Fp {
        self.field.modular_symbol(index, sine)
    }
}
