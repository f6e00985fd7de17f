//! The motion of a frame under forces on it (Khatib 1987).

use super::forward;
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// The effect of a wrench on the tool's frame.
pub(super) struct Task {
    /// B⁻¹·Jᵀ, n × 6.
    accelerations: Vec<Expr>,
    /// Λ⁻¹ = J·B⁻¹·Jᵀ, 6 × 6.
    pub(super) inertia_inverse: Vec<Expr>,
}

impl Task {
    /// From B and J, row-major.
    pub(super) fn new(b: &Builder, mass_matrix: &[Expr], jacobian: &[Expr], n: usize) -> Task {
        let rows: Vec<&[Expr]> = jacobian.chunks(n).collect();
        let columns = forward::solve_symmetric_each(b, mass_matrix, n, &rows);
        let inertia_inverse = (0..36)
            .map(|k| {
                // One triangle is computed, the other is its mirror.
                let (i, j) = ((k / 6).min(k % 6), (k / 6).max(k % 6));
                sum_of_products(b, rows[i], &columns[j])
            })
            .collect();
        Task { accelerations: (0..6 * n).map(|k| columns[k % 6][k / 6]).collect(), inertia_inverse }
    }

    /// J̄ = B⁻¹·Jᵀ·Λ
    pub(super) fn consistent_inverse(&self, b: &Builder) -> Vec<Expr> {
        // Λ is symmetric: its rows are its columns.
        let inertia = forward::inverse_symmetric(b, &self.inertia_inverse, 6);
        let rows = self.accelerations.chunks(6);
        rows.flat_map(|row| inertia.chunks(6).map(|column| sum_of_products(b, row, column))).collect()
    }
}

/// Σ xᵢ·yᵢ
pub(super) fn sum_of_products(b: &Builder, x: &[Expr], y: &[Expr]) -> Expr {
    x.iter().zip(y).fold(Expr::ZERO, |sum, (x, y)| b.add(&sum, &b.mul(x, y)))
}
