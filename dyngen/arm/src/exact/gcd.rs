//! Greatest common divisors of polynomials, so that fractions of symbols stay in lowest terms.
//!
//! Only for polynomials in variables whose squares have no rule: there the ring is a unique factorisation
//! domain.

use super::algebra::Algebra;
use super::polynomial::{Monomial, Numerator, PolynomialRing};
use super::rational::Rational;

type Ring = PolynomialRing<Rational>;

/// The greatest common divisor, with leading coefficient 1.
pub fn gcd(ring: &Ring, a: &Numerator, b: &Numerator) -> Numerator {
    if ring.is_zero(a) {
        return monic(ring, b);
    }
    if ring.is_zero(b) {
        return monic(ring, a);
    }
    let Some(variable) =
        a.terms().iter().chain(b.terms()).flat_map(|(m, _)| m.powers()).map(|(v, _)| v).max()
    else {
        return ring.integer(1);
    };
    let (content_a, mut p) = primitive(ring, &coefficients(ring, a, variable));
    let (content_b, mut q) = primitive(ring, &coefficients(ring, b, variable));
    let content = gcd(ring, &content_a, &content_b);
    while !q.is_empty() {
        let remainder = pseudo_remainder(ring, &p, &q);
        p = q;
        q = primitive(ring, &remainder).1;
    }
    let x = ring.variable(variable);
    let horner = |sum: Numerator, c: &Numerator| ring.add(&ring.mul(&sum, &x), c);
    let polynomial = p.iter().rev().fold(ring.integer(0), horner);
    monic(ring, &ring.mul(&content, &polynomial))
}

/// a/b where b divides a; `None` otherwise.
pub fn exact_quotient(ring: &Ring, a: &Numerator, b: &Numerator) -> Option<Numerator> {
    let (lead_monomial, lead) = b.terms().last()?;
    let (mut rest, mut quotient) = (a.clone(), ring.integer(0));
    while let Some((monomial, coefficient)) = rest.terms().last() {
        let mut ratio = Monomial::default();
        let variables = monomial.powers().chain(lead_monomial.powers()).map(|(v, _)| v);
        for v in variables.collect::<std::collections::BTreeSet<_>>() {
            ratio = ratio.with(v, monomial.exponent(v).checked_sub(lead_monomial.exponent(v))?);
        }
        let term = ring.term(ratio, coefficient / lead);
        rest = ring.sub(&rest, &ring.mul(&term, b));
        quotient = ring.add(&quotient, &term);
    }
    Some(quotient)
}

fn monic(ring: &Ring, a: &Numerator) -> Numerator {
    match a.terms().last() {
        Some((_, lead)) if !lead.is_one() => ring.mul(a, &ring.constant(Rational::ONE / lead)),
        _ => a.clone(),
    }
}

/// Coefficients by powers of one variable, constant first, the leading one not zero.
fn coefficients(ring: &Ring, a: &Numerator, variable: usize) -> Vec<Numerator> {
    let mut list: Vec<Numerator> = Vec::new();
    for (monomial, coefficient) in a.terms() {
        let power = usize::from(monomial.exponent(variable));
        if list.len() <= power {
            list.resize(power + 1, ring.integer(0));
        }
        list[power] = ring.add(&list[power], &ring.term(monomial.with(variable, 0), coefficient.clone()));
    }
    list
}

/// Content and primitive part of a polynomial by coefficients; the part is empty for zero.
fn primitive(ring: &Ring, list: &[Numerator]) -> (Numerator, Vec<Numerator>) {
    let content = list.iter().fold(ring.integer(0), |g, c| gcd(ring, &g, c));
    let part = list.iter().map(|c| exact_quotient(ring, c, &content).unwrap_or_else(|| c.clone())).collect();
    if ring.is_zero(&content) { (content, Vec::new()) } else { (content, part) }
}

/// A multiple of p less a multiple of q, of lower degree than q.
fn pseudo_remainder(ring: &Ring, p: &[Numerator], q: &[Numerator]) -> Vec<Numerator> {
    let mut rest = p.to_vec();
    let Some(lead) = q.last() else { return rest };
    while rest.len() >= q.len() {
        let Some(top) = rest.pop() else { break };
        let shift = rest.len() + 1 - q.len();
        rest.iter_mut().for_each(|c| *c = ring.mul(c, lead));
        for (i, c) in q[..q.len() - 1].iter().enumerate() {
            rest[i + shift] = ring.sub(&rest[i + shift], &ring.mul(&top, c));
        }
        while rest.last().is_some_and(|c| ring.is_zero(c)) {
            rest.pop();
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::super::polynomial::Square;
    use super::*;

    #[test]
    fn a_common_factor_in_two_variables_is_found_and_divides() {
        let ring = Ring::new(vec![Square::Free, Square::Free]);
        let (x, y) = (ring.variable(0), ring.variable(1));
        let n = |v| ring.integer(v);
        let factor = ring.add(&ring.mul(&x, &y), &n(2)); // xy + 2
        let a = ring.mul(&factor, &ring.sub(&x, &y));
        let b = ring.mul(&ring.mul(&factor, &factor), &ring.add(&x, &n(3)));
        let g = gcd(&ring, &a, &b);
        assert_eq!(g, factor);
        assert_eq!(exact_quotient(&ring, &a, &g).unwrap(), ring.sub(&x, &y));
        assert_eq!(gcd(&ring, &x, &y), n(1));
        assert_eq!(exact_quotient(&ring, &x, &y), None);
    }
}
