//! The rows of an arm with closed loops, or some of whose joints follow others: the Lagrangian at poses and
//! motions with exact numbers.
//!
//! Functionals of one joint each, of which [`super::coefficients`] makes its rows, are not enough where
//! joints move together. Any functions span the space of their values at enough points, so rows are taken at
//! poses whose sines and cosines are fractions, until there are as many independent ones as at random points
//! modulo the prime. The rows are certified like all others.

use super::certificate;
use super::functionals::{Formal, Functionals, Monomial, Polynomial, Variable, variable};
use super::steps::Sizes;
use crate::arm::{Arm, Drive, Linkage};
use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{Echelon, SparseRow, Unproven};
use crate::exact::prime::{Draws, Fp, PrimeField};
use crate::exact::rational::{self, Rational};
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{ArmElements, Source};
use crate::lagrangian::followers::{input_angles, with_theta};
use crate::lagrangian::linkage::{BarTurn, BarTurns};
use crate::lagrangian::twice_lagrangian;
use dashu_int::IBig;
use std::collections::{BTreeMap, BTreeSet};

/// Angles that are larger multiples of parts of each other are as good as free.
pub(super) const LARGEST: u32 = 12;
/// Points that are tried for each row at most.
const TRIES: usize = 400;
/// Points at quarter turns alone, before others are drawn too.
pub(super) const SIMPLE: usize = 60;
/// Points at which monomials of the columns are looked for: at each of them a few may vanish by chance.
const SAMPLES: usize = 8;

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
    let modular = Algebraic {
        alg: &PrimeField,
        arm,
        symbols,
        number: &residue,
        symbol: &|index, sine| field.modular_symbol(index, sine),
    };
    let exact = Algebraic {
        alg: field,
        arm,
        symbols,
        number: &|x: &Rational| field.rational(x.clone()),
        symbol: &|index, sine| field.whole(field.symbol(index, sine).clone()),
    };
    let monomials =
        (0..SAMPLES).flat_map(|k| modular.columns(&Point::draw(arm, sizes, SIMPLE + k, &mut draws)));
    let monomials: BTreeSet<Monomial> = monomials.flat_map(BTreeMap::into_keys).collect();
    let functionals = Functionals::new(arm, field, &monomials, |k| Point::draw(arm, sizes, k, &mut draws))?;
    for attempt in 0..TRIES * wanted {
        if rows.len() == wanted {
            break;
        }
        let point = Point::draw(arm, sizes, attempt, &mut draws);
        let rest = point.at_rest();
        let [moving, still] = [&point, &rest].map(|point| functionals.terms(modular.columns(point)));
        let is_new = |product: &Vec<usize>| echelon.takes(functionals.modular(product, &moving, &still));
        let taken: Vec<Vec<usize>> = functionals.products(&mut draws).into_iter().filter(is_new).collect();
        if taken.is_empty() {
            continue;
        }
        let [moving, still] = [&point, &rest].map(|point| functionals.terms(exact.columns(point)));
        for product in taken {
            let row = functionals.exact(field, &product, &moving, &still);
            let entries: Vec<(usize, &Constant)> =
                row.iter().enumerate().filter(|(_, c)| !c.is_zero()).collect();
            rows.push(field.clear_denominators(&entries));
        }
    }
    if rows.len() == wanted { Ok(rows) } else { Err(Unproven) }
}

/// A pose and a motion, and sizes where they are variables, in numbers that are easy to compute with.
#[derive(Clone)]
pub(super) struct Point {
    /// Sines and cosines, as many as there may be free angles.
    pub(super) circle: Vec<(Rational, Rational)>,
    /// Positions of the coordinates.
    pub(super) positions: Vec<Rational>,
    pub(super) velocities: Vec<Rational>,
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
        let straight = || (rational::integer(0), rational::integer(1));
        let zeros = |list: &[Rational]| list.iter().map(|_| rational::integer(0)).collect::<Vec<_>>();
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
    /// The columns of all parameters, as polynomials in what moves with linkages.
    fn columns(&self, point: &Point) -> Vec<Polynomial<A::Value>> {
        let formal = Formal(self.alg);
        let number = |x: &Rational| formal.constant((self.number)(x));
        let mut next = point.circle.iter().map(|(s, c)| (number(s), number(c)));
        let mut circle = || next.next().unwrap_or_else(|| (formal.integer(0), formal.integer(1)));
        let angles = input_angles(&formal, self.arm, &number, &mut circle, Some(LARGEST));
        let drives = self.arm.drives();
        let mut source = Quantities { algebraic: self, formal: &formal, point, drives, angles };
        let elements = ArmElements::build(&formal, self.arm, self.symbols, &mut source);
        twice_lagrangian(&formal, &elements)
    }
}

