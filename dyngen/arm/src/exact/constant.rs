//! The field of an arm's constants: rationals, with the sines and cosines of angles that are not rational.
//!
//! A constant is a fraction of polynomials over those symbols. For an arm whose angles are multiples of pi/2
//! it is a rational number.

use super::algebra::{Algebra, Inverses};
use super::gcd;
use super::polynomial::{Monomial, Numerator, PolynomialRing, Square};
use super::prime::{Draws, Fp};
use super::rational::{self, Rational};
use super::symbols::{AngleSymbols, SymbolKind};
use num_traits::{One, Signed, Zero};
use std::collections::BTreeMap;

/// A coefficient and the powers of symbols it multiplies: (symbol, its sine?, exponent).
pub type Factors = (Rational, Vec<(usize, bool, u8)>);

/// A constant of the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    numerator: Numerator,
    denominator: Numerator,
}

/// The field that an arm's constants live in.
#[derive(Clone, Debug)]
pub struct ConstantField {
    ring: PolynomialRing<Rational>,
    /// For each symbol, its sine and cosine as elements.
    symbols: Vec<(Numerator, Numerator)>,
    /// For each ring variable: its text, value, and whether its negative is its conjugate (a sine over its
    /// cosine, or a root).
    variables: Vec<(String, f64, bool)>,
    /// For each ring variable, the symbol whose sine (`true`) or cosine it is.
    origins: Vec<(usize, bool)>,
    /// For each angle symbol, also those outside of the ring, its sine and cosine modulo the prime.
    residues: Vec<(Fp, Fp)>,
    /// For each ring variable, its value modulo the prime.
    modular: Vec<Fp>,
}

impl ConstantField {
    /// The field of the first `members` of an arm's angle symbols; `draws` gives general angles their values
    /// modulo the prime. The others, those of frames that no torque depends on, have such a value only: an
    /// arm may have dozens of them, and a ring has room for [`VARIABLES`](super::polynomial::VARIABLES).
    pub fn new(angles: &AngleSymbols, members: usize, draws: &mut Draws) -> Self {
        let residues: Vec<_> = (0..angles.angles.len()).map(|index| angles.modular(index, draws)).collect();
        let mut squares = Vec::new();
        let mut variables = Vec::new();
        let mut modular = Vec::new();
        let mut origins = Vec::new();
        for (index, angle) in angles.angles[..members].iter().enumerate() {
            let (sin, cos) = angle.sin_cos();
            let (sin_p, cos_p) = residues[index];
            let root = |n: i64, d: i64| Square::Constant(rational::ratio(n, d));
            match angles.kind(index) {
                SymbolKind::General => {
                    squares.push(Square::OneMinusSquare(squares.len() + 1));
                    squares.push(Square::Free);
                    variables.push((format!("sin({angle})"), sin, true));
                    variables.push((format!("cos({angle})"), cos, false));
                    modular.extend([sin_p, cos_p]);
                    origins.extend([(index, true), (index, false)]);
                }
                SymbolKind::Eighth => {
                    squares.push(root(1, 2));
                    variables.push((format!("sin({angle})"), sin, true));
                    modular.push(sin_p);
                    origins.push((index, true));
                }
                SymbolKind::Twelfth => {
                    squares.push(root(3, 4));
                    variables.push((format!("cos({angle})"), cos, true));
                    modular.push(cos_p);
                    origins.push((index, false));
                }
            }
        }
        let ring = PolynomialRing::new(squares);
        let mut at = 0;
        let symbols = (0..members)
            .map(|index| match angles.kind(index) {
                SymbolKind::General => {
                    at += 2;
                    (ring.variable(at - 2), ring.variable(at - 1))
                }
                SymbolKind::Eighth => {
                    at += 1;
                    (ring.variable(at - 1), ring.variable(at - 1))
                }
                SymbolKind::Twelfth => {
                    at += 1;
                    (ring.constant(rational::ratio(1, 2)), ring.variable(at - 1))
                }
            })
            .collect();
        ConstantField { ring, symbols, variables, origins, modular, residues }
    }

