//! The part of a residual that columns would explain with the model refitted: one small solve a question.

use crate::estimate::{Added, Design, Solver};
use powerball_logs::regression::{Column, Data, Signals};
use powerball_logs::vector::dot;
use std::ops::Range;

/// Rows with the columns that a model has on them, and what it leaves.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'r> {
    /// The logs as rows.
    pub data: &'r Data<'r>,
    /// The model's columns.
    pub design: &'r Design,
    /// Residual of the model by joint and row, N·m.
    pub residual: &'r [Vec<f64>],
}

/// A model on the rows that it was fitted to, prepared for many questions.
#[derive(Debug)]
pub struct Base<'b> {
    /// The rows.
    pub rows: Rows<'b>,
    /// 1/(σ²·inflation) by joint, 0 for a joint that does not count.
    pub weights: &'b [f64],
    /// The model's normal equations over the columns that are refitted.
    solver: Solver,
    /// A'r: zero but for bounds and unfinished shapes.
    slope: Vec<f64>,
    per_coefficient: f64,
}

/// The answer for some columns.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The columns.
    pub columns: Vec<Column>,
    /// Their coefficients, 0 for a column that the model imitates wholly.
    pub theta: Vec<f64>,
    /// By column the shares of the model's columns in it.
    pub shares: Vec<Vec<f64>>,
    /// χ² explained, over variance inflation.
    pub gain: f64,
    /// Gain after penalties for coefficients and search.
    pub score: f64,
}

/// The penalty of a score: for coefficients, each as much as `per_coefficient`, and for having searched.
#[must_use]
pub fn penalty(per_coefficient: f64, coefficients: usize, searched: f64) -> f64 {
    per_coefficient * coefficients as f64 + 2.0 * searched.max(1.0).ln()
}

impl Rows<'_> {
    /// Columns without what the model imitates of them, by joint and column. `shares` are as in a [`Trial`].
    #[must_use]
    pub fn freed(&self, columns: &[Column], shares: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
        let of = |j: usize| {
            let one = |(column, shares): (&Column, &Vec<f64>)| {
                let mut values: Vec<f64> = self.design.predict(j, shares).iter().map(|v| -v).collect();
                if let Some(own) = column.at(j) {
                    values.iter_mut().zip(own).for_each(|(v, o)| *v += o);
                }
                values
            };
            columns.iter().zip(shares).map(one).collect()
        };
        (0..self.design.dof()).map(of).collect()
    }

    /// What a trial adds to the prediction of these rows, on which its columns are `columns`, by joint and
    /// row, N·m.
    #[must_use]
    pub fn added(&self, columns: &[Column], trial: &Trial) -> Signals {
        let mut moved = vec![0.0; self.design.size];
        for (shares, theta) in trial.shares.iter().zip(&trial.theta) {
            moved.iter_mut().zip(shares).for_each(|(m, share)| *m -= theta * share);
        }
        let mut added: Signals = (0..self.design.dof()).map(|j| self.design.predict(j, &moved)).collect();
        added.add(columns, &trial.theta);
        added
    }

    /// By how much a joint's squared error falls on some of its rows with an addition, (N·m)².
    #[must_use]
    pub fn fall(&self, added: &[Vec<f64>], joint: usize, rows: Range<usize>) -> f64 {
        let (residual, added) = (&self.residual[joint][rows.clone()], &added[joint][rows]);
        2.0 * dot(residual, added) - dot(added, added)
    }
}

