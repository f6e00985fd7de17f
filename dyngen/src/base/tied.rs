//! The rows of an arm some of whose joints follow others: the Lagrangian at poses and motions with exact
//! numbers.
//!
//! Functionals of one joint each, of which [`super::coefficients`] makes its rows, are not enough where
//! joints move together. Any functions span the space of their values at enough points, so rows are taken at
//! poses whose sines and cosines are fractions, until there are as many independent ones as at random points
//! modulo the prime. The rows are certified like all others.

use super::certificate;
use super::steps::Sizes;
use crate::arm::{Arm, Drive};
use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{Echelon, SparseRow, Unproven};
use crate::exact::prime::{Draws, Fp, PrimeField};
use crate::exact::rational::{self, Rational};
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{ArmElements, Source};
use crate::lagrangian::followers::{input_angles, with_theta};
use crate::lagrangian::twice_lagrangian;
use dashu_int::IBig;

/// Angles that are larger multiples of parts of each other are as good as free.
const LARGEST: u32 = 12;
/// Points that are tried for each row at most.
const TRIES: usize = 400;
/// Points at quarter turns alone, before others are drawn too.
const SIMPLE: usize = 60;

/// Rows that span the row space of all the arm's parameters, whether declared zero or not.
///
/// # Errors
/// [`Unproven`] where the prime divides a number of the arm, or points do not span the rows.
pub(super) fn all_rows(
    arm: &Arm,
    symbols: &AngleSymbols,
    field: &ConstantField,
    sizes: Sizes,
) -> Result<Vec<SparseRow>, Unproven> {
    let wanted = certificate::rank_of_all(arm, symbols, field, sizes);
    let mut draws = Draws::new(0x7469_6564);
    let mut echelon = Echelon::default();
    let mut rows: Vec<SparseRow> = Vec::new();
    // A number with the prime in its denominator fails the certificate.
    let residue = |x: &Rational| Fp::from_rational(x).unwrap_or(Fp::ZERO);
    for attempt in 0..TRIES * wanted {
        if rows.len() == wanted {
            break;
        }
        let point = Point::draw(arm, sizes, attempt, &mut draws);
        let modular = Algebraic {
            alg: &PrimeField,
            arm,
            symbols,
            number: &residue,
            symbol: &|index, sine| field.modular_symbol(index, sine),
        };
        if echelon.takes(modular.columns(&point)) {
            let exact = Algebraic {
                alg: field,
                arm,
                symbols,
                number: &|x: &Rational| field.rational(x.clone()),
                symbol: &|index, sine| field.whole(field.symbol(index, sine).clone()),
            };
            let row: Vec<Constant> = exact.columns(&point);
            let entries: Vec<(usize, &Constant)> =
                row.iter().enumerate().filter(|(_, c)| !c.is_zero()).collect();
            rows.push(field.clear_denominators(&entries));
        }
    }
    if rows.len() == wanted { Ok(rows) } else { Err(Unproven) }
}

/// A pose and a motion, and sizes where they are variables, in numbers that are easy to compute with.
#[derive(Clone)]
struct Point {
    /// Sines and cosines, as many as there may be free angles.
    circle: Vec<(Rational, Rational)>,
    /// Positions of the coordinates.
    positions: Vec<Rational>,
    velocities: Vec<Rational>,
    /// Sizes of each joint, if they are variables.
    sizes: Option<Vec<JointSizes>>,
}

#[derive(Clone)]
struct JointSizes {
    a: Rational,
    b: Rational,
    d: Rational,
    rotor_ratio: Rational,
}

impl Point {
    /// The first points are the simplest.
    fn draw(arm: &Arm, sizes: Sizes, attempt: usize, draws: &mut Draws) -> Self {
        let mut pick = |count: usize| (draws.element().residue() % count as u64) as usize;
        // One motion in three stands still, for gravity's rows.
        let moving = pick(3) > 0;
        let mut small = |choices: &[i64]| rational::integer(choices[pick(choices.len())]);
        let velocities =
            (0..arm.dof()).map(|_| if moving { small(&[0, 1, -1]) } else { small(&[0]) }).collect();
        let positions = (0..arm.dof()).map(|_| small(&[0, 1, -1, 2, 3])).collect();
        let variables = sizes == Sizes::Variables;
        let mut size = || small(&[1, 2, 3, 4, 5, 6, 7, 8, 9]);
        let mut of_joint = || JointSizes { a: size(), b: size(), d: size(), rotor_ratio: size() };
        let sizes = variables.then(|| arm.joints.iter().map(|_| of_joint()).collect());
        // The angle whose half has the tangent p/q: of quarter turns at first.
        let most = if attempt < SIMPLE { 1 } else { 9 };
        let circle = (0..arm.links()).map(|_| {
            let (p, q) = (pick(2 * most + 1) as i64 - most as i64, pick(most + 1) as i64);
            let (p, q) = if (p, q) == (0, 0) { (0, 1) } else { (p, q) };
            let number = |x: i64| rational::ratio(IBig::from(x), IBig::from(p * p + q * q));
            (number(2 * p * q), number(q * q - p * p))
        });
        Point { circle: circle.collect(), positions, velocities, sizes }
    }

