//! Cross products of a few columns with the base by stretch of time: any window is then a sum. What a known
//! torque explains of a stretch.

use super::Context;
use crate::identification::estimate::Solver;
use crate::logs::regression::{Block, Column};
use crate::logs::vector::dot;
use faer::Mat;

/// Weighted cross products of k columns over some rows.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    k: usize,
    /// L⁻¹ A'C, L the base's factor: by column of C (see [`Solver::whitened`]). It is linear in the rows, so that a
    /// window costs no solve.
    cross: Vec<Vec<f64>>,
    /// C'C, k × k.
    square: Vec<f64>,
    /// C'r.
    score: Vec<f64>,
}

impl Sums {
    pub(super) fn zero(base: &Solver, k: usize) -> Sums {
        Sums {
            k,
            cross: vec![vec![0.0; base.kept().len()]; k],
            square: vec![0.0; k * k],
            score: vec![0.0; k],
        }
    }

    /// The sums over one block.
    pub(super) fn of_block(context: &Context<'_>, base: &Solver, columns: &[Column], block: &Block) -> Sums {
        let (fit, k) = (context.fit, columns.len());
        let mut sums = Sums::zero(base, k);
        let mut cross = vec![vec![0.0; fit.design.size]; k];
        for (j, rows) in block.rows.iter().enumerate() {
            let w = fit.weights[j];
            let parts: Vec<&[f64]> = columns.iter().filter_map(|c| c.at(j)).collect();
            if rows.is_empty() || w == 0.0 || parts.len() < k {
                continue;
            }
            for (g, values) in fit.design.cross(j, rows, &parts) {
                for c in 0..k {
                    cross[c][g] += w * values[c];
                }
            }
            let over = |a: &[f64], b: &[f64]| dot(&a[rows.clone()], &b[rows.clone()]);
            for a in 0..k {
                for b in 0..k {
                    sums.square[a * k + b] += w * over(parts[a], parts[b]);
                }
                sums.score[a] += w * over(parts[a], &context.residual[j]);
            }
        }
        sums.cross = cross.iter().map(|c| base.whitened(c)).collect();
        sums
    }

    pub(super) fn add(&mut self, other: &Sums, sign: f64) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += sign * f);
        self.cross.iter_mut().zip(&other.cross).for_each(|(to, from)| add(to, from));
        add(&mut self.square, &other.square);
        add(&mut self.score, &other.score);
    }

    /// χ² that the columns explain over these rows with the base refitted, and their coefficients.
    pub(super) fn gain(&self) -> (f64, Vec<f64>) {
        let k = self.k;
        let mut gram = Mat::zeros(k, k);
        for i in 0..k {
            for c in 0..k {
                let shared = dot(&self.cross[i], &self.cross[c]);
                gram[(i, c)] = self.square[i * k + c] - shared;
            }
        }
        // What the base takes over almost wholly says nothing.
        let solver = Solver::new(&gram, |i| gram[(i, i)] > 1e-6 * self.square[i * k + i]);
        let x = solver.solve(&self.score);
        (dot(&x, &self.score), x)
    }
}

/// How much less of χ² stays of a residual without the torque of some columns, and the χ² of that torque
/// itself: by block.
pub(super) fn explained(
    context: &Context<'_>,
    columns: &[Column],
    c: &[f64],
    blocks: &[Block],
) -> Vec<(f64, f64)> {
    let mut of = vec![(0.0, 0.0); blocks.len()];
    for (j, residual) in context.residual.iter().enumerate() {
        let mut torque = vec![0.0; residual.len()];
        for (column, c) in columns.iter().zip(c) {
            for (t, v) in torque.iter_mut().zip(column.at(j).unwrap_or_default()) {
                *t += c * v;
            }
        }
        let w = context.fit.weights[j];
        for (block, (less, own)) in blocks.iter().zip(&mut of) {
            for (t, r) in torque[block.rows[j].clone()].iter().zip(&residual[block.rows[j].clone()]) {
                *less += w * t * (2.0 * r - t);
                *own += w * t * t;
            }
        }
    }
    of
}
