//! The Lagrangian's exact coefficients without the expanded Lagrangian: rows that span the row space of the
//! matrix with one row for each function of the motion and one column for each parameter.
//!
//! A linear functional on functions of all joints' motions is a sum of products of functionals, one for each
//! joint. What the columns of link i are under the functionals of the joints up to i is determined by what 32
//! monomials of the link's motion (velocities, their products, gravity, height) are. Their values span a
//! space that a step from link to link maps on, whatever number of joints follows. Take for each joint one
//! functional that keeps constants, the mean over its turn at rest, and otherwise such as vanish on
//! constants. Then the last joint whose functional vanishes on constants sorts the rows into blocks: its own
//! link's columns span at most eleven dimensions, and the links behind it see what the mean makes of them. So
//! the rank is a sum over the joints, and the work grows with the number of joints, not with the number of
//! terms. That the rows say the truth is certified in `certificate.rs`.

use super::preference::Preference;
use crate::arm::Arm;
use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{self, SparseRow, Unproven};
use crate::exact::polynomial::{Monomial, Numerator, Polynomial, PolynomialRing, Square};
use crate::exact::rational::{self, Rational};
use crate::exact::symbols::AngleSymbols;
use crate::lagrangian::elements::{ArmElements, JointElements, Source};
use crate::lagrangian::{Motion, link_columns, step};
use std::collections::BTreeMap;

/// Whether the arm's sizes are numbers or variables beside q.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sizes {
    /// The numbers in the file.
    Numbers,
    /// Every a, d and rotor ratio is a variable: a relation must hold for all of them.
    Variables,
}

/// Parameters of a link.
const LINK: usize = 11;
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
const VARIABLES: usize = MOTION + 7;

/// A functional's values on the monomials of a motion, or on a link's columns; zeros left out.
type Values = Vec<(usize, Constant)>;

/// The rows for the parameters that the arm keeps: those of [`all_rows`] without the other columns.
pub fn kept(arm: &Arm, rows: &[SparseRow]) -> Vec<SparseRow> {
    let all = arm.all_parameters();
    let of = |row: &SparseRow| -> SparseRow {
        row.iter().filter(|(column, _)| arm.keeps(all[*column])).cloned().collect()
    };
    rows.iter().map(of).filter(|row: &SparseRow| !row.is_empty()).collect()
}

/// Rows that span the row space of all the arm's parameters, whether declared zero or not.
///
/// # Errors
/// [`Unproven`] where a number of the arm is a multiple of the proof's prime.
pub fn all_rows(
    arm: &Arm,
    symbols: &AngleSymbols,
    field: &ConstantField,
    sizes: Sizes,
) -> Result<Vec<SparseRow>, Unproven> {
    let chain = Steps::new(arm, symbols, field, sizes);
    let mut constant = vec![chain.at_rest(arm)];
    let mut moving: Vec<Values> = Vec::new();
    let mut links = Vec::with_capacity(arm.dof());
    for joint in 0..arm.dof() {
        let step = chain.step(joint);
        let mut next = (Vec::new(), Vec::new());
        let mut own: Vec<Values> = Vec::new();
        for (values, moves) in constant.iter().map(|v| (v, false)).chain(moving.iter().map(|v| (v, true))) {
            for (functional, (image, rotor)) in step.images(values) {
                let new_motion = functional.moves || moves;
                if new_motion && !(functional.is_mean()) {
                    own.push(chain.columns(&image, &rotor));
                }
                if new_motion { next.1.push(image) } else { next.0.push(image) }
            }
        }
        constant = chain.basis(next.0, Steps::motion_order())?;
        moving = chain.basis(next.1, Steps::motion_order())?;
        let order = Preference::ALL[0].within_link(arm, joint);
        links.push(Link { pivots: chain.basis(own, order)?, step });
    }
    chain.rows(&links)
}

/// A functional on functions of one joint's motion and sizes: the coefficient of a monomial, or the mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Functional {
    /// Whether it vanishes on functions that do not depend on the joint's motion.
    moves: bool,
    /// The monomial; of the sizes alone where it does not vanish on them.
    monomial: Monomial,
}

impl Functional {
    /// The mean over the joint's turn, at rest and with sizes of zero.
    fn is_mean(self) -> bool {
        !self.moves && self.monomial == Monomial::default()
    }
}

/// What a link's own joint adds to the rows.
struct Link<'a, 'f> {
    /// A basis of the values that its columns take under functionals that vanish on constants, in reduced
    /// form.
    pivots: Vec<Values>,
    step: Step<'a, 'f>,
}

