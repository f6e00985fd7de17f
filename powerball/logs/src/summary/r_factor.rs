//! Rows of any number as one triangular factor: RᵀR = Σ rowᵀ·row.
//!
//! A block of rows goes into the factor by Householder reflections that leave its triangle a triangle (Golub
//! and Van Loan, §12.5, "updating"; Demmel et al. 2012, "tall-skinny QR"). The factor of several factors is
//! the factor of all their rows, so parts of a log, logs and machines can be joined in any order; the squares
//! of numbers are never summed, which would cost half of their digits.

use pulp::{Arch, NullaryFnOnce};

/// An upper triangular factor of rows of a fixed width.
#[derive(Clone, Debug, PartialEq)]
pub struct RFactor {
    width: usize,
    /// By column, each as long as the factor is wide, zero below the diagonal.
    columns: Vec<f64>,
    rows: u64,
}

/// Rows that are reflected together: a block of seventy columns stays in a second-level cache.
const BLOCK: usize = 256;

impl RFactor {
    /// The factor of no rows.
    #[must_use]
    pub fn new(width: usize) -> RFactor {
        RFactor { width, columns: vec![0.0; width * width], rows: 0 }
    }

    /// From its upper factor by rows, as [`RFactor::packed`] gives it; `None` where the length does not
    /// fit.
    #[must_use]
    pub fn from_packed(width: usize, packed: &[f64], rows: u64) -> Option<RFactor> {
        if packed.len() != RFactor::packed_len(width) {
            return None;
        }
        let mut factor = RFactor { rows, ..RFactor::new(width) };
        let places = (0..width).flat_map(|row| (row..width).map(move |column| column * width + row));
        places.zip(packed).for_each(|(place, value)| factor.columns[place] = *value);
        Some(factor)
    }

    /// The upper triangle by rows.
    #[must_use]
    pub fn packed(&self) -> Vec<f64> {
        (0..self.width)
            .flat_map(|row| (row..self.width).map(move |column| self.column(column)[row]))
            .collect()
    }

    /// Rounds each column to multiples of its step; a step of 0 does not change it.
    pub fn round(&mut self, steps: &[f64]) {
        for (column, step) in self.columns.chunks_exact_mut(self.width.max(1)).zip(steps) {
            if *step > 0.0 {
                // Adding 0 makes −0 a plain zero.
                column.iter_mut().for_each(|x| *x = (*x / step).round() * step + 0.0);
            }
        }
    }

    /// Numbers in [`RFactor::packed`].
    #[must_use]
    pub fn packed_len(width: usize) -> usize {
        width * (width + 1) / 2
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows that went in.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// A column, as long as the factor is wide.
    #[must_use]
    pub fn column(&self, k: usize) -> &[f64] {
        &self.columns[k * self.width..(k + 1) * self.width]
    }

    /// Takes rows in: one slice a column, all of one length.
    pub fn push(&mut self, columns: &[&[f64]]) {
        debug_assert_eq!(columns.len(), self.width);
        let count = columns.first().map_or(0, |c| c.len());
        let mut block = Vec::with_capacity(self.width * BLOCK.min(count));
        for first in (0..count).step_by(BLOCK) {
            let range = first..(first + BLOCK).min(count);
            block.clear();
            for column in columns {
                block.extend_from_slice(&column[range.clone()]);
            }
            self.push_block(&mut block, range.len());
        }
    }

    /// Adds a block of `count` rows, column by column; the block is overwritten.
    pub fn push_block(&mut self, block: &mut [f64], count: usize) {
        self.rows += count as u64;
        self.reflect(block, count);
    }

    /// Takes another factor's rows in.
    pub fn merge(&mut self, other: &RFactor) {
        debug_assert_eq!(self.width, other.width);
        if self.rows == 0 {
            // To the bit: a summary that was written and read again is the same.
            self.clone_from(other);
            return;
        }
        let mut block = other.columns.clone();
        self.rows += other.rows;
        self.reflect(&mut block, other.width);
    }

    /// The factor of rows whose columns are combinations of this one's: each a sum of columns with factors.
    #[must_use]
    pub fn combined(&self, columns: &[Vec<(usize, f64)>]) -> RFactor {
        let mut combined = RFactor::new(columns.len());
        let mut block = vec![0.0; self.width * columns.len()];
        for (to, sum) in block.chunks_exact_mut(self.width.max(1)).zip(columns) {
            for (k, factor) in sum {
                to.iter_mut().zip(self.column(*k)).for_each(|(x, c)| *x += factor * c);
            }
        }
        combined.reflect(&mut block, self.width);
        combined.rows = self.rows;
        combined
    }

    fn reflect(&mut self, block: &mut [f64], count: usize) {
        if count > 0 {
            // Compiled for what the processor has; the same sums in the same order everywhere.
            Arch::new().dispatch(Reflect { width: self.width, columns: &mut self.columns, block, count });
        }
    }
}

/// Householder's reflections of a block of rows into a triangle.
struct Reflect<'a> {
    width: usize,
    columns: &'a mut [f64],
    block: &'a mut [f64],
    count: usize,
}

