//! The part of the residual that a candidate would explain with the base refitted: one small solve per
//! candidate.
//!
//! The module also computes the part that it would explain of held-out folds.

use crate::effects::{Candidate, Context};
use crate::rule::Rule;
use faer::Mat;
use powerball_controller::JointNumber;
use powerball_identification::estimate::{Added, Fit, Folds, NormalEquations, Solver, runs};
use powerball_logs::regression::Column;
use powerball_logs::vector::dot;
use std::ops::Range;
use std::sync::OnceLock;

/// The base model prepared for many candidates.
#[derive(Debug)]
pub(crate) struct Screen<'c> {
    /// The model and its residual.
    pub(crate) context: &'c Context<'c>,
    /// The base's normal equations over its free columns, shape tangents among them.
    pub(crate) solver: Solver,
    /// The columns of the model that are refitted.
    free: Vec<bool>,
    /// A'r: zero but for bounds and unfinished shapes.
    slope: Vec<f64>,
    /// The base fitted without each fold: whole logs, stretches.
    folds: [OnceLock<Vec<FoldBase>>; 2],
}

/// A candidate tried on the base.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    /// The candidate's columns.
    pub(crate) columns: Vec<Column>,
    /// The candidate's coefficients.
    pub(crate) theta: Vec<f64>,
    /// For each of its columns: the base columns' shares in it.
    pub(crate) base: Vec<Vec<f64>>,
    /// χ² explained, over variance inflation.
    pub(crate) gain: f64,
    /// Gain after penalties for coefficients and search.
    pub(crate) score: f64,
}

/// The part that columns explain in addition to the base; a [`Trial`] without its columns.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    theta: Vec<f64>,
    base: Vec<Vec<f64>>,
    gain: f64,
    pub(super) score: f64,
}

/// The penalty of a score: for coefficients, and for having searched.
pub(crate) fn penalty(rule: &Rule, coefficients: usize, searched: f64) -> f64 {
    rule.per_coefficient * coefficients as f64 + 2.0 * searched.max(1.0).ln()
}