/// Sine and cosine of an angle.
type SineCosine<V> = (Polynomial<V>, Polynomial<V>);

/// The quantities of an arm at a point that the Lagrangian needs.
struct Quantities<'a, 'b, A: Algebra> {
    algebraic: &'a Algebraic<'b, A>,
    formal: &'a Formal<'b, A>,
    point: &'a Point,
    drives: Vec<Drive>,
    angles: Vec<SineCosine<A::Value>>,
}

impl<A: Algebra> Quantities<'_, '_, A> {
    fn number(&self, value: &Rational) -> Polynomial<A::Value> {
        self.formal.constant((self.algebraic.number)(value))
    }

    /// The variables of a joint that moves with a linkage.
    fn moving<const N: usize>(
        &self,
        joint: usize,
        which: [Variable; N],
    ) -> Option<[Polynomial<A::Value>; N]> {
        let moves = Functionals::has(self.algebraic.arm, &self.drives, joint);
        moves.then(|| which.map(|which| self.formal.variable(variable(joint, which))))
    }

    /// A size of a joint: the point's where it is a variable, else the arm's.
    fn size(
        &self,
        joint: usize,
        variable: fn(&JointSizes) -> &Rational,
        value: &Rational,
    ) -> Polynomial<A::Value> {
        self.number(self.point.sizes.as_ref().map_or(value, |sizes| variable(&sizes[joint])))
    }
}

impl<A: Algebra> Source<Polynomial<A::Value>> for Quantities<'_, '_, A> {
    fn joint_trig(&mut self, joint: usize) -> (Polynomial<A::Value>, Polynomial<A::Value>) {
        if let Some(found) = self.moving(joint, [Variable::Sine, Variable::Cosine]) {
            let [sine, cosine] = found;
            return (sine, cosine);
        }
        with_theta(self.formal, &self.algebraic.arm.joints[joint].theta, self.angles[joint].clone())
    }
    fn position(&mut self, joint: usize) -> Polynomial<A::Value> {
        if let Some([position]) = self.moving(joint, [Variable::Position]) {
            return position;
        }
        let drive = &self.drives[joint];
        self.number(&(&drive.ratio * &self.point.positions[drive.coordinate] + &drive.offset))
    }
    fn velocity(&mut self, joint: usize) -> Polynomial<A::Value> {
        if let Some([velocity]) = self.moving(joint, [Variable::Velocity]) {
            return velocity;
        }
        let drive = &self.drives[joint];
        self.number(&(&drive.ratio * &self.point.velocities[drive.coordinate]))
    }
    fn a(&mut self, joint: usize) -> Polynomial<A::Value> {
        self.size(joint, |sizes| &sizes.a, &self.algebraic.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Polynomial<A::Value> {
        self.size(joint, |sizes| &sizes.b, &self.algebraic.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Polynomial<A::Value> {
        self.size(joint, |sizes| &sizes.d, &self.algebraic.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Polynomial<A::Value> {
        let ratio = self.algebraic.arm.joints[joint].rotor_ratio.clone().unwrap_or_default();
        self.size(joint, |sizes| &sizes.rotor_ratio, &ratio)
    }
    fn exact(&mut self, value: &Rational) -> Polynomial<A::Value> {
        self.number(value)
    }
    fn linkage(&mut self, linkage: &Linkage) -> Option<BarTurns<Polynomial<A::Value>>> {
        let bar = |first: usize| {
            let of = |k: usize| self.formal.variable(variable(linkage.joint, Variable::Bar(first + k)));
            BarTurn { sin: of(0), cos: of(1), rate: of(2), bend: self.formal.integer(0) }
        };
        Some([bar(0), bar(3)])
    }
    fn gravity(&mut self, axis: usize) -> Polynomial<A::Value> {
        self.number(&self.algebraic.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Polynomial<A::Value> {
        self.formal.constant((self.algebraic.symbol)(index, sine))
    }
}