    /// Every coordinate at zero, and still.
    fn at_rest(&self) -> Self {
        let zeros = |list: &[Rational]| list.iter().map(|_| rational::integer(0)).collect::<Vec<_>>();
        let straight = || (rational::integer(0), rational::integer(1));
        Point {
            circle: self.circle.iter().map(|_| straight()).collect(),
            positions: zeros(&self.positions),
            velocities: zeros(&self.velocities),
            sizes: self.sizes.clone(),
        }
    }
}

/// An arm in an algebra, with what rational numbers and symbols are there.
struct Algebraic<'a, A: Algebra> {
    alg: &'a A,
    arm: &'a Arm,
    symbols: &'a AngleSymbols,
    number: &'a dyn Fn(&Rational) -> A::Value,
    symbol: &'a dyn Fn(usize, bool) -> A::Value,
}

impl<A: Algebra> Algebraic<'_, A> {
    /// The columns of all parameters, less what they are at rest: a constant changes no torque.
    fn columns(&self, point: &Point) -> Vec<A::Value> {
        let at = |point: &Point| {
            let mut next = point.circle.iter().map(|(s, c)| ((self.number)(s), (self.number)(c)));
            let mut circle = || next.next().unwrap_or_else(|| (self.alg.integer(0), self.alg.integer(1)));
            let angles = input_angles(self.alg, self.arm, self.number, &mut circle, Some(LARGEST));
            let mut source = Quantities { algebraic: self, point, drives: self.arm.drives(), angles };
            let elements = ArmElements::build(self.alg, self.arm, self.symbols, &mut source);
            twice_lagrangian(self.alg, &elements)
        };
        let (moving, still) = (at(point), at(&point.at_rest()));
        moving.iter().zip(&still).map(|(a, b)| self.alg.sub(a, b)).collect()
    }
}

/// The quantities of an arm at a point that the Lagrangian needs.
struct Quantities<'a, 'b, A: Algebra> {
    algebraic: &'a Algebraic<'b, A>,
    point: &'a Point,
    drives: Vec<Drive>,
    angles: Vec<(A::Value, A::Value)>,
}

impl<A: Algebra> Quantities<'_, '_, A> {
    /// A size of a joint: the point's where it is a variable, else the arm's.
    fn size(&self, joint: usize, variable: fn(&JointSizes) -> &Rational, value: &Rational) -> A::Value {
        (self.algebraic.number)(self.point.sizes.as_ref().map_or(value, |sizes| variable(&sizes[joint])))
    }
}

impl<A: Algebra> Source<A::Value> for Quantities<'_, '_, A> {
    fn joint_trig(&mut self, joint: usize) -> (A::Value, A::Value) {
        with_theta(self.algebraic.alg, &self.algebraic.arm.joints[joint].theta, self.angles[joint].clone())
    }
    fn position(&mut self, joint: usize) -> A::Value {
        let drive = &self.drives[joint];
        (self.algebraic.number)(&(&drive.ratio * &self.point.positions[drive.coordinate] + &drive.offset))
    }
    fn velocity(&mut self, joint: usize) -> A::Value {
        let drive = &self.drives[joint];
        (self.algebraic.number)(&(&drive.ratio * &self.point.velocities[drive.coordinate]))
    }
    fn a(&mut self, joint: usize) -> A::Value {
        self.size(joint, |sizes| &sizes.a, &self.algebraic.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> A::Value {
        self.size(joint, |sizes| &sizes.b, &self.algebraic.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> A::Value {
        self.size(joint, |sizes| &sizes.d, &self.algebraic.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> A::Value {
        let ratio = self.algebraic.arm.joints[joint].rotor_ratio.clone().unwrap_or_default();
        self.size(joint, |sizes| &sizes.rotor_ratio, &ratio)
    }
    fn exact(&mut self, value: &Rational) -> A::Value {
        (self.algebraic.number)(value)
    }
    fn gravity(&mut self, axis: usize) -> A::Value {
        (self.algebraic.number)(&self.algebraic.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> A::Value {
        (self.algebraic.symbol)(index, sine)
    }
}
