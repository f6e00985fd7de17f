//! Rows in octaves of time: the cost of a coloured residual can be computed afterwards.
//!
//! Neighbouring rows are turned into their sum and their difference over √2, the sums again with their
//! neighbours, and so on (Haar's transform). It is orthogonal, so the factors of all octaves together are the
//! factor of the rows; and the part of a residual in each octave is the power of its noise there,
//! whatever model is found later. Noise of robots has colour but hardly any memory between octaves, which is
//! all that standard errors need.

use super::RFactor;
use crate::regression::JointRows;
use std::f64::consts::FRAC_1_SQRT_2;

/// Octaves. At the 25 rows a second of the usual band the last one holds what is slower than 0.1 Hz.
pub const OCTAVES: usize = 8;
/// Octaves from this one on are slower than the means over one second that weights are made of.
pub const SLOW: usize = 5;

/// Binary digits of a column's length that a log's factors keep: 4e-9 of it.
const DIGITS: i32 = 28;

/// The differences and the sums of neighbours over √2; a last value without a neighbour is in neither.
#[must_use]
pub fn halved(signal: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let turned = |p: &[f64]| ((p[0] - p[1]) * FRAC_1_SQRT_2, (p[0] + p[1]) * FRAC_1_SQRT_2);
    signal.chunks_exact(2).map(turned).unzip()
}

/// One factor an octave, from fast to slow.
#[derive(Clone, Debug, PartialEq)]
pub struct Octaves {
    levels: Vec<RFactor>,
}

impl Octaves {
    /// Octaves without rows.
    #[must_use]
    pub fn new(width: usize) -> Octaves {
        Octaves { levels: vec![RFactor::new(width); OCTAVES] }
    }

    /// From the factors, fast to slow; `None` unless there are [`OCTAVES`] of one width.
    #[must_use]
    pub fn from_levels(levels: Vec<RFactor>) -> Option<Octaves> {
        let width = levels.first()?.width();
        (levels.len() == OCTAVES && levels.iter().all(|l| l.width() == width)).then_some(Octaves { levels })
    }

    /// The factors, fast to slow.
    #[must_use]
    pub fn levels(&self) -> &[RFactor] {
        &self.levels
    }

    /// Rows that went in.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.levels.iter().map(RFactor::rows).sum()
    }

    /// The factor of all rows.
    #[must_use]
    pub fn total(&self) -> RFactor {
        let mut total = RFactor::new(self.levels[0].width());
        for level in &self.levels {
            total.merge(level);
        }
        total
    }

    /// Takes in rows that follow each other in time without a gap: one slice a column.
    pub fn push(&mut self, columns: &[&[f64]]) {
        let mut sums: Vec<Vec<f64>> = columns.iter().map(|c| c.to_vec()).collect();
        let last = self.levels.len() - 1;
        for level in &mut self.levels[..last] {
            let count = sums.first().map_or(0, Vec::len);
            let differences: Vec<Vec<f64>> = sums
                .iter_mut()
                .map(|x| {
                    let (mut differences, slower) = halved(x);
                    // A row without a neighbour is not changed.
                    differences.extend_from_slice(&x[count - count % 2..]);
                    *x = slower;
                    differences
                })
                .collect();
            level.push(&differences.iter().map(Vec::as_slice).collect::<Vec<_>>());
            if count < 2 {
                return;
            }
        }
        self.levels[last].push(&sums.iter().map(Vec::as_slice).collect::<Vec<_>>());
    }

    /// Takes in a joint's rows, stretch by stretch; one vector a column.
    pub fn push_rows(&mut self, rows: &JointRows, columns: &[Vec<f64>]) {
        for run in rows.runs() {
            self.push(&columns.iter().map(|c| &c[run.clone()]).collect::<Vec<_>>());
        }
    }

    /// Rounds each column to 28 binary digits of its length over all octaves: below the resolution of any
    /// sensor, and what a file has to keep.
    pub fn round(&mut self) {
        let step = |k: usize| {
            let square: f64 = self.levels.iter().flat_map(|level| level.column(k)).map(|x| x * x).sum();
            let exponent = square.sqrt().log2().ceil();
            if exponent.is_finite() && exponent > -900.0 { 2f64.powi(exponent as i32 - DIGITS) } else { 0.0 }
        };
        let steps: Vec<f64> = (0..self.levels[0].width()).map(step).collect();
        self.levels.iter_mut().for_each(|level| level.round(&steps));
    }

    /// Rows with combinations of their columns, like [`RFactor::combined`].
    #[must_use]
    pub fn combined(&self, columns: &[Vec<(usize, f64)>]) -> Octaves {
        Octaves { levels: self.levels.iter().map(|level| level.combined(columns)).collect() }
    }

    /// Takes in what other rows gave.
    pub fn merge(&mut self, other: &Octaves) {
        for (level, other) in self.levels.iter_mut().zip(&other.levels) {
            level.merge(other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    /// Octave by octave the rows of white noise, and together the products of the rows themselves.
    #[test]
    fn octaves_are_an_orthogonal_turn_of_the_rows() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let count = 1001;
        let x: Vec<f64> = (0..count).map(|_| rng.random_range(-1.0..1.0)).collect();
        let ones = vec![1.0; count];
        let mut octaves = Octaves::new(2);
        octaves.push(&[&ones, &x]);
        assert_eq!(octaves.rows(), count as u64);
        let total = octaves.total();
        let product = |a: usize, b: usize| -> f64 {
            total.column(a).iter().zip(total.column(b)).map(|(x, y)| x * y).sum()
        };
        approx::assert_relative_eq!(product(0, 0), count as f64, max_relative = 1e-12);
        approx::assert_abs_diff_eq!(product(0, 1), x.iter().sum::<f64>(), epsilon = 1e-10);
        approx::assert_relative_eq!(
            product(1, 1),
            x.iter().map(|v| v * v).sum::<f64>(),
            max_relative = 1e-12
        );
        // A constant is in the slowest octave, but for rows without a neighbour.
        let slowest = octaves.levels()[OCTAVES - 1].column(0)[0];
        assert!(slowest * slowest > 0.85 * count as f64);
    }
}
