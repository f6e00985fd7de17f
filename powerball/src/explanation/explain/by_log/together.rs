//! The accepted model fitted to all logs together.

use super::super::model::Model;
use super::super::study::Study;
use crate::identification::estimate::{Design, Folds, Gram, Solver, friction_columns};
use crate::logs::regression::{Column, Data};
use crate::logs::vector::dot;
use std::ops::Range;

/// The fitted logs, then the validation set.
pub(crate) const SIDES: usize = 2;

/// The model of all logs.
pub(crate) struct Together<'s> {
    pub(crate) data: [&'s Data<'s>; SIDES],
    /// What it leaves, by side, joint and row, N·m.
    pub(crate) residual: [Vec<Vec<f64>>; SIDES],
    /// Its coefficients.
    pub(crate) theta: Vec<f64>,
    designs: [Design; SIDES],
    solver: Solver,
    weights: Vec<f64>,
}

/// What a column of one log explains beside the model.
pub(crate) struct Asked {
    /// Its coefficient.
    pub(crate) theta: f64,
    /// χ² explained.
    pub(crate) gain: f64,
    /// The column less what the model imitates of it, by side, joint and row.
    pub(crate) column: [Vec<Vec<f64>>; SIDES],
}

impl<'s> Together<'s> {
    pub(crate) fn new(study: &'s Study<'_>, model: &Model) -> Together<'s> {
        let (fit, validation) = (&model.fit, &study.validation);
        let columns = model.columns_on_validation(study);
        let on_validation = Design::new(validation, &friction_columns(validation, &fit.shapes), &columns);
        let (mut gram, mut right, _) = fit.gram.fitted(&fit.weights, |_| true);
        let folds = Folds::new(validation);
        let (more, right_on_validation, _) =
            Gram::new(validation, &on_validation, &folds).sum(&fit.weights, |_| true);
        gram += more;
        right.iter_mut().zip(right_on_validation).for_each(|(r, more)| *r += more);
        let solver = Solver::new(&gram, |c| fit.free[c]);
        let solved = solver.solve(&right);
        let theta: Vec<f64> =
            (0..solved.len()).map(|c| if fit.free[c] { solved[c] } else { fit.theta[c] }).collect();
        let moved: Vec<f64> = theta.iter().zip(&fit.theta).map(|(new, old)| new - old).collect();
        let designs = [fit.design.clone(), on_validation];
        let mut residual = [fit.residual.clone(), model.residual_on_validation(study)];
        for (residual, design) in residual.iter_mut().zip(&designs) {
            for (j, residual) in residual.iter_mut().enumerate() {
                residual.iter_mut().zip(design.predict(j, &moved)).for_each(|(r, more)| *r -= more);
            }
        }
        let data = [&study.data, validation];
        Together { data, residual, theta, designs, solver, weights: fit.weights.clone() }
    }

    /// The rows of a log on a joint.
    pub(crate) fn rows(&self, side: usize, log: usize, joint: usize) -> Range<usize> {
        let data = self.data[side];
        let own = data.recordings.iter().zip(&data.joints[joint].rows).filter(|(r, _)| r.log == log);
        let (first, last) =
            own.fold((usize::MAX, 0), |(a, b), (_, rows)| (a.min(rows.start), b.max(rows.end)));
        if first < last { first..last } else { 0..0 }
    }

    /// A joint's weight: 1 over the variance of what the model leaves.
    pub(crate) fn weight(&self, joint: usize) -> f64 {
        self.weights[joint]
    }

    /// The coefficient of a column in one log alone and what it explains, χ²; `None` where the model imitates it wholly.
    pub(crate) fn screen(&self, side: usize, log: usize, column: &Column) -> Option<(f64, f64)> {
        self.solve(side, log, column).map(|(theta, gain, _)| (theta, gain))
    }

    /// The same, with the column itself.
    pub(crate) fn ask(&self, side: usize, log: usize, column: &Column) -> Option<Asked> {
        let (theta, gain, base) = self.solve(side, log, column)?;
        let mut freed: [Vec<Vec<f64>>; SIDES] = [0, 1].map(|s: usize| {
            let negative = |j| self.designs[s].predict(j, &base).iter().map(|v| -v).collect();
            (0..self.data[s].dof()).map(negative).collect()
        });
        for (j, values) in &column.parts {
            let rows = self.rows(side, log, *j);
            freed[side][*j][rows.clone()].iter_mut().zip(&values[rows]).for_each(|(f, v)| *f += v);
        }
        Some(Asked { theta, gain, column: freed })
    }

    /// The coefficient, the gain and the model's shares in the column.
    fn solve(&self, side: usize, log: usize, column: &Column) -> Option<(f64, f64, Vec<f64>)> {
        let mut cross = vec![0.0; self.theta.len()];
        let (mut raw, mut score) = (0.0, 0.0);
        for (j, values) in &column.parts {
            let (rows, w) = (self.rows(side, log, *j), self.weights[*j]);
            for (g, value) in self.designs[side].cross(*j, &rows, &[values.as_slice()]) {
                cross[g] += w * value[0];
            }
            let own = &values[rows.clone()];
            raw += w * dot(own, own);
            score += w * dot(own, &self.residual[side][*j][rows]);
        }
        let base = self.solver.solve(&cross);
        let square = raw - dot(&cross, &base);
        let theta = score / square;
        (square > 1e-6 * raw && score.is_finite()).then_some((theta, theta * score, base))
    }

    /// The sums over blocks of all logs of a column times what would be left with it: by how much they vary tells how
    /// surely its coefficient is known.
    pub(crate) fn by_block(&self, asked: &Asked) -> Vec<f64> {
        let mut sums = Vec::new();
        for (side, data) in self.data.iter().enumerate() {
            for block in &data.blocks {
                let of = |(j, rows): (usize, &Range<usize>)| {
                    let (r, c) =
                        (&self.residual[side][j][rows.clone()], &asked.column[side][j][rows.clone()]);
                    self.weights[j] * (dot(c, r) - asked.theta * dot(c, c))
                };
                sums.push(block.rows.iter().enumerate().map(of).sum());
            }
        }
        sums
    }

    /// Takes a column in.
    pub(crate) fn take(&mut self, asked: &Asked) {
        for (residual, column) in self.residual.iter_mut().zip(&asked.column) {
            for (residual, column) in residual.iter_mut().zip(column) {
                residual.iter_mut().zip(column).for_each(|(r, c)| *r -= asked.theta * c);
            }
        }
    }
}