    /// The ring of numerators.
    pub fn ring(&self) -> &PolynomialRing<Rational> {
        &self.ring
    }

    /// Sine or cosine of a symbol of the field.
    pub fn symbol(&self, index: usize, sine: bool) -> &Numerator {
        let (sin, cos) = &self.symbols[index];
        if sine { sin } else { cos }
    }

    /// A polynomial as a constant.
    pub fn whole(&self, numerator: Numerator) -> Constant {
        Constant { numerator, denominator: self.ring.integer(1) }
    }

    /// A rational as a constant.
    pub fn rational(&self, value: Rational) -> Constant {
        self.whole(self.ring.constant(value))
    }

    /// A polynomial modulo the prime; `None` where the prime divides a denominator.
    pub fn modular_whole(&self, a: &Numerator) -> Option<Fp> {
        let mut sum = Fp::ZERO;
        for (monomial, coefficient) in a.terms() {
            let mut term = Fp::from_rational(coefficient)?;
            for (variable, exponent) in monomial.powers() {
                term = term * self.modular[variable].power(u64::from(exponent));
            }
            sum = sum + term;
        }
        Some(sum)
    }

    /// A constant modulo the prime.
    pub fn modular(&self, a: &Constant) -> Option<Fp> {
        Some(self.modular_whole(&a.numerator)? * self.modular_whole(&a.denominator)?.inverse()?)
    }

    /// The sine or cosine of a symbol modulo the prime.
    pub fn modular_symbol(&self, index: usize, sine: bool) -> Fp {
        let (sin, cos) = self.residues[index];
        if sine { sin } else { cos }
    }

    /// The nearest `f64`.
    pub fn value(&self, a: &Constant) -> f64 {
        self.value_whole(&a.numerator) / self.value_whole(&a.denominator)
    }

    fn value_whole(&self, a: &Numerator) -> f64 {
        let term = |(monomial, coefficient): &(Monomial, Rational)| {
            let powers = monomial.powers().map(|(v, e)| self.variables[v].1.powi(i32::from(e)));
            rational::to_f64(coefficient) * powers.product::<f64>()
        };
        a.terms().iter().map(term).sum()
    }

    /// a + b
    pub fn add(&self, a: &Constant, b: &Constant) -> Constant {
        if a.denominator == b.denominator {
            return self.normal(self.ring.add(&a.numerator, &b.numerator), a.denominator.clone());
        }
        let left = self.ring.mul(&a.numerator, &b.denominator);
        let right = self.ring.mul(&b.numerator, &a.denominator);
        self.normal(self.ring.add(&left, &right), self.ring.mul(&a.denominator, &b.denominator))
    }

    /// −a
    pub fn neg(&self, a: &Constant) -> Constant {
        Constant { numerator: self.ring.neg(&a.numerator), denominator: a.denominator.clone() }
    }

    /// a·b
    pub fn mul(&self, a: &Constant, b: &Constant) -> Constant {
        self.normal(self.ring.mul(&a.numerator, &b.numerator), self.ring.mul(&a.denominator, &b.denominator))
    }

    /// a/b; `None` where b is zero.
    pub fn div(&self, a: &Constant, b: &Constant) -> Option<Constant> {
        if b.is_zero() {
            return None;
        }
        let numerator = self.ring.mul(&a.numerator, &b.denominator);
        Some(self.normal(numerator, self.ring.mul(&a.denominator, &b.numerator)))
    }

