//! Ratio and friction of a transmission from products of columns, with standard errors.
//!
//! Both torques are measured. Noise of the motor's torque, and the error of the law, are on the left side of
//! the equation and cause no bias. Noise of the link's torque stands in a column and would draw k towards
//! zero. Its variance is known: it is seen above the band and between neighbouring samples. What it adds to
//! the column's square is taken off (the corrected least squares of Fuller, *Measurement error models*, 1987,
//! section 2.2). Total least squares would need the ratio of both noises, and would treat the error of the
//! law as noise.

use super::products::{Column, Evidence, Products};
use super::search::Candidate;
use crate::estimate::NormalEquations;

/// The law of a transmission with its coefficients.
#[derive(Clone, Debug)]
pub(super) struct FittedLaw {
    /// The link's torque, the acceleration, the velocity, the constant and Coulomb friction; then what was
    /// added.
    pub columns: Vec<Column>,
    /// In the motor's unit, the first one positive.
    pub theta: Vec<f64>,
    /// Which width.
    pub width: usize,
    /// The effects that were added.
    pub effects: Vec<Candidate>,
    /// 1, or −1 where the motor counts against the link.
    sign: f64,
    /// Sum of squares of its residual, less the part that noise of the link adds.
    cost: f64,
}

/// The normal equations without the noise of the link's torque; the motor's torque times a sign.
fn normal(products: &Products, columns: &[Column], noise: f64, sign: f64) -> NormalEquations {
    let mut normal = products.normal(columns, sign);
    normal.gram[(0, 0)] -= noise * products.rows;
    normal
}

impl FittedLaw {
    /// Chooses the width, and those of `options` in addition to the `fixed` ones, with the smallest residual.
    pub(super) fn best(
        products: &Products,
        noise: f64,
        fixed: &[Candidate],
        options: &[Candidate],
    ) -> Option<FittedLaw> {
        let middle = columns(Column::WIDTHS / 2, &[]);
        let sign = if normal(products, &middle, noise, 1.0).solve()[0] < 0.0 { -1.0 } else { 1.0 };
        let lists: Vec<Vec<Candidate>> = match options {
            [] => vec![fixed.to_vec()],
            options => options.iter().map(|o| fixed.iter().copied().chain([*o]).collect()).collect(),
        };
        let widths = 0..Column::WIDTHS;
        let fits = lists.iter().flat_map(|effects| {
            widths.clone().map(|width| FittedLaw::new(products, noise, sign, width, effects.clone()))
        });
        fits.filter(|fit| fit.cost.is_finite()).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn new(products: &Products, noise: f64, sign: f64, width: usize, effects: Vec<Candidate>) -> FittedLaw {
        let columns = columns(width, &effects);
        let normal = normal(products, &columns, noise, sign);
        let bounds: Vec<usize> = (0..columns.len()).filter(|c| columns[*c].is_non_negative()).collect();
        let (theta, _) = normal.solve_bounded(|_| true, &bounds);
        let cost = normal.left(&theta);
        FittedLaw { columns, theta, width, effects, sign, cost }
    }

    /// k.
    pub(super) fn ratio(&self) -> f64 {
        self.sign * self.theta[0]
    }

    /// A coefficient at the link.
    pub(super) fn at_link(&self, place: usize) -> f64 {
        self.theta[place] / self.theta[0]
    }

    /// The coefficient at the link of an effect.
    pub(super) fn effect(&self, which: usize) -> f64 {
        self.at_link(self.columns.len() - self.effects.len() + which)
    }

    /// Sum of squares of its residual on some rows.
    pub(super) fn left(&self, products: &Products) -> f64 {
        products.normal(&self.columns, self.sign).left(&self.theta)
    }

    /// Standard errors of the coefficients, from blocks that count as independent; infinite where a
    /// coefficient is at its bound.
    pub(super) fn standard_errors(&self, evidence: &Evidence, wanted: impl Fn(usize) -> bool) -> Vec<f64> {
        let used: Vec<&Products> =
            evidence.blocks.iter().filter(|b| wanted(b.part)).map(|b| &b.products).collect();
        let all = Products::sum(used.iter().copied());
        let free = |c: usize| !self.columns[c].is_non_negative() || self.theta[c] > 0.0;
        let solver = normal(&all, &self.columns, evidence.noise, self.sign).solver(free);
        let size = self.columns.len();
        let rows: Vec<Vec<f64>> = (0..size)
            .map(|c| solver.solve(&(0..size).map(|k| f64::from(u8::from(k == c))).collect::<Vec<_>>()))
            .collect();
        let mut variance = vec![0.0; size];
        for products in &used {
            let NormalEquations { gram, right, .. } =
                normal(products, &self.columns, evidence.noise, self.sign);
            let score: Vec<f64> = (0..size)
                .map(|r| right[r] - (0..size).map(|c| gram[(r, c)] * self.theta[c]).sum::<f64>())
                .collect();
            for (sum, row) in variance.iter_mut().zip(&rows) {
                *sum += row.iter().zip(&score).map(|(a, b)| a * b).sum::<f64>().powi(2);
            }
        }
        let count = used.len() as f64;
        let std = |(c, sum): (usize, f64)| match solver.kept().contains(&c) {
            true => (sum * count / (count - 1.0)).sqrt(),
            false => f64::INFINITY,
        };
        variance.into_iter().enumerate().map(std).collect()
    }
}

/// The columns of a law.
fn columns(width: usize, effects: &[Candidate]) -> Vec<Column> {
    let mut columns =
        vec![Column::Link, Column::Acceleration, Column::Velocity, Column::Constant, Column::Coulomb(width)];
    columns.extend(effects.iter().map(|effect| effect.column(width)));
    columns
}

/// The share of the link torque's square, beyond what the other columns say, that is noise.
pub(super) fn noise_share(products: &Products, noise: f64) -> f64 {
    let normal = products.normal(&columns(Column::WIDTHS / 2, &[]), 1.0);
    // The first of the inverse's diagonal is one over what of the link's square the others do not say.
    noise * products.rows * normal.solver(|_| true).inverse_diagonal()[0]
}
