//! Polynomials in up to [`VARIABLES`] variables, in one normal form.
//!
//! A variable may have a rule for its square. With the rule s² = 1 − c² for every sine, two polynomials are
//! equal as functions exactly when their normal forms are equal, because 1, s, c, sc, c², … are independent.

use super::algebra::Algebra;
use super::rational::Rational;
use num_traits::{One, Zero};
use std::ops::{Add, Mul, Neg};

const WORDS: usize = 11;
/// How many variables a ring may have.
pub const VARIABLES: usize = WORDS * 8;

/// A polynomial with rational coefficients.
pub type Numerator = Polynomial<Rational>;

/// A product of powers; one byte holds an exponent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Monomial([u64; WORDS]);

impl Monomial {
    /// The exponent of a variable.
    pub fn exponent(&self, variable: usize) -> u8 {
        (self.0[variable / 8] >> (8 * (variable % 8))) as u8
    }

    /// This monomial with another exponent of one variable.
    pub fn with(mut self, variable: usize, exponent: u8) -> Self {
        let (word, shift) = (variable / 8, 8 * (variable % 8));
        self.0[word] = (self.0[word] & !(0xff << shift)) | (u64::from(exponent) << shift);
        self
    }

    /// Product. An arm's exponents stay below 40, so bytes never carry.
    fn times(&self, other: &Self) -> Self {
        Monomial(std::array::from_fn(|w| self.0[w] + other.0[w]))
    }

    /// The variables that occur, with their exponents.
    pub fn powers(&self) -> impl Iterator<Item = (usize, u8)> + '_ {
        self.0.iter().enumerate().filter(|(_, word)| **word != 0).flat_map(|(w, word)| {
            (0..8).map(move |b| (w * 8 + b, (word >> (8 * b)) as u8)).filter(|(_, e)| *e != 0)
        })
    }
}

/// Coefficients of a polynomial.
pub trait Coefficient: Clone + PartialEq + Zero + One + Neg<Output = Self>
where
    for<'a> &'a Self: Mul<&'a Self, Output = Self> + Add<&'a Self, Output = Self>,
{
    /// A small integer.
    fn from_integer(value: i64) -> Self;
}

impl Coefficient for i64 {
    fn from_integer(value: i64) -> Self {
        value
    }
}

impl Coefficient for super::rational::Rational {
    fn from_integer(value: i64) -> Self {
        super::rational::integer(value)
    }
}

/// A sum of monomials with coefficients other than zero, sorted by monomial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Polynomial<C> {
    terms: Vec<(Monomial, C)>,
}

impl<C> Polynomial<C> {
    /// The terms in order.
    pub fn terms(&self) -> &[(Monomial, C)] {
        &self.terms
    }
}

/// The rule for the square of a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Square<C> {
    /// Nothing simpler.
    Free,
    /// 1 − x² of another variable x: a sine and its cosine.
    OneMinusSquare(usize),
    /// A constant.
    Constant(C),
}

/// The ring: the rule for the square of each variable.
#[derive(Clone, Debug)]
pub struct PolynomialRing<C> {
    squares: Vec<Square<C>>,
}

impl<C: Coefficient> PolynomialRing<C>
where
    for<'a> &'a C: Mul<&'a C, Output = C> + Add<&'a C, Output = C>,
{
    /// A ring with one rule for each variable.
    ///
    /// # Panics
    /// With more than [`VARIABLES`] variables, which the largest number of joints rules out.
    pub fn new(squares: Vec<Square<C>>) -> Self {
        assert!(squares.len() <= VARIABLES, "{} variables, at most {VARIABLES}", squares.len());
        PolynomialRing { squares }
    }

    /// This ring with more variables after its own.
    ///
    /// # Panics
    /// Those of [`PolynomialRing::new`].
    #[must_use]
    pub fn extended(&self, more: Vec<Square<C>>) -> Self {
        let mut squares = self.squares.clone();
        squares.extend(more);
        Self::new(squares)
    }

    /// How many variables it has.
    pub fn variables(&self) -> usize {
        self.squares.len()
    }

    /// The variable itself.
    pub fn variable(&self, index: usize) -> Polynomial<C> {
        Polynomial { terms: vec![(Monomial::default().with(index, 1), C::one())] }
    }

    /// A coefficient times a monomial that is in normal form.
    pub fn term(&self, monomial: Monomial, coefficient: C) -> Polynomial<C> {
        let terms = if coefficient.is_zero() { vec![] } else { vec![(monomial, coefficient)] };
        Polynomial { terms }
    }

    /// A constant.
    pub fn constant(&self, value: C) -> Polynomial<C> {
        self.term(Monomial::default(), value)
    }

    /// Puts a monomial into normal form and appends the result.
    fn reduce_into(&self, monomial: Monomial, coefficient: C, out: &mut Vec<(Monomial, C)>) {
        let reducible = monomial.powers().find(|(v, e)| *e > 1 && self.squares[*v] != Square::Free);
        let Some((variable, exponent)) = reducible else {
            out.push((monomial, coefficient));
            return;
        };
        let rest = monomial.with(variable, exponent - 2);
        match &self.squares[variable] {
            Square::Free => {}
            Square::OneMinusSquare(other) => {
                let more = rest.with(*other, rest.exponent(*other) + 2);
                self.reduce_into(more, -coefficient.clone(), out);
                self.reduce_into(rest, coefficient, out);
            }
            Square::Constant(value) => self.reduce_into(rest, &coefficient * value, out),
        }
    }

    fn collect(mut terms: Vec<(Monomial, C)>) -> Polynomial<C> {
        terms.sort_unstable_by_key(|t| t.0);
        let mut merged: Vec<(Monomial, C)> = Vec::with_capacity(terms.len());
        for (monomial, coefficient) in terms {
            match merged.last_mut() {
                Some((last, sum)) if *last == monomial => *sum = &*sum + &coefficient,
                _ => merged.push((monomial, coefficient)),
            }
        }
        merged.retain(|(_, c)| !c.is_zero());
        Polynomial { terms: merged }
    }
}