    /// Lowest terms: no root and no sine in the denominator, no common factor, and its leading coefficient 1.
    fn normal(&self, mut numerator: Numerator, mut denominator: Numerator) -> Constant {
        if numerator.terms().is_empty() {
            return self.whole(numerator);
        }
        for (variable, (_, _, conjugates)) in self.variables.iter().enumerate() {
            if *conjugates && denominator.terms().iter().any(|(m, _)| m.exponent(variable) > 0) {
                let conjugate = self.conjugate(&denominator, variable);
                numerator = self.ring.mul(&numerator, &conjugate);
                denominator = self.ring.mul(&denominator, &conjugate);
            }
        }
        if denominator.terms().iter().any(|(m, _)| *m != Monomial::default()) {
            let parts = self.by_conjugating_part(&numerator);
            let common = parts.iter().fold(denominator.clone(), |g, part| gcd::gcd(&self.ring, &g, part));
            // The factor divides every part, so it divides the whole.
            let reduced = self.divide_parts(&numerator, &common);
            if let (Some(n), Some(d)) = (reduced, gcd::exact_quotient(&self.ring, &denominator, &common)) {
                (numerator, denominator) = (n, d);
            }
        }
        if let Some((_, lead)) = denominator.terms().last() {
            let scale = self.ring.constant(Rational::ONE / lead);
            numerator = self.ring.mul(&numerator, &scale);
            denominator = self.ring.mul(&denominator, &scale);
        }
        Constant { numerator, denominator }
    }

    /// The variables of a monomial that have conjugates: sines and roots.
    fn conjugating_part(&self, monomial: &Monomial) -> Monomial {
        let powers = monomial.powers().filter(|(v, _)| self.variables[*v].2);
        powers.fold(Monomial::default(), |m, (v, e)| m.with(v, e))
    }

    /// The polynomials in the cosines that stand before each product of sines and roots.
    fn by_conjugating_part(&self, a: &Numerator) -> Vec<Numerator> {
        self.split(a).into_values().collect()
    }

    fn split(&self, a: &Numerator) -> BTreeMap<Monomial, Numerator> {
        let mut parts: BTreeMap<Monomial, Numerator> = BTreeMap::new();
        for (monomial, coefficient) in a.terms() {
            let part = self.conjugating_part(monomial);
            let rest = part.powers().fold(*monomial, |m, (v, _)| m.with(v, 0));
            let entry = parts.entry(part).or_insert_with(|| self.ring.integer(0));
            *entry = self.ring.add(entry, &self.ring.term(rest, coefficient.clone()));
        }
        parts
    }

    fn divide_parts(&self, a: &Numerator, divisor: &Numerator) -> Option<Numerator> {
        let mut sum = self.ring.integer(0);
        for (part, polynomial) in self.split(a) {
            let quotient = gcd::exact_quotient(&self.ring, &polynomial, divisor)?;
            sum = self.ring.add(&sum, &self.ring.mul(&self.ring.term(part, Rational::one()), &quotient));
        }
        Some(sum)
    }

    /// Numerator and denominator as sums of coefficient times powers of (symbol, sine?, exponent).
    pub fn factors(&self, a: &Constant) -> (Vec<Factors>, Vec<Factors>) {
        let split = |n: &Numerator| {
            let powers =
                |m: &Monomial| m.powers().map(|(v, e)| (self.origins[v].0, self.origins[v].1, e)).collect();
            n.terms().iter().map(|(m, c)| (c.clone(), powers(m))).collect()
        };
        (split(&a.numerator), split(&a.denominator))
    }

    /// A row of constants multiplied by a common denominator.
    pub fn clear_denominators(&self, row: &[(usize, &Constant)]) -> Vec<(usize, Numerator)> {
        let one = self.ring.integer(1);
        let mut denominators: Vec<&Numerator> = Vec::new();
        for (_, value) in row {
            if value.denominator != one && !denominators.contains(&&value.denominator) {
                denominators.push(&value.denominator);
            }
        }
        let scaled = |value: &Constant| {
            let others = denominators.iter().filter(|d| ***d != value.denominator);
            others.fold(value.numerator.clone(), |n, d| self.ring.mul(&n, d))
        };
        row.iter().map(|(c, value)| (*c, scaled(value))).collect()
    }

    fn conjugate(&self, a: &Numerator, variable: usize) -> Numerator {
        let term = |(m, c): &(Monomial, Rational)| {
            let odd = m.exponent(variable) % 2 == 1;
            self.ring.term(*m, if odd { -c.clone() } else { c.clone() })
        };
        a.terms().iter().fold(self.ring.integer(0), |sum, t| self.ring.add(&sum, &term(t)))
    }

