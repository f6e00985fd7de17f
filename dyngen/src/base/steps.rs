//! The step of one joint on functionals of the motion before it: from link to link on a motion's monomials.
//!
//! A motion is expressed in axes whose z is the link's own joint axis, in the standard convention too: there
//! the twist behind the joint is only in the link's columns and in the next step. Else every monomial would
//! be mixed by it, and the elimination would get fractions.

use super::coupled::{CARRIED, Carried, CoupledMotor};
use crate::arm::{Arm, Convention, Linkage};
use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::polynomial::{Monomial, Numerator, Polynomial, PolynomialRing, Square};
use crate::exact::rational::{self, Rational};
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{ArmElements, JointElements, Source, turn_x};
use crate::lagrangian::linkage::BarTurns;
use crate::lagrangian::{Motion, link_columns, step};
use std::collections::BTreeMap;

/// Whether the arm's sizes are numbers or variables in addition to q.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sizes {
    /// The numbers in the file.
    Numbers,
    /// Every a, d and rotor ratio is a variable: a relation must hold for all of them.
    Variables,
}

/// Parameters of a link.
pub(super) const LINK: usize = 11;
/// Variables of a motion: ω, v, gravity and height.
const MOTION: usize = 10;
/// Places of gravity's components and of the height among a motion's monomials, of which the first is 1.
const GRAVITY: usize = 7;
const HEIGHT: usize = 10;
/// Variables of one joint after those of the motion.
const SIN: usize = MOTION;
const COS: usize = MOTION + 1;
const POSITION: usize = MOTION + 2;
const SPEED: usize = MOTION + 3;
const A: usize = MOTION + 4;
const D: usize = MOTION + 5;
const RATIO: usize = MOTION + 6;
const B: usize = MOTION + 7;
/// Number of variables of the motion and the joint; those that coupled motors add to the motion follow.
const VARIABLES: usize = MOTION + 8;

/// A functional's values on the monomials of a motion, or on a link's columns; zeros left out.
pub(super) type Values = Vec<(usize, Constant)>;

/// A functional on functions of one joint's motion and sizes: the coefficient of a monomial, or the mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Functional {
    /// Whether it vanishes on functions that do not depend on the joint's motion.
    pub(super) moves: bool,
    /// The monomial; of the sizes alone where it does not vanish on them.
    monomial: Monomial,
}

impl Functional {
    /// The mean over the joint's turn, at rest and with sizes of zero.
    pub(super) fn is_mean(self) -> bool {
        !self.moves && self.monomial == Monomial::default()
    }
}

/// The steps from link to link, in a ring of the motion of one link and the variables of one joint.
pub(super) struct Steps<'f> {
    pub(super) field: &'f ConstantField,
    ring: PolynomialRing<Rational>,
    /// First variable after those of the field.
    first: usize,
    elements: ArmElements<Numerator>,
    /// The monomials of a motion, and the place of each.
    motion: Vec<Numerator>,
    place: BTreeMap<Monomial, usize>,
    /// A body's ten inertial columns: for each the motion's monomials in it, the motion expressed in the
    /// body's axes.
    body: Vec<Values>,
    /// The columns of each link, the motion expressed as all are.
    columns: Vec<Vec<Values>>,
    /// Motors that turn with several joints.
    coupled: Vec<CoupledMotor>,
    /// For each of them the monomials of which its rotor's energy will be made. They are columns of a link
    /// in addition to its own eleven; the first of five is the energy so far.
    pending: Vec<usize>,
}

/// One step: each of the next motion's monomials, and the rotor's column, in monomials of the motion before
/// and of the joint.
pub(super) struct Step<'a, 'f> {
    steps: &'a Steps<'f>,
    /// For each monomial of the next motion, then for the rotor: (monomial before, monomial of the joint,
    /// factor).
    terms: Vec<Vec<(usize, Monomial, Numerator)>>,
}

struct Quantities<'r> {
    arm: &'r Arm,
    field: &'r ConstantField,
    ring: &'r PolynomialRing<Rational>,
    first: usize,
    sizes: Sizes,
}

impl Quantities<'_> {
    fn size(&self, variable: usize, value: &Rational) -> Numerator {
        match self.sizes {
            Sizes::Numbers => self.ring.constant(value.clone()),
            Sizes::Variables => self.ring.variable(self.first + variable),
        }
    }
}

