//! Significance between blocks of logs that count as independent: within a block a residual may have any
//! colour.

use super::base::{Base, Trial};
use crate::estimate::Solver;
use crate::estimate::distribution::f_tail;
use faer::Mat;
use powerball_logs::regression::Block;
use powerball_logs::vector::dot;

/// Fewer blocks say nothing about their spread.
const FEWEST: f64 = 4.0;

/// Probability that chance makes a sum over blocks as far from zero as `constant` plus the sum of `changes`
/// is, both ways: Student's t from the spread of the blocks. Of two models that are not nested, with the χ²
/// by which one leads in each block, it is the test of Vuong (Likelihood ratio tests for model selection and
/// non-nested hypotheses, Econometrica 1989) with blocks in the place of samples.
#[must_use]
pub fn p_of_sum(changes: &[f64], constant: f64) -> f64 {
    let n = changes.len() as f64;
    let sum = changes.iter().sum::<f64>();
    let variance = changes.iter().map(|c| (c - sum / n).powi(2)).sum::<f64>() * n / (n - 1.0);
    if n < FEWEST || variance <= 0.0 {
        return 1.0;
    }
    f_tail((sum + constant).powi(2) / variance, 1.0, n - 1.0)
}

/// Probability that chance makes coefficients as large: the Wald test with blocks as clusters (Liang and
/// Zeger, Biometrika 1986). `square` is the k × k matrix of the columns' weighted products; `scores` has for
/// each block the k weighted products of the columns with the residual that the coefficients leave. A
/// coefficient of zero is one that is not there.
#[must_use]
pub fn p_of_coefficients(theta: &[f64], square: &Mat<f64>, scores: &[Vec<f64>]) -> f64 {
    let k = theta.len();
    let clusters = scores.len() as f64;
    let used = theta.iter().filter(|t| **t != 0.0).count() as f64;
    let freedom = clusters - used;
    if freedom < FEWEST - 1.0 || used == 0.0 {
        return 1.0;
    }
    let spread = Mat::from_fn(k, k, |a, b| scores.iter().map(|s| s[a] * s[b]).sum::<f64>());
    // θ' S M⁻¹ S θ with S the columns' products and M the sum over clusters.
    let s: Vec<f64> = (0..k).map(|a| (0..k).map(|b| square[(a, b)] * theta[b]).sum()).collect();
    let solved = Solver::new(&spread, |a| theta[a] != 0.0).solve(&s);
    let wald: f64 = s.iter().zip(&solved).map(|(a, b)| a * b).sum();
    f_tail(wald / used * freedom / clusters, used, freedom)
}

/// Products of columns with each other and, block by block, with what their coefficients leave: what
/// [`p_of_coefficients`] needs.
#[derive(Debug)]
pub struct Clusters {
    /// k × k for k columns.
    square: Mat<f64>,
    scores: Vec<Vec<f64>>,
}

impl Clusters {
    /// No block, for some columns.
    #[must_use]
    pub fn new(columns: usize) -> Clusters {
        Clusters { square: Mat::zeros(columns, columns), scores: Vec::new() }
    }

    /// Adds blocks of some rows. `freed` are the columns without what the model imitates of them, by joint
    /// and column, and `left` is what is left with them, by joint and row.
    pub fn add(&mut self, blocks: &[Block], weights: &[f64], freed: &[Vec<Vec<f64>>], left: &[Vec<f64>]) {
        let k = self.square.ncols();
        for block in blocks {
            let mut score = vec![0.0; k];
            let mut touched = false;
            for (j, rows) in block.rows.iter().enumerate() {
                let w = weights[j];
                if rows.is_empty() || w == 0.0 {
                    continue;
                }
                for a in 0..k {
                    let own = &freed[j][a][rows.clone()];
                    score[a] += w * dot(own, &left[j][rows.clone()]);
                    for b in 0..=a {
                        let product = w * dot(own, &freed[j][b][rows.clone()]);
                        self.square[(a, b)] += product;
                        if a != b {
                            self.square[(b, a)] += product;
                        }
                    }
                }
                touched = true;
            }
            if touched {
                self.scores.push(score);
            }
        }
    }

    /// The probability of such coefficients by chance.
    #[must_use]
    pub fn p_value(&self, theta: &[f64]) -> f64 {
        p_of_coefficients(theta, &self.square, &self.scores)
    }
}

impl Base<'_> {
    /// The probability of a trial's coefficients by chance, between blocks.
    #[must_use]
    pub fn p_value(&self, trial: &Trial, blocks: &[Block]) -> f64 {
        let mut clusters = Clusters::new(trial.columns.len());
        clusters.add(blocks, self.weights, &self.freed(trial), &self.left(trial));
        clusters.p_value(&trial.theta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform on −½ … ½ by a linear congruential generator.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        }
    }

    #[test]
    fn a_sum_is_judged_as_by_students_t() {
        // By numerical integration of the density at t = 2.6399 with five degrees of freedom.
        let changes = [1.2, -0.3, 0.8, 2.1, 0.4, 1.0];
        approx::assert_relative_eq!(p_of_sum(&changes, 0.0), 0.045_981_722_96, max_relative = 1e-8);
        assert!(p_of_sum(&changes, 2.0) < p_of_sum(&changes, 0.0));
        assert_eq!(p_of_sum(&changes[..3], 0.0), 1.0, "three blocks have no spread to rely on");
        assert_eq!(p_of_sum(&[1.0; 8], 0.0), 1.0, "equal blocks are no sample");
    }

    /// Under the null each level is exceeded as often as it says, with residuals that are alike within a
    /// block.
    #[test]
    fn coefficients_of_noise_are_significant_as_often_as_stated() {
        const BLOCKS: usize = 40;
        const ROWS: usize = 10;
        let mut next = noise(7);
        let mut below = [0usize; 2];
        let runs = 4000;
        for _ in 0..runs {
            let mut square = Mat::<f64>::zeros(2, 2);
            let mut right = [0.0; 2];
            let blocks: Vec<([f64; 2], f64)> =
                (0..BLOCKS).map(|_| ([next(), next()], next() + next() + next())).collect();
            // Within a block all rows are the same, so that rows alone would count ten times too much.
            for (x, y) in &blocks {
                for a in 0..2 {
                    right[a] += ROWS as f64 * x[a] * y;
                    (0..2).for_each(|b| square[(a, b)] += ROWS as f64 * x[a] * x[b]);
                }
            }
            let theta = Solver::new(&square, |_| true).solve(&right);
            let score = |(x, y): &([f64; 2], f64)| -> Vec<f64> {
                let left = y - x[0] * theta[0] - x[1] * theta[1];
                x.iter().map(|x| ROWS as f64 * x * left).collect()
            };
            let scores: Vec<Vec<f64>> = blocks.iter().map(score).collect();
            let p = p_of_coefficients(&theta, &square, &scores);
            below[0] += usize::from(p < 0.05);
            below[1] += usize::from(p < 0.5);
        }
        let share = below.map(|count| count as f64 / f64::from(runs));
        assert!((0.03..0.08).contains(&share[0]) && (0.45..0.58).contains(&share[1]), "{share:?}");
    }
}
