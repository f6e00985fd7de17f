//! Exact arithmetic: rationals, polynomials with s² + c² = 1, elimination, a 61-bit prime field.

pub mod rational;