/// The steps from link to link, in a ring of the motion of one link and the variables of one joint.
struct Steps<'f> {
    field: &'f ConstantField,
    ring: PolynomialRing<Rational>,
    /// First variable after those of the field.
    first: usize,
    elements: ArmElements<Numerator>,
    /// The monomials of a motion, and the place of each.
    motion: Vec<Numerator>,
    place: BTreeMap<Monomial, usize>,
    /// A link's ten inertial columns: for each the motion's monomials in it.
    columns: Vec<Values>,
}

/// One step: each of the next motion's monomials, and the rotor's column, in monomials of the motion before
/// and of the joint.
struct Step<'a, 'f> {
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
    // Only one joint is looked at at a time, so all share their variables.
    fn joint_trig(&mut self, _: usize) -> (Numerator, Numerator) {
        (self.ring.variable(self.first + SIN), self.ring.variable(self.first + COS))
    }
    fn position(&mut self, _: usize) -> Numerator {
        self.ring.variable(self.first + POSITION)
    }
    fn speed(&mut self, _: usize) -> Numerator {
        self.ring.variable(self.first + SPEED)
    }
    fn a(&mut self, joint: usize) -> Numerator {
        self.size(A, &self.arm.joints[joint].a)
    }
    fn d(&mut self, joint: usize) -> Numerator {
        self.size(D, &self.arm.joints[joint].d)
    }
    fn ratio(&mut self, joint: usize) -> Numerator {
        let ratio = self.arm.joints[joint].rotor_ratio.clone().unwrap_or_default();
        self.size(RATIO, &ratio)
    }
    fn gravity(&mut self, axis: usize) -> Numerator {
        self.ring.constant(self.arm.gravity[axis].clone())
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Numerator {
        self.field.symbol(index, sine).clone()
    }
}

impl<'f> Steps<'f> {
    fn new(arm: &Arm, symbols: &AngleSymbols, field: &'f ConstantField, sizes: Sizes) -> Self {
        let first = field.ring().variables();
        let mut squares = vec![Square::Free; VARIABLES];
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
        let monomial = |p: &Numerator| p.terms()[0].0;
        let place: BTreeMap<Monomial, usize> =
            motion.iter().enumerate().map(|(i, p)| (monomial(p), i)).collect();
        let mut steps = Steps { field, ring, first, elements, motion, place, columns: Vec::new() };
        let columns = link_columns(&steps.ring, &steps.variables());
        let of = |column: &Numerator| -> Values {
            column.terms().iter().map(|(m, c)| (steps.place[m], field.rational(c.clone()))).collect()
        };
        steps.columns = columns.iter().map(of).collect();
        steps
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
    fn at_rest(&self, arm: &Arm) -> Values {
        let gravity = (0..3).map(|axis| (GRAVITY + axis, self.field.rational(arm.gravity[axis].clone())));
        let one = (0, self.field.rational(rational::integer(1)));
        std::iter::once(one).chain(gravity).filter(|(_, value)| !value.is_zero()).collect()
    }

    fn step(&self, joint: usize) -> Step<'_, 'f> {
        let mut motion = self.variables();
        let elements: &JointElements<Numerator> = &self.elements.joints[joint];
        let rotor = step(&self.ring, self.elements.convention, elements, &mut motion);
        let Motion { omega, velocity, gravity, height } = motion;
        let next: Vec<Numerator> = omega.into_iter().chain(velocity).chain(gravity).chain([height]).collect();
        let image = |monomial: &Numerator| {
            let powers = monomial.terms()[0].0;
            powers.powers().fold(self.ring.integer(1), |product, (variable, exponent)| {
                (0..exponent).fold(product, |p, _| self.ring.mul(&p, &next[variable - self.first]))
            })
        };
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
                    Some(v) if v < MOTION => 1,
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
            found.push(mean(Rational::new(1.into(), 2.into())));
        }
        found
    }

    /// A link's columns, the rotor's last, for the values of the motion's monomials.
    fn columns(&self, motion: &Values, rotor: &Constant) -> Values {
        let mut columns: Values = Vec::with_capacity(LINK);
        for (k, column) in self.columns.iter().enumerate() {
            let sum = combination(self.field, column, |m| find(motion, m));
            if !sum.is_zero() {
                columns.push((k, sum));
            }
        }
        if !rotor.is_zero() {
            columns.push((LINK - 1, rotor.clone()));
        }
        columns
    }

    /// Values of a motion's monomials under which a link's column is one and its others are zero; a rotor's
    /// column is no function of the motion.
    fn lifted(&self, column: usize) -> Values {
        // Gravity and height occur in one column each, and a column of an inertia is one monomial.
        let terms = self.columns.get(column).map_or(&[][..], Vec::as_slice);
        let own = terms.iter().find(|(m, _)| terms.len() == 1 || (GRAVITY..=HEIGHT).contains(m));
        let one = self.field.rational(rational::integer(1));
        own.and_then(|(m, factor)| Some((*m, self.field.div(&one, factor)?))).into_iter().collect()
    }

