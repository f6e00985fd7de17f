//! Windows of logs: which rows are in them, and steps of time of which they are made.
//!
//! The module also has the cross products of a few columns with the base, by stretch of time.

use super::{Context, Window};
use faer::Mat;
use powerball_identification::estimate::{Added, Solver};
use powerball_logs::regression::{Block, Column, Recording};
use powerball_logs::vector::dot;
use std::ops::Range;
use std::sync::Arc;

/// 1 in the windows, 0 elsewhere, by row.
pub(crate) fn mask(context: &Context<'_>, joint: usize, windows: &[Window]) -> Vec<f64> {
    let inside = |(log, t): &(usize, f64)| {
        windows.iter().any(|w| w.log == context.data.logs[*log] && *t >= w.from && *t <= w.to)
    };
    context.row_times(joint).iter().map(|at| if inside(at) { 1.0 } else { 0.0 }).collect()
}

/// Columns that are there in the windows only.
pub(super) fn cut(context: &Context<'_>, columns: &[Column], windows: &[Window]) -> Vec<Column> {
    let masks: Vec<Vec<f64>> = (0..context.data.dof()).map(|j| mask(context, j, windows)).collect();
    let part = |(j, values): &(usize, Arc<Vec<f64>>)| {
        let inside: Vec<f64> = values.iter().zip(&masks[*j]).map(|(value, m)| value * m).collect();
        (*j, inside.into())
    };
    columns.iter().map(|column| Column { parts: column.parts.iter().map(part).collect() }).collect()
}

/// The steps of each log.
pub(super) fn by_log(steps: &[Block]) -> Vec<Range<usize>> {
    (steps.chunk_by(|a, b| a.log == b.log))
        .scan(0, |end, steps| {
            *end += steps.len();
            Some(*end - steps.len()..*end)
        })
        .collect()
}

/// The window of some steps of a log.
pub(super) fn window(
    context: &Context<'_>,
    steps: &[Block],
    log: &Range<usize>,
    found: &Range<usize>,
) -> Option<Window> {
    let data = context.data;
    let from = step_start(context, &steps[found.start])?;
    // To the last row before the next step begins.
    let to = match found.end < log.end {
        true => step_start(context, &steps[found.end])? - 0.5 / data.rate(),
        false => end_of_log(context, steps[found.start].log),
    };
    Some(Window::new(data, steps[found.start].log, from, to))
}

/// Like [`window`], for an effect that is present before a log begins if it is present at its first step, and
/// continues after it if it is present at its last step.
pub(super) fn lasting_window(
    context: &Context<'_>,
    steps: &[Block],
    log: &Range<usize>,
    found: &Range<usize>,
) -> Option<Window> {
    let mut window = window(context, steps, log, found)?;
    if found.start == log.start {
        window.from = context.data.recordings[steps[log.start].recording].start;
    }
    if found.end == log.end {
        window.to = f64::INFINITY;
    }
    Some(window)
}

/// The steps in a row that together explain most.
pub(super) fn best_run(explains: &[(f64, f64)]) -> Range<usize> {
    let (mut best, mut run) = ((0.0, 0..0), (0.0, 0..0));
    for (k, (less, _)) in explains.iter().enumerate() {
        run = if run.0 > 0.0 { (run.0 + less, run.1.start..k + 1) } else { (*less, k..k + 1) };
        if run.0 > best.0 {
            best = run.clone();
        }
    }
    best.1
}

/// The stretches in which no joint moves for at least `rest`, s, before the arm starts.
pub(super) fn rests(context: &Context<'_>, steps: &[Block], rest: f64) -> Vec<Window> {
    let mut before: Option<&Block> = None;
    let of = |step| {
        let last = before.replace(step).filter(|other| other.recording == step.recording);
        let begins = context.data.recordings[step.recording].start;
        let since = last.map_or(Some(begins), |last| step_end(context, last))?;
        let until = step_start(context, step)?;
        (until - since > rest).then(|| Window::new(context.data, step.log, since, until))
    };
    steps.iter().filter_map(of).collect()
}

/// The time of the first row of a step in its log's own t.
pub(super) fn step_start(context: &Context<'_>, step: &Block) -> Option<f64> {
    row_times(context, step, |rows| rows.start).min_by(f64::total_cmp)
}