impl NullaryFnOnce for Reflect<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Reflect { width, columns, block, count } = self;
        for k in 0..width {
            let (head, tail) = block.split_at_mut((k + 1) * count);
            let below = &head[k * count..];
            let [square] = dots(below, [below]);
            // Nothing, or so little that its square has lost its digits.
            if square < 1e-290 {
                continue;
            }
            let pivot = columns[k * width + k];
            let length = (pivot * pivot + square).sqrt();
            // Away from cancellation: the reflected pivot has the other sign.
            let reflected = if pivot > 0.0 { -length } else { length };
            let lead = pivot - reflected;
            let scale = 1.0 / (length * (length + pivot.abs()));
            columns[k * width + k] = reflected;
            let mut share = |j: usize, along: f64| {
                let top = &mut columns[j * width + k];
                let share = scale * (lead * *top + along);
                *top -= share * lead;
                share
            };
            let mut j = k + 1;
            // Four columns at a time share the loads of the one that is reflected.
            let mut fours = tail.chunks_exact_mut(4 * count);
            for four in &mut fours {
                let (a, rest) = four.split_at_mut(count);
                let (b, rest) = rest.split_at_mut(count);
                let (c, d) = rest.split_at_mut(count);
                let along = dots(below, [a, b, c, d]);
                let shares: [f64; 4] = std::array::from_fn(|i| share(j + i, along[i]));
                for i in 0..count {
                    let v = below[i];
                    a[i] -= shares[0] * v;
                    b[i] -= shares[1] * v;
                    c[i] -= shares[2] * v;
                    d[i] -= shares[3] * v;
                }
                j += 4;
            }
            for column in fours.into_remainder().chunks_exact_mut(count) {
                let [along] = dots(below, [column]);
                let share = share(j, along);
                column.iter_mut().zip(below).for_each(|(c, v)| *c -= share * v);
                j += 1;
            }
        }
    }
}

