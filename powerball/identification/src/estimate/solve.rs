//! Normal equations, summed over joints and parts of logs, and their solution: they may be short of rank.

use faer::Mat;

/// The scaled Cholesky factor of a Gram matrix; columns that depend on those before them are left out.
#[derive(Clone, Debug)]
pub struct Solver {
    size: usize,
    /// Indices of the columns that are in, in order.
    kept: Vec<usize>,
    /// 1/norm by kept column.
    scale: Vec<f64>,
    /// Lower triangle by rows, kept × kept.
    lower: Vec<f64>,
}

/// A column whose part that is new is below this share of its squared length counts as dependent.
const DEPENDENT: f64 = 1e-9;

impl Solver {
    /// Factors the Gram matrix over the columns for which `wanted` holds.
    #[must_use]
    pub fn new(gram: &Mat<f64>, wanted: impl Fn(usize) -> bool) -> Solver {
        let size = gram.ncols();
        let (mut kept, mut scale, mut rows): (Vec<usize>, Vec<f64>, Vec<Vec<f64>>) = (vec![], vec![], vec![]);
        for c in (0..size).filter(|c| wanted(*c)) {
            let length = gram[(c, c)];
            if !(length > 0.0 && length.is_finite()) {
                continue;
            }
            let s = 1.0 / length.sqrt();
            let mut row = Vec::with_capacity(kept.len() + 1);
            let mut left = 1.0;
            for (i, (k, other)) in kept.iter().zip(&rows).enumerate() {
                let mut value = gram[(c, *k)] * s * scale[i];
                value -= row.iter().zip(other).map(|(a, b): (&f64, &f64)| a * b).sum::<f64>();
                value /= other[i];
                left -= value * value;
                row.push(value);
            }
            if left.is_nan() || left <= DEPENDENT {
                continue;
            }
            row.push(left.sqrt());
            kept.push(c);
            scale.push(s);
            rows.push(row);
        }
        let m = kept.len();
        let mut lower = vec![0.0; m * m];
        for (i, row) in rows.iter().enumerate() {
            lower[i * m..i * m + row.len()].copy_from_slice(row);
        }
        Solver { size, kept, scale, lower }
    }

    /// The columns that are in.
    #[must_use]
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// Solves for the kept columns; the others get 0.
    #[must_use]
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let m = self.kept.len();
        let mut x = self.whitened(right);
        for i in (0..m).rev() {
            let tail: f64 = (i + 1..m).map(|k| self.lower[k * m + i] * x[k]).sum();
            x[i] = (x[i] - tail) / self.lower[i * m + i];
        }
        let mut out = vec![0.0; self.size];
        for ((k, s), value) in self.kept.iter().zip(&self.scale).zip(x) {
            out[*k] = value * s;
        }
        out
    }

    /// The products A'c of a column with the kept ones, turned so that c'A (A'A)⁻¹ A'd of two columns is the
    /// scalar product of both results: L⁻¹ A'c.
    #[must_use]
    pub fn whitened(&self, right: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = self.kept.iter().zip(&self.scale).map(|(k, s)| right[*k] * s).collect();
        self.forward(&mut x);
        x
    }

    fn forward(&self, x: &mut [f64]) {
        let m = self.kept.len();
        for i in 0..m {
            let head: f64 = self.lower[i * m..i * m + i].iter().zip(&*x).map(|(l, v)| l * v).sum();
            x[i] = (x[i] - head) / self.lower[i * m + i];
        }
    }

    /// Diagonal of the inverse for the kept columns, infinity for the others.
    #[must_use]
    pub fn inverse_diagonal(&self) -> Vec<f64> {
        let mut out = vec![f64::INFINITY; self.size];
        for (i, k) in self.kept.iter().enumerate() {
            let mut unit = vec![0.0; self.kept.len()];
            unit[i] = 1.0;
            self.forward(&mut unit);
            out[*k] = unit.iter().map(|v| v * v).sum::<f64>() * self.scale[i] * self.scale[i];
        }
        out
    }

    /// Condition estimate of the scaled columns: the ratio of the extreme pivots.
    #[must_use]
    pub fn pivot_ratio(&self) -> f64 {
        let m = self.kept.len();
        let pivots = (0..m).map(|i| self.lower[i * m + i]);
        let (low, high) = pivots.fold((f64::MAX, 0.0f64), |(l, h), p| (l.min(p), h.max(p)));
        if m == 0 { 1.0 } else { high / low }
    }
}

// Normal equations of a linear model, summed over joints and parts of logs: what every fit is solved from.

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

/// Σ aᵢ·bᵢ in the order of the rows: standard errors of nearly dependent columns depend on the last digits of
/// these sums.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl NormalEquations {
    /// Equations without rows, for `size` coefficients.
    #[must_use]
    pub fn zero(size: usize) -> NormalEquations {
        NormalEquations { gram: Mat::zeros(size, size), right: vec![0.0; size], square: 0.0 }
    }

    /// The equations of columns and their signal.
    #[must_use]
    pub fn of(columns: &[impl AsRef<[f64]>], signal: &[f64]) -> NormalEquations {
        let places: Vec<usize> = (0..columns.len()).collect();
        let mut own = NormalEquations::zero(columns.len());
        own.add_columns(&places, columns, signal, 1.0);
        own
    }

    /// Adds columns and their signal times a weight; `places[i]` is where column i stands among all
    /// coefficients.
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

    /// Adds the equations of some of the coefficients, those at `places`, times a weight.
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

    /// Σ w·(y − A·θ)², as far as rounding lets it be distinguished from zero.
    #[must_use]
    pub fn left(&self, theta: &[f64]) -> f64 {
        let predicted = |i: usize| -> f64 { dot(self.gram.col_as_slice(i), theta) };
        let change = |(i, (x, right)): (usize, (&f64, &f64))| x * (predicted(i) - 2.0 * right);
        self.square + theta.iter().zip(&self.right).enumerate().map(change).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn dependent_columns_are_left_out_and_the_rest_solved() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(5);
        let a = Mat::<f64>::from_fn(40, 5, |_, _| rng.random_range(-1.0..1.0));
        let mut b = a.clone();
        for i in 0..40 {
            b[(i, 3)] = 2.0 * a[(i, 0)] - a[(i, 1)];
        }
        let truth = [1.0, -2.0, 0.5, 0.0, 3.0];
        let gram = b.transpose() * &b;
        let y: Vec<f64> = (0..40).map(|i| (0..5).map(|c| b[(i, c)] * truth[c]).sum()).collect();
        let right: Vec<f64> = (0..5).map(|c| (0..40).map(|i| b[(i, c)] * y[i]).sum()).collect();
        let solver = Solver::new(&gram, |_| true);
        assert_eq!(solver.kept(), [0, 1, 2, 4]);
        for (x, t) in solver.solve(&right).iter().zip(truth) {
            approx::assert_abs_diff_eq!(*x, t, epsilon = 1e-10);
        }
        assert!(solver.inverse_diagonal()[3].is_infinite());
    }
}