impl Source<Numerator> for Quantities<'_> {
    // Only one joint is treated at a time, so all share their variables.
    fn joint_trig(&mut self, _: usize) -> (Numerator, Numerator) {
        (self.ring.variable(self.first + SIN), self.ring.variable(self.first + COS))
    }
    fn position(&mut self, _: usize) -> Numerator {
        self.ring.variable(self.first + POSITION)
    }
    fn velocity(&mut self, _: usize) -> Numerator {
        self.ring.variable(self.first + SPEED)
    }
    fn a(&mut self, joint: usize) -> Numerator {
        self.size(A, &self.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Numerator {
        self.size(B, &self.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Numerator {
        self.size(D, &self.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Numerator {
        let ratio = self.arm.joints[joint].rotor_ratio.clone().unwrap_or_default();
        self.size(RATIO, &ratio)
    }
    fn exact(&mut self, value: &Rational) -> Numerator {
        self.ring.constant(value.clone())
    }
    // Arms with bars have their rows by poses.
    fn linkage(&mut self, _: &Linkage) -> Option<BarTurns<Numerator>> {
        None
    }
    fn gravity(&mut self, axis: usize) -> Numerator {
        self.ring.constant(self.arm.gravity[axis].clone())
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Numerator {
        self.field.symbol(index, sine).clone()
    }
}

impl<'f> Steps<'f> {
    pub(super) fn new(arm: &Arm, symbols: &AngleSymbols, field: &'f ConstantField, sizes: Sizes) -> Self {
        let first = field.ring().variables();
        let coupled = CoupledMotor::all(arm);
        let mut squares = vec![Square::Free; VARIABLES + CARRIED * coupled.len()];
        squares[SIN] = Square::OneMinusSquare(first + COS);
        let ring = field.ring().extended(squares);
        let mut source = Quantities { arm, field, ring: &ring, first, sizes };
        let elements = ArmElements::build(&ring, arm, symbols, &mut source);
        let x = |i: usize| ring.variable(first + i);
        let mut motion = vec![ring.integer(1)];
        motion.extend((0..MOTION).map(x));
        for i in 0..6 {
            motion.extend((i..6).map(|j| ring.mul(&x(i), &x(j))));
        }
        let mut pending = Vec::new();
        for r in 0..coupled.len() {
            let Carried { velocity, energy, rate, square } = carried(&ring, first, r);
            let mut made = vec![energy, ring.mul(&velocity, &velocity)];
            made.extend((0..3).map(|axis| ring.mul(&x(axis), &velocity)));
            pending.extend(motion.len()..motion.len() + made.len());
            motion.extend(made);
            motion.extend([velocity, rate, square]);
        }
        let monomial = |p: &Numerator| p.terms()[0].0;
        let place: BTreeMap<Monomial, usize> =
            motion.iter().enumerate().map(|(i, p)| (monomial(p), i)).collect();
        let (body, columns) = (Vec::new(), Vec::new());
        let mut steps =
            Steps { field, ring, first, elements, motion, place, body, columns, coupled, pending };
        let of = |motion: &Motion<Numerator>| -> Vec<Values> {
            let value = |(place, _, factor)| (place, field.whole(factor));
            let column = |p: &Numerator| steps.split(p).into_iter().map(value).collect();
            link_columns(&steps.ring, motion).iter().map(column).collect()
        };
        let columns = (0..arm.dof()).map(|joint| of(&steps.turned(joint, false))).collect();
        (steps.body, steps.columns) = (of(&steps.variables()), columns);
        steps
    }

    /// A motion's variables in the axes behind a joint's twist where the convention puts one there, or,
    /// expressed in those, back in the axes before it.
    fn turned(&self, joint: usize, back: bool) -> Motion<Numerator> {
        let mut motion = self.variables();
        if self.elements.convention == Convention::Standard {
            let JointElements { sin_alpha, cos_alpha, .. } = &self.elements.joints[joint];
            let sin = if back { self.ring.neg(sin_alpha) } else { sin_alpha.clone() };
            for v in [&mut motion.omega, &mut motion.velocity, &mut motion.gravity] {
                *v = turn_x(&self.ring, &sin, cos_alpha, v);
            }
        }
        motion
    }

    /// A motion whose quantities are the ring's variables.
    fn variables(&self) -> Motion<Numerator> {
        let three = |i: usize| [0, 1, 2].map(|k| self.ring.variable(self.first + i + k));
        Motion {
            omega: three(0),
            velocity: three(3),
            gravity: three(6),
            height: self.ring.variable(self.first + 9),
        }
    }

    /// The motion of the base, which stands still under gravity.
    pub(super) fn at_rest(&self, arm: &Arm) -> Values {
        let gravity = (0..3).map(|axis| (GRAVITY + axis, self.field.rational(arm.gravity[axis].clone())));
        let one = (0, self.field.rational(rational::integer(1)));
        std::iter::once(one).chain(gravity).filter(|(_, value)| !value.is_zero()).collect()
    }

    pub(super) fn step(&self, joint: usize) -> Step<'_, 'f> {
        let ring = &self.ring;
        let mut motion = joint.checked_sub(1).map_or(self.variables(), |before| self.turned(before, false));
        let mut elements: JointElements<Numerator> = self.elements.joints[joint].clone();
        if self.elements.convention == Convention::Standard {
            (elements.sin_alpha, elements.cos_alpha) = (ring.integer(0), ring.integer(1));
        }
        let axis = step(ring, self.elements.convention, &elements, &mut motion);
        let next = listed(motion);
        let ratio = elements.ratio.clone().unwrap_or(ring.integer(0));
        let carry = |(r, motor): (usize, &CoupledMotor)| {
            let drive = (&axis.omega, &elements.velocity, &ratio);
            let after = motor.step(ring, joint, &carried(ring, self.first, r), drive);
            [after.velocity, after.energy, after.rate, after.square]
        };
        let carried: Vec<Numerator> = self.coupled.iter().enumerate().flat_map(carry).collect();
        let after = |variable: usize| match variable - self.first {
            v if v < MOTION => &next[v],
            v => &carried[v - VARIABLES],
        };
        let image = |monomial: &Numerator| image(ring, monomial, &after);
        // The rotor of a coupled motor is carried.
        let is_carried = self.coupled.iter().any(|motor| motor.motor == joint);
        let rotor = if is_carried { ring.integer(0) } else { axis.rotor };
        let terms = self.motion.iter().map(image).chain([rotor]).map(|p| self.split(&p)).collect();
        Step { steps: self, terms }
    }

    /// A polynomial's terms by the motion's monomial and the joint's.
    fn split(&self, polynomial: &Polynomial<Rational>) -> Vec<(usize, Monomial, Numerator)> {
        let mut parts: BTreeMap<(usize, Monomial), Numerator> = BTreeMap::new();
        for (monomial, coefficient) in polynomial.terms() {
            let mut three = [Monomial::default(); 3];
            for (variable, exponent) in monomial.powers() {
                let part = match variable.checked_sub(self.first) {
                    None => 0,
                    Some(v) if !(MOTION..VARIABLES).contains(&v) => 1,
                    Some(_) => 2,
                };
                three[part] = three[part].with(variable, exponent);
            }
            let [constants, motion, joint] = three;
            let term = self.ring.term(constants, coefficient.clone());
            let entry = parts.entry((self.place[&motion], joint)).or_insert_with(|| self.ring.integer(0));
            *entry = self.ring.add(entry, &term);
        }
        parts.into_iter().map(|((motion, joint), factor)| (motion, joint, factor)).collect()
    }

    /// The functionals in which a joint's monomial takes part, with the weight of its coefficient.
    fn functionals(&self, monomial: &Monomial) -> Vec<(Functional, Rational)> {
        let (mut motion, mut sizes) = (Monomial::default(), Monomial::default());
        for (variable, exponent) in monomial.powers() {
            if variable - self.first < A {
                motion = motion.with(variable, exponent);
            } else {
                sizes = sizes.with(variable, exponent);
            }
        }
        let mean = |weight: Rational| (Functional { moves: false, monomial: sizes }, weight);
        if motion == Monomial::default() {
            return vec![mean(rational::integer(1))];
        }
        let mut found = vec![(Functional { moves: true, monomial: *monomial }, rational::integer(1))];
        // The mean of cos² is one half; of all other monomials of q and q̇ it is zero.
        if motion == Monomial::default().with(self.first + COS, 2) {
            found.push(mean(rational::ratio(1, 2)));
        }
        found
    }

    /// A link's columns for the values of the motion's monomials: the inertial ones, the rotor's, and those
    /// of which coupled motors' are made.
    pub(super) fn columns(&self, joint: usize, motion: &Values, rotor: &Constant) -> Values {
        let mut columns: Values = Vec::with_capacity(LINK);
        for (k, column) in self.columns[joint].iter().enumerate() {
            let sum = combination(self.field, column, |m| find(motion, m));
            if !sum.is_zero() {
                columns.push((k, sum));
            }
        }
        if !rotor.is_zero() {
            columns.push((LINK - 1, rotor.clone()));
        }
        let pending = self.pending.iter().enumerate();
        columns.extend(pending.filter_map(|(p, m)| Some((LINK + p, find(motion, *m)?.clone()))));
        columns
    }

    /// For each column of a link, values of a motion's monomials under which it is one and the link's others
    /// are zero; a rotor's column is not a function of the motion.
    pub(super) fn lifted(&self, joint: usize) -> Vec<Values> {
        let one = self.field.rational(rational::integer(1));
        let before = listed(self.turned(joint, true));
        let own = |variable: usize| &before[variable - self.first];
        // Each monomial in the body's axes; those of coupled motors are expressed in no others.
        let carried = self.pending.first().copied().unwrap_or(self.motion.len());
        let in_body: Vec<_> =
            self.motion[..carried].iter().map(|m| self.split(&image(&self.ring, m, &own))).collect();
        let lift = |column: usize| -> Values {
            if let Some(place) = column.checked_sub(LINK) {
                return vec![(self.pending[place], one.clone())];
            }
            // Gravity and height occur in one column each, and a column of an inertia is one monomial.
            let terms = self.body.get(column).map_or(&[][..], Vec::as_slice);
            let only = terms.iter().find(|(m, _)| terms.len() == 1 || (GRAVITY..=HEIGHT).contains(m));
            let Some((m, value)) = only.and_then(|(m, factor)| Some((m, self.field.div(&one, factor)?)))
            else {
                return Vec::new();
            };
            let of = |(k, terms): (usize, &Vec<(usize, Monomial, Numerator)>)| {
                let (_, _, factor) = terms.iter().find(|(place, ..)| place == m)?;
                Some((k, self.field.mul(&self.field.whole(factor.clone()), &value)))
            };
            in_body.iter().enumerate().filter_map(of).collect()
        };
        (0..self.width()).map(lift).collect()
    }

    /// Number of columns of a link: its eleven, and those from which the columns of coupled motors are made.
    pub(super) fn width(&self) -> usize {
        LINK + self.pending.len()
    }

    /// The arm's column that a link's column is; none where it is only something that a later one is made of.
    pub(super) fn arm_column(&self, joint: usize, column: usize) -> Option<usize> {
        let Some(place) = column.checked_sub(LINK) else { return Some(joint * LINK + column) };
        let each = self.pending.len() / self.coupled.len().max(1);
        let motor = &self.coupled[place / each];
        (place % each == 0 && motor.last == joint).then_some(motor.motor * LINK + LINK - 1)
    }

    pub(super) fn motion_order(&self) -> Vec<usize> {
        (0..self.motion.len()).collect()
    }
}

impl Step<'_, '_> {
    /// Applies the joint's functionals to values: for each, the next motion's values and the rotor's.
    pub(super) fn images(&self, values: &Values) -> BTreeMap<Functional, (Values, Constant)> {
        let field = self.steps.field;
        let zero = || field.rational(rational::integer(0));
        let mut images: BTreeMap<Functional, (Values, Constant)> = BTreeMap::new();
        let rotor = self.terms.len() - 1;
        for (k, terms) in self.terms.iter().enumerate() {
            let mut sums: BTreeMap<Functional, Constant> = BTreeMap::new();
            for (motion, joint, factor) in terms {
                let Some(value) = find(values, *motion) else { continue };
                let term = field.mul(&field.whole(factor.clone()), value);
                for (functional, weight) in self.steps.functionals(joint) {
                    let term = field.mul(&field.rational(weight), &term);
                    let sum = sums.entry(functional).or_insert_with(zero);
                    *sum = field.add(sum, &term);
                }
            }
            for (functional, sum) in sums.into_iter().filter(|(_, sum)| !sum.is_zero()) {
                let image = images.entry(functional).or_insert_with(|| (Vec::new(), zero()));
                if k == rotor { image.1 = sum } else { image.0.push((k, sum)) }
            }
        }
        images
    }
}

/// A motion's quantities in the order of their variables.
fn listed(motion: Motion<Numerator>) -> Vec<Numerator> {
    let Motion { omega, velocity, gravity, height } = motion;
    omega.into_iter().chain(velocity).chain(gravity).chain([height]).collect()
}

/// A monomial with something else in place of its variables.
fn image<'v>(
    ring: &PolynomialRing<Rational>,
    monomial: &Numerator,
    of: &impl Fn(usize) -> &'v Numerator,
) -> Numerator {
    let powers = monomial.terms()[0].0;
    powers.powers().fold(ring.integer(1), |product, (variable, exponent)| {
        (0..exponent).fold(product, |p, _| ring.mul(&p, of(variable)))
    })
}

/// The variables of a coupled motor.
fn carried(ring: &PolynomialRing<Rational>, first: usize, motor: usize) -> Carried<Numerator> {
    let x = |k: usize| ring.variable(first + VARIABLES + CARRIED * motor + k);
    Carried { velocity: x(0), energy: x(1), rate: x(2), square: x(3) }
}

fn find(values: &Values, place: usize) -> Option<&Constant> {
    values.iter().find(|(k, _)| *k == place).map(|(_, value)| value)
}

/// Σ factor·value
fn combination<'v>(
    field: &ConstantField,
    factors: &Values,
    value: impl Fn(usize) -> Option<&'v Constant>,
) -> Constant {
    let terms = factors.iter().filter_map(|(k, factor)| value(*k).map(|v| field.mul(factor, v)));
    terms.fold(field.rational(rational::integer(0)), |sum, term| field.add(&sum, &term))
}