/// Scalar products of one column with some others, each in eight sums, so that the processor's vector units
/// can be used; the order is fixed.
#[inline(always)]
fn dots<const N: usize>(v: &[f64], others: [&[f64]; N]) -> [f64; N] {
    let mut sums = [[0.0; 8]; N];
    let whole = v.len() / 8 * 8;
    for first in (0..whole).step_by(8) {
        let x = &v[first..first + 8];
        for (sum, other) in sums.iter_mut().zip(&others) {
            let y = &other[first..first + 8];
            for i in 0..8 {
                sum[i] += x[i] * y[i];
            }
        }
    }
    std::array::from_fn(|n| {
        let tail: f64 = v[whole..].iter().zip(&others[n][whole..]).map(|(x, y)| x * y).sum();
        sums[n].iter().sum::<f64>() + tail
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    fn rows(count: usize, width: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..width).map(|_| (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()).collect()
    }

    fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
        columns.iter().map(Vec::as_slice).collect()
    }

    fn products(t: &RFactor) -> Vec<f64> {
        let w = t.width();
        (0..w * w).map(|i| dots(t.column(i / w), [t.column(i % w)])[0]).collect()
    }

    #[test]
    fn the_factor_has_the_rows_products_however_they_came_in() {
        let (count, width) = (1000, 7);
        let all = rows(count, width, 1);
        let mut whole = RFactor::new(width);
        whole.push(&slices(&all));
        let mut joined = RFactor::new(width);
        for (from, to) in [(700, 1000), (0, 3), (3, 700)] {
            let mut part = RFactor::new(width);
            part.push(&all.iter().map(|c| &c[from..to]).collect::<Vec<_>>());
            let part = RFactor::from_packed(width, &part.packed(), part.rows()).unwrap();
            joined.merge(&part);
        }
        assert_eq!((whole.rows(), joined.rows()), (1000, 1000));
        for (k, (a, b)) in products(&whole).iter().zip(products(&joined)).enumerate() {
            let direct: f64 = all[k / width].iter().zip(&all[k % width]).map(|(x, y)| x * y).sum();
            approx::assert_abs_diff_eq!(*a, direct, epsilon = 1e-11);
            approx::assert_abs_diff_eq!(b, direct, epsilon = 1e-11);
        }
        for k in 0..width {
            assert!(whole.column(k)[k + 1..].iter().all(|x| *x == 0.0));
        }
    }

    /// Combined columns have the products of the rows' combinations.
    #[test]
    fn columns_are_combined_as_their_rows() {
        let all = rows(90, 4, 5);
        let mut t = RFactor::new(4);
        t.push(&slices(&all));
        let sums = [vec![(3, 1.0)], vec![], vec![(0, 2.0), (2, -1.0)], vec![(1, 1.0)], vec![(2, 0.5)]];
        let made: Vec<Vec<f64>> = sums
            .iter()
            .map(|sum| (0..90).map(|r| sum.iter().map(|(k, f)| f * all[*k][r]).sum()).collect())
            .collect();
        let combined = t.combined(&sums);
        assert_eq!((combined.width(), combined.rows()), (5, 90));
        for (k, product) in products(&combined).iter().enumerate() {
            let direct: f64 = made[k / 5].iter().zip(&made[k % 5]).map(|(x, y)| x * y).sum();
            approx::assert_abs_diff_eq!(*product, direct, epsilon = 1e-11);
        }
    }

    /// Läuchli's matrix: the products of its columns lose the difference between them, the factor keeps it.
    #[test]
    fn what_products_would_lose_is_kept() {
        let small = 1e-9;
        let columns = [vec![1.0, small, 0.0], vec![1.0, 0.0, small]];
        let mut t = RFactor::new(2);
        t.push(&slices(&columns));
        approx::assert_relative_eq!(t.column(1)[1].abs(), 2f64.sqrt() * small, max_relative = 1e-6);
    }

    /// Where rows are fewer than columns, what is left of the columns is rounding of rounding.
    #[test]
    fn fewer_rows_than_columns_stay_finite() {
        let mut t = RFactor::new(40);
        let all: Vec<Vec<f64>> =
            rows(3, 40, 3).into_iter().map(|c| c.iter().map(|x| x * 1e-150).collect()).collect();
        for _ in 0..30 {
            t.push(&slices(&all));
        }
        assert!(t.packed().iter().all(|x| x.is_finite()));
    }

    /// Three rows have three dimensions: rounded, the factor has three rows, and the same products.
    #[test]
    fn rounding_is_no_row_of_the_factor() {
        let all = rows(3, 40, 9);
        let mut t = RFactor::new(40);
        t.push(&slices(&all));
        let before = products(&t);
        let step = 2f64.powi(-40);
        t.round(&[step; 40]);
        assert!((3..40).all(|row| (row..40).all(|k| t.column(k)[row] == 0.0)));
        assert!(t.packed().iter().all(|x| (x / step).fract() == 0.0));
        for (a, b) in before.iter().zip(products(&t)) {
            approx::assert_abs_diff_eq!(*a, b, epsilon = 20.0 * step);
        }
    }

    #[test]
    fn columns_of_zeros_stay_and_lengths_are_checked() {
        let mut all = rows(50, 4, 2);
        all[2].fill(0.0);
        let mut t = RFactor::new(4);
        t.push(&slices(&all));
        assert!(t.column(2).iter().all(|x| *x == 0.0));
        assert!(RFactor::from_packed(4, &[0.0; 9], 0).is_none());
    }
}
