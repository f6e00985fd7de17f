//! Normal equations of a linear model, summed over joints and parts of logs: what every fit is solved from.

use super::solve::{Solver, bounded};
use faer::Mat;

/// Σ w·A'A, Σ w·A'y and Σ w·y'y of some rows.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// A'A.
    pub gram: Mat<f64>,
    /// A'y.
    pub right: Vec<f64>,
    /// y'y.
    pub square: f64,
}

/// Σ aᵢ·bᵢ in the order of the rows: standard errors of nearly dependent columns hang on the last digits of
/// these sums.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl NormalEquations {
    /// Of no row yet, for so many coefficients.
    #[must_use]
    pub fn zero(size: usize) -> NormalEquations {
        NormalEquations { gram: Mat::zeros(size, size), right: vec![0.0; size], square: 0.0 }
    }

    /// Of columns and their signal.
    #[must_use]
    pub fn of(columns: &[impl AsRef<[f64]>], signal: &[f64]) -> NormalEquations {
        let places: Vec<usize> = (0..columns.len()).collect();
        let mut own = NormalEquations::zero(columns.len());
        own.add_columns(&places, columns, signal, 1.0);
        own
    }

    /// Adds columns and their signal times a weight; `places[i]` is where column i stands among all coefficients.
    pub fn add_columns(
        &mut self,
        places: &[usize],
        columns: &[impl AsRef<[f64]>],
        signal: &[f64],
        weight: f64,
    ) {
        for (i, (column, at)) in columns.iter().zip(places).enumerate() {
            let column = column.as_ref();
            for (other, to) in columns.iter().zip(places).take(i + 1) {
                let value = weight * dot(column, other.as_ref());
                self.gram[(*at, *to)] += value;
                if at != to {
                    self.gram[(*to, *at)] += value;
                }
            }
            self.right[*at] += weight * dot(column, signal);
        }
        self.square += weight * dot(signal, signal);
    }

    /// Adds those of some of the coefficients, which stand at `places`, times a weight.
    pub fn add(&mut self, places: &[usize], other: &NormalEquations, weight: f64) {
        for (i, at) in places.iter().enumerate() {
            for (k, to) in places.iter().enumerate() {
                self.gram[(*to, *at)] += weight * other.gram[(k, i)];
            }
            self.right[*at] += weight * other.right[i];
        }
        self.square += weight * other.square;
    }

    /// Factored over the columns for which `wanted` holds.
    #[must_use]
    pub fn solver(&self, wanted: impl Fn(usize) -> bool) -> Solver {
        Solver::new(&self.gram, wanted)
    }

    /// The least-squares coefficients; 0 where nothing determines one.
    #[must_use]
    pub fn solve(&self) -> Vec<f64> {
        self.solver(|_| true).solve(&self.right)
    }

    /// The same over the columns for which `wanted` holds, with some coefficients ≥ 0 (see [`bounded`]).
    #[must_use]
    pub fn solve_bounded(
        &self,
        wanted: impl Fn(usize) -> bool,
        non_negative: &[usize],
    ) -> (Vec<f64>, Solver) {
        bounded(&self.gram, &self.right, wanted, non_negative)
    }

    /// Σ w·(y − A·θ)², as far as rounding lets it be told from zero.
    #[must_use]
    pub fn left(&self, theta: &[f64]) -> f64 {
        let predicted = |i: usize| -> f64 { dot(self.gram.col_as_slice(i), theta) };
        let change = |(i, (x, right)): (usize, (&f64, &f64))| x * (predicted(i) - 2.0 * right);
        self.square + theta.iter().zip(&self.right).enumerate().map(change).sum::<f64>()
    }
}