impl<'b> Base<'b> {
    /// A model of some rows. `solver` factors its normal equations over the columns that are refitted, and
    /// `per_coefficient` is as in [`penalty`].
    #[must_use]
    pub fn new(rows: Rows<'b>, weights: &'b [f64], solver: Solver, per_coefficient: f64) -> Base<'b> {
        let mut slope = vec![0.0; rows.design.size];
        for (j, residual) in rows.residual.iter().enumerate() {
            for (g, value) in rows.design.cross(j, &(0..residual.len()), &[residual.as_slice()]) {
                slope[g] += weights[j] * value[0];
            }
        }
        Base { rows, weights, solver, slope, per_coefficient }
    }

    /// Some rows of a model that was fitted to more than these.
    #[must_use]
    pub fn of_more(rows: Rows<'b>, weights: &'b [f64], solver: Solver, per_coefficient: f64) -> Base<'b> {
        let slope = vec![0.0; rows.design.size];
        Base { rows, weights, solver, slope, per_coefficient }
    }

    /// Asks about columns; `searched` counts what was tried for them. `None` where they have no number, or
    /// the model imitates all of them.
    #[must_use]
    pub fn ask(&self, columns: Vec<Column>, searched: f64) -> Option<Trial> {
        self.ask_within(columns, searched, |j| 0..self.rows.residual[j].len())
    }

    /// Asks about columns that are zero but on some rows of each joint.
    #[must_use]
    pub fn ask_within(
        &self,
        columns: Vec<Column>,
        searched: f64,
        rows: impl Fn(usize) -> Range<usize>,
    ) -> Option<Trial> {
        if columns.is_empty() || !columns.iter().all(Column::is_finite) {
            return None;
        }
        let trial = self.solve(&self.products(&columns, rows), searched)?;
        Some(Trial { columns, ..trial })
    }

    /// The products of columns with the model's, with each other and with the residual, on some rows of each
    /// joint.
    pub(super) fn products(&self, columns: &[Column], rows: impl Fn(usize) -> Range<usize>) -> Added {
        let mut products = Added::zero(self.rows.design.size, columns.len());
        for (j, residual) in self.rows.residual.iter().enumerate() {
            products.add_rows(self.rows.design, (j, &rows(j)), columns, residual, self.weights[j]);
        }
        products
    }

    /// The answer from the products of columns with the model's, with each other and with the residual,
    /// without the columns themselves.
    pub(super) fn solve(&self, products: &Added, searched: f64) -> Option<Trial> {
        let (shares, rest) = products.without_base(&self.solver);
        let right: Vec<f64> =
            products.right.iter().zip(&shares).map(|(own, shares)| own - dot(shares, &self.slope)).collect();
        // A column that the model can imitate wholly is not a candidate; nor is one that this arm never
        // feels, as a planar arm a force across its plane.
        let solver = products.solver(&rest);
        if solver.kept().is_empty() {
            return None;
        }
        let theta = solver.solve(&right);
        let gain = dot(&theta, &right);
        let score = gain - penalty(self.per_coefficient, solver.kept().len(), searched);
        gain.is_finite().then_some(Trial { columns: Vec::new(), theta, shares, gain, score })
    }

    /// The joints that columns act on and that count.
    pub fn joints_of(&self, columns: &[Column]) -> impl Iterator<Item = usize> {
        let counts = |j: &usize| self.weights[*j] != 0.0 && columns.iter().any(|c| c.at(*j).is_some());
        (0..self.rows.design.dof()).filter(counts)
    }

    /// A trial's columns without what the model imitates of them, by joint and column.
    #[must_use]
    pub fn freed(&self, trial: &Trial) -> Vec<Vec<Vec<f64>>> {
        self.rows.freed(&trial.columns, &trial.shares)
    }

    /// What a trial adds to the prediction, by joint and row, N·m.
    #[must_use]
    pub fn added(&self, trial: &Trial) -> Signals {
        self.rows.added(&trial.columns, trial)
    }

    /// What is left with a trial, by joint and row, N·m.
    #[must_use]
    pub fn left(&self, trial: &Trial) -> Signals {
        let mut left = self.added(trial);
        for (left, residual) in left.iter_mut().zip(self.rows.residual) {
            left.iter_mut().zip(residual).for_each(|(left, r)| *left = r - *left);
        }
        left
    }
}