    fn motion_order() -> Vec<usize> {
        (0..1 + MOTION + 21).collect()
    }

    /// A basis in reduced form of the space that some values span, in the order of preference.
    ///
    /// Where the space holds a unit vector, which a reduction modulo the prime shows, it is taken as it is,
    /// so that no fraction is made of it.
    fn basis(&self, values: Vec<Values>, order: Vec<usize>) -> Result<Vec<Values>, Unproven> {
        let rows: Vec<SparseRow> = values
            .iter()
            .filter(|v| !v.is_empty())
            .map(|v| self.field.clear_denominators(&v.iter().map(|(k, c)| (*k, c)).collect::<Vec<_>>()))
            .collect();
        let width = order.iter().max().map_or(0, |m| m + 1);
        let units = elimination::unit_vectors(self.field, &rows, width, &order)?;
        let rest: Vec<SparseRow> = rows
            .into_iter()
            .map(|row| row.into_iter().filter(|(k, _)| !units.contains(k)).collect::<SparseRow>())
            .filter(|row| !row.is_empty())
            .collect();
        let one = self.field.rational(rational::integer(1));
        let mut basis: Vec<Values> = units.iter().map(|k| vec![(*k, one.clone())]).collect();
        let order: Vec<usize> = order.into_iter().filter(|k| !units.contains(k)).collect();
        if !rest.is_empty() {
            let found = elimination::dependence(self.field, &rest, width, &order)?;
            basis.extend(found.kept.iter().enumerate().map(|(position, kept)| {
                let mut row: Values = vec![(*kept, one.clone())];
                for (column, coordinates) in found.coordinates.iter().enumerate().filter(|(c, _)| c != kept) {
                    row.extend(
                        coordinates.iter().filter(|(p, _)| *p == position).map(|(_, c)| (column, c.clone())),
                    );
                }
                row
            }));
        }
        Ok(basis)
    }

    /// The rows: for each joint its link's basis, and what the means of the joints behind make of it.
    fn rows(&self, links: &[Link<'_, 'f>]) -> Result<Vec<SparseRow>, Unproven> {
        let n = links.len();
        // For each column of a link, what stands in the links behind it, without what those links' own rows
        // remove.
        let mut behind: Vec<Values> = vec![Vec::new(); LINK];
        let mut rows: Vec<SparseRow> = Vec::new();
        for joint in (0..n).rev() {
            let link = &links[joint];
            for pivot in &link.pivots {
                let row = self.continued(pivot, &behind, joint);
                let row: Vec<(usize, &Constant)> = row.iter().map(|(k, c)| (*k, c)).collect();
                rows.push(self.field.clear_denominators(&row));
            }
            if joint == 0 {
                break;
            }
            behind = (0..LINK)
                .map(|column| {
                    let images = link.step.images(&self.lifted(column));
                    let mean = images.into_iter().find(|(functional, _)| functional.is_mean());
                    let values = mean.map(|(_, (image, rotor))| self.columns(&image, &rotor));
                    let reduced = self.without_pivots(values.unwrap_or_default(), &link.pivots);
                    self.continued(&reduced, &behind, joint)
                })
                .collect();
        }
        rows.reverse();
        Ok(rows)
    }

    /// Values of a link's columns less multiples of its basis, so that the leading columns of those are zero.
    fn without_pivots(&self, values: Values, pivots: &[Values]) -> Values {
        let field = self.field;
        let mut rest: BTreeMap<usize, Constant> = values.into_iter().collect();
        for pivot in pivots {
            let Some(factor) = rest.get(&pivot[0].0).cloned() else { continue };
            for (column, value) in pivot {
                add_to(field, &mut rest, *column, &field.neg(&field.mul(&factor, value)));
            }
        }
        rest.into_iter().collect()
    }

    /// A link's values with what they are in the links behind, by the arm's columns.
    fn continued(&self, values: &Values, behind: &[Values], joint: usize) -> Values {
        let mut row: BTreeMap<usize, Constant> = BTreeMap::new();
        for (column, value) in values {
            add_to(self.field, &mut row, joint * LINK + column, value);
            for (further, factor) in &behind[*column] {
                add_to(self.field, &mut row, *further, &self.field.mul(value, factor));
            }
        }
        row.into_iter().collect()
    }
}

impl Step<'_, '_> {
    /// What the joint's functionals make of values: for each the next motion's values and the rotor's.
    fn images(&self, values: &Values) -> BTreeMap<Functional, (Values, Constant)> {
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

fn add_to(field: &ConstantField, sums: &mut BTreeMap<usize, Constant>, place: usize, term: &Constant) {
    let sum = match sums.get(&place) {
        Some(old) => field.add(old, term),
        None => term.clone(),
    };
    if sum.is_zero() {
        sums.remove(&place);
    } else {
        sums.insert(place, sum);
    }
}