/// That of its last row.
fn step_end(context: &Context<'_>, step: &Block) -> Option<f64> {
    row_times(context, step, |rows| rows.end - 1).max_by(f64::total_cmp)
}

/// The times of one row of a step by joint that has any.
fn row_times(
    context: &Context<'_>,
    step: &Block,
    row: impl Fn(&Range<usize>) -> usize,
) -> impl Iterator<Item = f64> {
    let data = context.data;
    let recording = &data.recordings[step.recording];
    (0..data.dof()).filter(|j| !step.rows[*j].is_empty()).map(move |j| {
        let joint = &data.joints[j];
        let k = joint.kept[step.recording][row(&step.rows[j]) - joint.rows[step.recording].start];
        recording.start + joint.band.kept(recording.len())[k] as f64 / recording.rate
    })
}

fn end_of_log(context: &Context<'_>, log: usize) -> f64 {
    let end = |r: &Recording| r.start + r.len() as f64 / r.rate;
    context.data.recordings.iter().filter(|r| r.log == log).map(end).fold(0.0, f64::max)
}

// Cross products of a few columns with the base by stretch of time: any window is then a sum. What a known
// torque explains of a stretch.

/// Products of a few columns over some rows, with L⁻¹ A'C in place of A'C, L the base's factor (see
/// [`Solver::whitened`]): that is linear in the rows, so that a window costs no solve.
#[derive(Clone, Debug)]
pub(super) struct Sums(Added);

impl Sums {
    pub(super) fn zero(base: &Solver, k: usize) -> Sums {
        Sums(Added::zero(base.kept().len(), k))
    }

    /// The sums over one block.
    pub(super) fn of_block(context: &Context<'_>, base: &Solver, columns: &[Column], block: &Block) -> Sums {
        let fit = context.fit;
        let mut products = Added::zero(fit.design.size, columns.len());
        for (j, rows) in block.rows.iter().enumerate() {
            products.add_rows(&fit.design, (j, rows), columns, &context.residual[j], fit.weights[j]);
        }
        products.cross.iter_mut().for_each(|c| *c = base.whitened(c));
        Sums(products)
    }

    pub(super) fn add(&mut self, other: &Sums) {
        self.0.add(&other.0, 1.0);
    }

    pub(super) fn subtract(&mut self, other: &Sums) {
        self.0.add(&other.0, -1.0);
    }

    /// χ² that the columns explain over these rows with the base refitted, and their coefficients.
    pub(super) fn gain(&self) -> (f64, Vec<f64>) {
        let Added { cross, square, right } = &self.0;
        let k = right.len();
        let rest = Mat::from_fn(k, k, |a, b| square[(a, b)] - dot(&cross[a], &cross[b]));
        let x = self.0.solver(&rest).solve(right);
        (dot(&x, right), x)
    }
}

/// −2 ln of the likelihood of what columns leave of the residual, with the base refitted: n·ln χ² summed over
/// joints, n the independent samples that a joint counts as. Only differences mean something.
pub(super) fn deviance(context: &Context<'_>, base: &Solver, columns: &[Column]) -> f64 {
    let fit = context.fit;
    let mut products = Added::zero(fit.design.size, columns.len());
    for (j, residual) in context.residual.iter().enumerate() {
        products.add_rows(&fit.design, (j, &(0..residual.len())), columns, residual, fit.weights[j]);
    }
    let (shares, rest) = products.without_base(base);
    let x = products.solver(&rest).solve(&products.right);
    let mut shift = vec![0.0; fit.design.size];
    for (shares, x) in shares.iter().zip(&x) {
        shift.iter_mut().zip(shares).for_each(|(sum, share)| *sum += x * share);
    }
    let of_joint = |(j, residual): (usize, &Vec<f64>)| {
        let (mut left, n) = (residual.clone(), fit.weights[j] * dot(residual, residual));
        left.iter_mut().zip(fit.design.predict(j, &shift)).for_each(|(left, base)| *left += base);
        for (column, x) in columns.iter().zip(&x) {
            let own = column.at(j).unwrap_or_default();
            left.iter_mut().zip(own).for_each(|(left, own)| *left -= x * own);
        }
        if n > 0.0 { n * (fit.weights[j] * dot(&left, &left)).ln() } else { 0.0 }
    };
    context.residual.iter().enumerate().map(of_joint).sum()
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