impl<'c> Screen<'c> {
    /// Prepares the base model of a context.
    #[must_use]
    pub(crate) fn new(context: &'c Context<'c>) -> Screen<'c> {
        Screen::without(context, 0..0)
    }

    /// Like [`Self::new`], without some of the model's columns, of whose torque the context's residual is
    /// free.
    #[must_use]
    pub(crate) fn without(context: &'c Context<'c>, columns: Range<usize>) -> Screen<'c> {
        let fit = context.fit;
        let free: Vec<bool> =
            fit.free.iter().enumerate().map(|(c, free)| *free && !columns.contains(&c)).collect();
        let solver = fit.normal_equations().solver(|c| free[c]);
        let mut slope = vec![0.0; fit.design.size];
        for (j, residual) in context.residual.iter().enumerate() {
            for (g, value) in fit.design.cross(j, &(0..residual.len()), &[residual.as_slice()]) {
                slope[g] += fit.weights[j] * value[0];
            }
        }
        Screen { context, solver, free, slope, folds: [OnceLock::new(), OnceLock::new()] }
    }

    /// The base fitted without each fold (see [`Folds::folds`]).
    pub(crate) fn folds(&self, folds: &Folds, local: bool) -> &[FoldBase] {
        self.folds[usize::from(local)]
            .get_or_init(|| FoldBase::all(self.context.fit, &self.free, folds, local))
    }

    /// Tries a candidate; `None` where it has no usable column or is physically impossible.
    #[must_use]
    pub(crate) fn try_candidate(&self, candidate: &Candidate) -> Option<Trial> {
        let effect = candidate.effect();
        let columns = self.context.columns(candidate);
        let trial = self.try_columns(columns, candidate.searched)?;
        let sound = !(effect.non_negative() && trial.theta.iter().any(|t| *t <= 0.0));
        let possible = effect.admissible(candidate, &trial.theta)
            && effect.possible(self.context, candidate, &trial.theta);
        (sound && possible).then_some(trial)
    }

    /// Tries columns, whatever they mean.
    #[must_use]
    pub(crate) fn try_columns(&self, columns: Vec<Column>, searched: f64) -> Option<Trial> {
        if columns.is_empty() || !columns.iter().all(Column::is_finite) {
            return None;
        }
        let Solved { theta, base, gain, score } = self.solve(&self.products(&columns), searched)?;
        Some(Trial { columns, theta, base, gain, score })
    }

    /// The joints that columns act on and that count.
    pub(super) fn joints_of(&self, columns: &[Column]) -> impl Iterator<Item = usize> {
        let fit = self.context.fit;
        (0..fit.design.dof())
            .filter(move |j| fit.weights[*j] != 0.0 && columns.iter().any(|c| c.at(*j).is_some()))
    }

    /// The products of columns with the base, with each other and with the residual.
    pub(super) fn products(&self, columns: &[Column]) -> Added {
        let fit = self.context.fit;
        let mut products = Added::zero(fit.design.size, columns.len());
        for (j, residual) in self.context.residual.iter().enumerate() {
            products.add_rows(&fit.design, (j, &(0..residual.len())), columns, residual, fit.weights[j]);
        }
        products
    }

    /// The part that columns explain in addition to the base, from their products.
    pub(super) fn solve(&self, products: &Added, searched: f64) -> Option<Solved> {
        let (base, rest) = products.without_base(&self.solver);
        let score: Vec<f64> =
            products.right.iter().zip(&base).map(|(own, shares)| own - dot(shares, &self.slope)).collect();
        // A column that the base can imitate wholly is not a candidate; nor is one that this arm never feels,
        // as a planar arm a force across its plane.
        let solver = products.solver(&rest);
        if solver.kept().is_empty() {
            return None;
        }
        let theta = solver.solve(&score);
        let gain = dot(&theta, &score);
        let score = gain - penalty(self.context.rule, solver.kept().len(), searched);
        gain.is_finite().then_some(Solved { theta, base, gain, score })
    }

    /// The gain by joint: on the only joint all of it, else where the squared error falls.
    #[must_use]
    pub(crate) fn gains(&self, trial: &Trial, joints: &[JointNumber]) -> Vec<(JointNumber, f64)> {
        if let [joint] = joints {
            return vec![(*joint, trial.gain)];
        }
        let columns = self.residualised(trial);
        let fall = |j: usize| {
            let mut moved = vec![0.0; self.context.residual[j].len()];
            for (column, theta) in columns[j].iter().zip(&trial.theta) {
                moved.iter_mut().zip(column).for_each(|(m, c)| *m += theta * c);
            }
            let change = 2.0 * dot(&self.context.residual[j], &moved) - dot(&moved, &moved);
            self.context.fit.weights[j] * change
        };
        joints.iter().map(|j| (*j, fall(j.index()))).collect()
    }

    /// The columns with the base's shares taken out, by joint and column.
    #[must_use]
    pub(crate) fn residualised(&self, trial: &Trial) -> Vec<Vec<Vec<f64>>> {
        let design = &self.context.fit.design;
        let of = |j: usize| {
            let one = |(column, base): (&Column, &Vec<f64>)| {
                let mut values: Vec<f64> = design.predict(j, base).iter().map(|v| -v).collect();
                if let Some(own) = column.at(j) {
                    values.iter_mut().zip(own).for_each(|(v, o)| *v += o);
                }
                values
            };
            trial.columns.iter().zip(&trial.base).map(one).collect()
        };
        (0..design.dof()).map(of).collect()
    }
}

// Held-out gains: the base is fitted once without each fold, a candidate then costs a small solve.

