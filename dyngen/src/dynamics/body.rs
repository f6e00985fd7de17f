//! Vectors and constants as expressions.

use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField, Factors};
use crate::graph::{Builder, Expr};

/// A vector's components.
pub type Vector = [Expr; 3];

/// The zero vector.
pub const ZERO: Vector = [Expr::ZERO; 3];

/// A constant of the arm as an expression.
pub fn constant(b: &Builder, field: &ConstantField, value: &Constant) -> Expr {
    let sum = |parts: Vec<Factors>| {
        parts.into_iter().fold(Expr::ZERO, |total, (coefficient, powers)| {
            let mut term = b.constant(&coefficient);
            for (index, sine, exponent) in powers {
                for _ in 0..exponent {
                    term = b.mul(&term, &b.symbol(index, sine));
                }
            }
            b.add(&total, &term)
        })
    };
    let (numerator, denominator) = field.factors(value);
    b.div(sum(numerator), sum(denominator))
}
