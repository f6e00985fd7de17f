//! Forward dynamics: q̈ = B⁻¹(τ − C·q̇ − g).

use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// Solves B·x = r for a symmetric matrix; B positive definite keeps every division defined.
pub fn solve_symmetric(b: &Builder, matrix: &[Expr], right: &[Expr]) -> Vec<Expr> {
    Factors::of(b, matrix, right.len()).solve(b, right)
}

/// Like [`solve_symmetric`], for several right-hand sides.
pub fn solve_symmetric_each(b: &Builder, matrix: &[Expr], n: usize, right: &[&[Expr]]) -> Vec<Vec<Expr>> {
    let factors = Factors::of(b, matrix, n);
    right.iter().map(|right| factors.solve(b, right)).collect()
}

/// B⁻¹, row-major n × n.
pub fn inverse_symmetric(b: &Builder, matrix: &[Expr], n: usize) -> Vec<Expr> {
    let factors = Factors::of(b, matrix, n);
    let mut inverse = vec![Expr::ZERO; n * n];
    for j in 0..n {
        let unit: Vec<Expr> = (0..n).map(|i| if i == j { Expr::ONE } else { Expr::ZERO }).collect();
        let column = factors.solve(b, &unit);
        // One triangle is computed, the other is its mirror.
        for i in 0..=j {
            inverse[i * n + j] = column[i];
            inverse[j * n + i] = column[i];
        }
    }
    inverse
}

/// B = Lᵀ·D·L with unit lower triangular L, from the last joint inwards as a composite recursion would go.
struct Factors {
    n: usize,
    lower: Vec<Expr>,
    /// 1/D
    inverse: Vec<Expr>,
}

impl Factors {
    fn of(b: &Builder, matrix: &[Expr], n: usize) -> Factors {
        let mut lower = vec![Expr::ZERO; n * n];
        // L before the division by D, so that each term of a sum is one product.
        let mut scaled = vec![Expr::ZERO; n * n];
        let mut inverse = vec![Expr::ZERO; n];
        for i in (0..n).rev() {
            let mut d = matrix[i * n + i];
            for k in i + 1..n {
                d = b.sub(&d, &b.mul(&lower[k * n + i], &scaled[k * n + i]));
            }
            inverse[i] = b.div(Expr::ONE, d);
            for j in (0..i).rev() {
                let mut sum = matrix[i * n + j];
                for k in i + 1..n {
                    sum = b.sub(&sum, &b.mul(&lower[k * n + i], &scaled[k * n + j]));
                }
                scaled[i * n + j] = sum;
                lower[i * n + j] = b.mul(&sum, &inverse[i]);
            }
        }
        Factors { n, lower, inverse }
    }

    /// First Lᵀ y = r from the last joint, then D, then L x = z from the first.
    fn solve(&self, b: &Builder, right: &[Expr]) -> Vec<Expr> {
        let n = self.n;
        let mut x = right.to_vec();
        for i in (0..n).rev() {
            for k in i + 1..n {
                x[i] = b.sub(&x[i], &b.mul(&self.lower[k * n + i], &x[k]));
            }
        }
        for i in 0..n {
            x[i] = b.mul(&x[i], &self.inverse[i]);
        }
        for i in 0..n {
            for k in 0..i {
                x[i] = b.sub(&x[i], &b.mul(&self.lower[i * n + k], &x[k]));
            }
        }
        x
    }
}
