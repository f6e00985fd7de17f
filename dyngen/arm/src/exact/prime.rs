//! The field of integers modulo a 61-bit prime, in which identities are proven.
//!
//! Two different polynomials of degree d agree at a random point with probability at most d/p
//! (Schwartz–Zippel), so two points already leave less than 2⁻¹⁰⁰ for any formula of an arm.

use super::algebra::{Algebra, Inverses, Roots};
use super::rational::{self, Rational};
use dashu_int::IBig;

/// 2⁶¹ − 465: prime, and ≡ 23 mod 24, so that √2 and √3 (angles that are multiples of pi/4 and pi/6) exist.
pub const P: u64 = 2_305_843_009_213_693_487;

/// An element of the field, 0 ≤ value < P.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fp(u64);

impl Fp {
    /// Zero.
    pub const ZERO: Fp = Fp(0);
    /// One.
    pub const ONE: Fp = Fp(1);

    /// The element of an integer.
    pub fn from_integer(value: i64) -> Fp {
        let magnitude = Fp(value.unsigned_abs() % P);
        if value < 0 { -magnitude } else { magnitude }
    }

    /// The element of a rational; `None` where P divides the denominator.
    pub fn from_rational(value: &Rational) -> Option<Fp> {
        let residue = |n: &IBig| {
            let p = IBig::from(P);
            let r = ((n % &p) + &p) % &p;
            u64::try_from(r).map(Fp).unwrap_or(Fp::ZERO)
        };
        Some(residue(value.numerator()) * residue(&rational::denominator(value)).inverse()?)
    }

    /// The residue itself.
    pub fn residue(self) -> u64 {
        self.0
    }

    /// self^exponent
    pub fn power(self, mut exponent: u64) -> Fp {
        let (mut base, mut result) = (self, Fp::ONE);
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = result * base;
            }
            base = base * base;
            exponent >>= 1;
        }
        result
    }

    /// 1/self; `None` for zero.
    pub fn inverse(self) -> Option<Fp> {
        (self != Fp::ZERO).then(|| self.power(P - 2))
    }

    /// A square root of a square (P ≡ 3 mod 4); `None` otherwise.
    pub fn square_root(self) -> Option<Fp> {
        let root = self.power(P.div_ceil(4));
        (root * root == self).then_some(root)
    }

    /// The sine and cosine of the angle whose half has this tangent: 2t/(1+t²), (1−t²)/(1+t²).
    pub fn circle_point(self) -> (Fp, Fp) {
        let square = self * self;
        // 1 + t² is never zero: −1 is not a square modulo a prime ≡ 3 mod 4.
        let scale = (Fp::ONE + square).inverse().unwrap_or(Fp::ONE);
        ((self + self) * scale, (Fp::ONE - square) * scale)
    }
}

impl std::ops::Add for Fp {
    type Output = Fp;
    fn add(self, other: Fp) -> Fp {
        let sum = self.0 + other.0;
        Fp(if sum >= P { sum - P } else { sum })
    }
}

impl std::ops::Sub for Fp {
    type Output = Fp;
    fn sub(self, other: Fp) -> Fp {
        self + -other
    }
}

impl std::ops::Neg for Fp {
    type Output = Fp;
    fn neg(self) -> Fp {
        Fp(if self.0 == 0 { 0 } else { P - self.0 })
    }
}

impl std::ops::Mul for Fp {
    type Output = Fp;
    fn mul(self, other: Fp) -> Fp {
        // 2⁶¹ ≡ 465, so the high part folds onto the low one twice; no 128-bit division.
        let product = u128::from(self.0) * u128::from(other.0);
        let mask = (1u128 << 61) - 1;
        let once = (product & mask) + (product >> 61) * 465;
        let twice = (once & mask) as u64 + (once >> 61) as u64 * 465;
        let folded = if twice >= P { twice - P } else { twice };
        Fp(if folded >= P { folded - P } else { folded })
    }
}

/// The seeded stream of random field elements that the proofs draw from (SplitMix64).
#[derive(Clone, Debug)]
pub struct Draws(u64);

impl Draws {
    /// A stream that its seed determines.
    pub fn new(seed: u64) -> Self {
        Draws(seed)
    }

    fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A uniform element: draws of 61 bits are rejected where they exceed P.
    pub fn element(&mut self) -> Fp {
        loop {
            let value = self.next_u64() >> 3;
            if value < P {
                return Fp(value);
            }
        }
    }
}

/// The field as an [`Algebra`].
#[derive(Clone, Copy, Debug, Default)]
pub struct PrimeField;

impl Algebra for PrimeField {
    type Value = Fp;
    fn integer(&self, value: i64) -> Fp {
        Fp::from_integer(value)
    }
    fn is_zero(&self, a: &Fp) -> bool {
        *a == Fp::ZERO
    }
    fn add(&self, a: &Fp, b: &Fp) -> Fp {
        *a + *b
    }
    fn neg(&self, a: &Fp) -> Fp {
        -*a
    }
    fn mul(&self, a: &Fp, b: &Fp) -> Fp {
        *a * *b
    }
}

impl Inverses for PrimeField {
    fn inverse(&self, a: &Fp) -> Option<Fp> {
        a.inverse()
    }
}

/// The root that is a square itself: of x and −x one is.
impl Roots for PrimeField {
    fn root(&self, a: &Fp) -> Option<Fp> {
        a.square_root()
    }
}

#[cfg(test)]
mod tests {
    use super::super::rational::parse_rational;
    use super::*;

    #[test]
    fn multiplication_agrees_with_128_bit_remainders() {
        let mut draws = Draws::new(1);
        for _ in 0..10_000 {
            let (a, b) = (draws.element(), draws.element());
            let expected = (u128::from(a.0) * u128::from(b.0) % u128::from(P)) as u64;
            assert_eq!((a * b).0, expected);
        }
        let top = Fp(P - 1);
        assert_eq!(top * top, Fp::ONE);
    }

    #[test]
    fn the_modulus_is_a_prime_with_the_roots_it_promises() {
        // Fermat to several bases; P was found by a deterministic Miller–Rabin test.
        for base in [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37] {
            assert_eq!(Fp(base).power(P - 1), Fp::ONE);
        }
        for square in [2, 3] {
            let root = Fp(square).square_root().unwrap();
            assert_eq!(root * root, Fp(square));
        }
        assert_eq!((-Fp::ONE).square_root(), None);
    }

    #[test]
    fn rationals_and_circle_points_are_exact() {
        let x = Fp::from_rational(&parse_rational("-49/400").unwrap()).unwrap();
        assert_eq!(x * Fp(400), -Fp(49));
        let mut draws = Draws::new(2);
        for _ in 0..100 {
            let (s, c) = draws.element().circle_point();
            assert_eq!(s * s + c * c, Fp::ONE);
        }
    }
}