    /// The text of a constant: `-49/400`, `1/2*cos(0.3)`.
    pub fn text(&self, a: &Constant) -> String {
        let numerator = self.text_whole(&a.numerator);
        if a.denominator == self.ring.integer(1) {
            return numerator;
        }
        format!("({numerator})/({})", self.text_whole(&a.denominator))
    }

    fn text_whole(&self, a: &Numerator) -> String {
        let mut text = String::new();
        for (monomial, coefficient) in a.terms() {
            let mut factors: Vec<String> = Vec::new();
            let magnitude = coefficient.abs();
            let powers: Vec<_> = monomial.powers().collect();
            if !magnitude.is_one() || powers.is_empty() {
                factors.push(rational::to_text(&magnitude));
            }
            for (variable, exponent) in powers {
                let name = &self.variables[variable].0;
                factors.push(if exponent == 1 { name.clone() } else { format!("{name}^{exponent}") });
            }
            text.push_str(match (text.is_empty(), coefficient.is_negative()) {
                (true, false) => "",
                (true, true) => "-",
                (false, false) => " + ",
                (false, true) => " - ",
            });
            text.push_str(&factors.join("*"));
        }
        if text.is_empty() { "0".to_string() } else { text }
    }
}

impl Inverses for ConstantField {
    fn inverse(&self, a: &Constant) -> Option<Constant> {
        self.div(&self.rational(rational::integer(1)), a)
    }
}

impl Algebra for ConstantField {
    type Value = Constant;
    fn integer(&self, value: i64) -> Constant {
        self.rational(rational::integer(value))
    }
    fn is_zero(&self, a: &Constant) -> bool {
        a.is_zero()
    }
    fn add(&self, a: &Constant, b: &Constant) -> Constant {
        ConstantField::add(self, a, b)
    }
    fn neg(&self, a: &Constant) -> Constant {
        ConstantField::neg(self, a)
    }
    fn mul(&self, a: &Constant, b: &Constant) -> Constant {
        ConstantField::mul(self, a, b)
    }
}

impl Constant {
    /// Whether it is zero.
    pub fn is_zero(&self) -> bool {
        self.numerator.terms().is_empty()
    }

    /// The rational number that it is, if it is one.
    pub fn as_rational(&self) -> Option<Rational> {
        let rational = |n: &Numerator| match n.terms() {
            [] => Some(Rational::zero()),
            [(monomial, value)] if *monomial == Monomial::default() => Some(value.clone()),
            _ => None,
        };
        Some(rational(&self.numerator)? / rational(&self.denominator)?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::angle::Angle;
    use super::*;

    fn field(angles: &[&str]) -> ConstantField {
        let symbols = AngleSymbols { angles: angles.iter().map(|a| Angle::parse(a).unwrap()).collect() };
        ConstantField::new(&symbols, symbols.angles.len(), &mut Draws::new(7))
    }

    #[test]
    fn fractions_of_roots_become_whole() {
        let f = field(&["pi/4", "pi/6"]);
        let (h, r) = (f.whole(f.symbol(0, true).clone()), f.whole(f.symbol(1, false).clone()));
        let one = f.rational(rational::integer(1));
        let sum = f.add(&h, &r);
        let inverse = f.div(&one, &sum).unwrap();
        assert_eq!(f.mul(&inverse, &sum), one);
        assert!((f.value(&inverse) - 1.0 / (0.5f64.sqrt() + 0.75f64.sqrt())).abs() < 1e-12);
        let modular = f.modular(&inverse).unwrap() * f.modular(&sum).unwrap();
        assert_eq!(modular, Fp::ONE);
    }

    #[test]
    fn a_general_angle_keeps_its_name_and_cancels() {
        let f = field(&["0.3"]);
        let (s, c) = (f.whole(f.symbol(0, true).clone()), f.whole(f.symbol(0, false).clone()));
        assert_eq!(f.text(&s), "sin(0.3)");
        let tangent = f.div(&s, &c).unwrap();
        assert_eq!(f.add(&tangent, &f.neg(&tangent)), f.rational(rational::integer(0)));
        // s² / (1 − c²) = 1
        let square = f.mul(&s, &s);
        assert_eq!(f.div(&square, &square).unwrap().as_rational(), Some(rational::integer(1)));
    }
}
