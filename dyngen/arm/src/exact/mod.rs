//! Exact arithmetic: rationals, polynomials with s² + c² = 1, elimination, a 61-bit prime field.

pub mod algebra;
pub mod angle;
pub mod constant;
pub mod dual;
pub mod elimination;
pub mod gcd;
pub mod jet;
pub mod polynomial;
pub mod prime;
pub mod rational;
pub mod symbols;