/// Share by which the held-out squared error of the given joints falls with a candidate, by fold; the base
/// and the candidate are fitted to the rest.
#[must_use]
pub(crate) fn fold_gains(
    screen: &Screen<'_>,
    trial: &Trial,
    joints: &[JointNumber],
    folds: &Folds,
    local: bool,
) -> Vec<f64> {
    let (data, fit) = (screen.context.data, screen.context.fit);
    let (size, k) = (fit.design.size, trial.columns.len());
    let mut cells: Vec<Option<Added>> = vec![None; folds.cells];
    for j in screen.joints_of(&trial.columns) {
        for (cell, rows) in runs(data, folds, j) {
            let cell = cells[cell].get_or_insert_with(|| Added::zero(size, k));
            cell.add_rows(&fit.design, (j, &rows), &trial.columns, &data.joints[j].torque, fit.weights[j]);
        }
    }
    // A difference from the sum over all cells would leave rounding where nothing is left.
    let sum = |wanted: &dyn Fn(usize) -> bool| {
        let own = cells.iter().enumerate().filter(|(cell, _)| wanted(*cell));
        own.filter_map(|(_, products)| products.as_ref()).fold(Added::zero(size, k), |mut sum, cell| {
            sum.add(cell, 1.0);
            sum
        })
    };
    screen
        .folds(folds, local)
        .iter()
        .filter_map(|fold| {
            let scale: f64 = joints.iter().map(|j| fold.error[j.index()]).sum();
            let fitted = sum(&|cell| !fold.left_out.contains(&cell));
            let held = sum(&|cell| fold.held.contains(&cell));
            (scale > 0.0).then(|| change(fold, &fitted, &held) / scale)
        })
        .collect()
}

/// The fall of the held-out squared error.
fn change(fold: &FoldBase, fitted: &Added, held: &Added) -> f64 {
    let (base, rest) = fitted.without_base(&fold.solver);
    let right: Vec<f64> =
        fitted.right.iter().zip(&fitted.cross).map(|(own, cross)| own - dot(cross, &fold.theta)).collect();
    let x = fitted.solver(&rest).solve(&right);
    // The addition of the candidate to the prediction: C x − A s.
    let mut shift = vec![0.0; fold.theta.len()];
    for (b, x) in base.iter().zip(&x) {
        shift.iter_mut().zip(b).for_each(|(s, b)| *s += x * b);
    }
    let mut change = -2.0 * dot(&shift, &fold.slope);
    for a in 0..x.len() {
        change += 2.0 * x[a] * (held.right[a] - dot(&held.cross[a], &fold.theta));
        change += 2.0 * x[a] * dot(&held.cross[a], &shift);
        for b in 0..x.len() {
            change -= x[a] * x[b] * held.square[(a, b)];
        }
    }
    change - (0..shift.len()).map(|i| shift[i] * times(&fold.gram, i, &shift)).sum::<f64>()
}

// The base model fitted once without each fold.

/// The base model fitted without one fold.
#[derive(Debug)]
pub(crate) struct FoldBase {
    pub(super) held: Vec<usize>,
    pub(super) left_out: Vec<usize>,
    /// Over what is fitted.
    pub(super) solver: Solver,
    pub(super) theta: Vec<f64>,
    /// Over what is held.
    pub(super) gram: Mat<f64>,
    /// (y − Aθ)'A over what is held.
    pub(super) slope: Vec<f64>,
    /// Weighted squared error of what is held, by joint.
    pub(super) error: Vec<f64>,
}

impl FoldBase {
    /// Fits the columns of a model that are `free` without each fold.
    #[must_use]
    pub(crate) fn all(fit: &Fit, free: &[bool], folds: &Folds, local: bool) -> Vec<FoldBase> {
        let (held, left_out) = folds.folds(local);
        held.iter()
            .zip(left_out)
            .map(|(held, left_out)| {
                let fitted = fit.gram.fitted(&fit.weights, |c| !left_out.contains(&c));
                let solver = fitted.solver(|c| free[c]);
                let theta = solver.solve(&fitted.right);
                let NormalEquations { gram, right, .. } = fit.gram.sum(&fit.weights, |c| held.contains(&c));
                let slope = (0..theta.len()).map(|i| right[i] - times(&gram, i, &theta)).collect();
                let error = (0..fit.design.dof())
                    .map(|j| {
                        let mut own = vec![0.0; fit.design.dof()];
                        own[j] = fit.weights[j];
                        fit.gram.sum(&own, |c| held.contains(&c)).left(&theta)
                    })
                    .collect();
                FoldBase { held: held.clone(), left_out: left_out.clone(), solver, theta, gram, slope, error }
            })
            .collect()
    }
}

/// A column of a symmetric matrix times a vector.
pub(super) fn times(gram: &Mat<f64>, column: usize, x: &[f64]) -> f64 {
    gram.col_as_slice(column).iter().zip(x).map(|(g, v)| g * v).sum()
}
