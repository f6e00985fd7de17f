//! Forward dynamics: q̈ = B⁻¹(τ − C·q̇ − g).

use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// Solves B·x = r for a symmetric matrix by B = L·D·Lᵀ; B positive definite keeps every division defined.
pub fn solve_symmetric(b: &Builder, matrix: &[Expr], right: &[Expr]) -> Vec<Expr> {
    let n = right.len();
    let mut lower = vec![Expr::ZERO; n * n];
    let mut diagonal = vec![Expr::ZERO; n];
    // From the last joint inwards, as a composite recursion would: the outer joints couple to fewer others.
    for i in (0..n).rev() {
        let mut d = matrix[i * n + i];
        for k in i + 1..n {
            d = b.sub(&d, &b.mul(&b.mul(&lower[k * n + i], &lower[k * n + i]), &diagonal[k]));
        }
        diagonal[i] = d;
        for j in (0..i).rev() {
            let mut sum = matrix[i * n + j];
            for k in i + 1..n {
                sum = b.sub(&sum, &b.mul(&b.mul(&lower[k * n + i], &lower[k * n + j]), &diagonal[k]));
            }
            lower[i * n + j] = b.div(sum, d);
        }
    }
    // B = Lᵀ·D·L with unit lower-triangular L: first Lᵀ y = r from the last, then D, then L x = z from the first.
    let mut x = right.to_vec();
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] = b.sub(&x[i], &b.mul(&lower[k * n + i], &x[k]));
        }
    }
    for i in 0..n {
        x[i] = b.div(x[i], diagonal[i]);
    }
    for i in 0..n {
        for k in 0..i {
            x[i] = b.sub(&x[i], &b.mul(&lower[i * n + k], &x[k]));
        }
    }
    x
}