impl<C: Coefficient> Algebra for PolynomialRing<C>
where
    for<'a> &'a C: Mul<&'a C, Output = C> + Add<&'a C, Output = C>,
{
    type Value = Polynomial<C>;

    fn integer(&self, value: i64) -> Polynomial<C> {
        self.constant(C::from_integer(value))
    }

    fn is_zero(&self, a: &Polynomial<C>) -> bool {
        a.terms.is_empty()
    }

    fn add(&self, a: &Polynomial<C>, b: &Polynomial<C>) -> Polynomial<C> {
        // Both are sorted, so a merge keeps the sum sorted.
        let mut sum = Vec::with_capacity(a.terms.len() + b.terms.len());
        let (mut x, mut y) = (a.terms.iter().peekable(), b.terms.iter().peekable());
        while let (Some(p), Some(q)) = (x.peek(), y.peek()) {
            match p.0.cmp(&q.0) {
                std::cmp::Ordering::Less => sum.extend(x.next().cloned()),
                std::cmp::Ordering::Greater => sum.extend(y.next().cloned()),
                std::cmp::Ordering::Equal => {
                    let c = &p.1 + &q.1;
                    if !c.is_zero() {
                        sum.push((p.0, c));
                    }
                    x.next();
                    y.next();
                }
            }
        }
        sum.extend(x.cloned());
        sum.extend(y.cloned());
        Polynomial { terms: sum }
    }

    fn neg(&self, a: &Polynomial<C>) -> Polynomial<C> {
        Polynomial { terms: a.terms.iter().map(|(m, c)| (*m, -c.clone())).collect() }
    }

    fn mul(&self, a: &Polynomial<C>, b: &Polynomial<C>) -> Polynomial<C> {
        let mut terms = Vec::with_capacity(a.terms.len() * b.terms.len());
        for (m, c) in &a.terms {
            for (n, d) in &b.terms {
                self.reduce_into(m.times(n), c * d, &mut terms);
            }
        }
        Self::collect(terms)
    }
}

#[cfg(test)]
mod tests {
    use super::super::rational::{integer, ratio};
    use super::*;

    #[test]
    fn sine_and_cosine_have_one_normal_form() {
        let ring = PolynomialRing::<i64>::new(vec![Square::OneMinusSquare(1), Square::Free]);
        let (s, c) = (ring.variable(0), ring.variable(1));
        let one = ring.add(&ring.mul(&s, &s), &ring.mul(&c, &c));
        assert_eq!(one, ring.integer(1));
        // (s + c)(s − c) = s² − c² = 1 − 2c²
        let product = ring.mul(&ring.add(&s, &c), &ring.sub(&s, &c));
        let expected = ring.sub(&ring.integer(1), &ring.mul(&ring.integer(2), &ring.mul(&c, &c)));
        assert_eq!(product, expected);
        let s3 = ring.mul(&ring.mul(&s, &s), &s);
        assert_eq!(s3, ring.sub(&s, &ring.mul(&s, &ring.mul(&c, &c))));
    }

    #[test]
    fn a_root_squares_to_its_constant() {
        let half = ratio(1, 2);
        let ring = PolynomialRing::new(vec![Square::Constant(half.clone())]);
        let h = ring.variable(0);
        assert_eq!(ring.mul(&h, &h), ring.constant(half));
        assert_eq!(ring.sub(&h, &h), ring.constant(integer(0)));
    }
}
