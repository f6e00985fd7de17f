//! The columns of all joints and their cross products, from which every fit is a small solve.
//!
//! The module also groups the blocks that are held out together, and makes the products of columns that are
//! added to a design.

use super::solve::{NormalEquations, Solver};
use super::variable_projection::{FRICTION, Layout};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use powerball_logs::parallel;
use powerball_logs::regression::{Column, Data};
use powerball_logs::vector::dot;
use std::ops::Range;
use std::sync::Arc;

/// The regression columns for given friction shapes and terms.
///
/// Global order: the minimal set (one after the other for each joint, where [`Data::per_joint`]),
/// `FRICTION` columns a joint, the terms' columns.
#[derive(Clone, Debug)]
pub struct Design {
    /// Joint by joint: columns, column-major.
    joints: Vec<Local>,
    /// The global order.
    pub layout: Layout,
    /// Columns in all.
    pub size: usize,
    /// Inertial columns.
    pub inertial: usize,
    /// Inertial columns of one joint.
    pub set: usize,
}

#[derive(Clone, Debug)]
struct Local {
    rows: usize,
    values: Vec<f64>,
    /// Global column by local one.
    global: Vec<usize>,
}

impl Design {
    /// Lays out the columns; `friction[j]` are joint j's `FRICTION` columns.
    #[must_use]
    pub fn new(data: &Data<'_>, friction: &[[Arc<Vec<f64>>; FRICTION]], extra: &[Column]) -> Design {
        let (n, p) = (data.dof(), data.inertial_columns());
        let layout = Layout::of(data, extra.len());
        let own = |j: usize| if data.per_joint { p * j } else { 0 };
        let joints = (0..n)
            .map(|j| {
                let rows = data.joints[j].len();
                let mut values = Vec::with_capacity(rows * (p + FRICTION + extra.len()));
                let mut global = Vec::new();
                for (c, column) in data.joints[j].inertial.iter().enumerate() {
                    // Links inside a joint do not load it: those columns are zero.
                    if column.iter().any(|v| *v != 0.0) {
                        values.extend_from_slice(column);
                        global.push(own(j) + c);
                    }
                }
                for (k, column) in friction[j].iter().enumerate() {
                    values.extend_from_slice(column);
                    global.push(layout.friction(j, k));
                }
                for (e, column) in extra.iter().enumerate() {
                    if let Some(column) = column.at(j) {
                        values.extend_from_slice(column);
                        global.push(layout.extra(e));
                    }
                }
                Local { rows, values, global }
            })
            .collect();
        Design { joints, layout, size: layout.size(), inertial: layout.inertial, set: p }
    }

    /// Joints.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Global index of a joint's friction column.
    #[must_use]
    pub fn friction(&self, joint: usize, which: usize) -> usize {
        self.layout.friction(joint, which)
    }

    /// Global index of a term's column.
    #[must_use]
    pub fn extra(&self, which: usize) -> usize {
        self.layout.extra(which)
    }

    fn matrix(&self, joint: usize, rows: &Range<usize>) -> MatRef<'_, f64> {
        let local = &self.joints[joint];
        MatRef::from_column_major_slice(&local.values, local.rows, local.global.len())
            .subrows(rows.start, rows.len())
    }

    /// The columns that act on a joint: place in the global order, values by row.
    pub fn columns(&self, joint: usize) -> impl Iterator<Item = (usize, &[f64])> {
        let local = &self.joints[joint];
        local.global.iter().copied().zip(local.values.chunks_exact(local.rows.max(1)))
    }

    /// The prediction on a joint's rows.
    #[must_use]
    pub fn predict(&self, joint: usize, theta: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.joints[joint].rows];
        for (g, column) in self.columns(joint) {
            let value = theta[g];
            if value != 0.0 {
                out.iter_mut().zip(column).for_each(|(o, c)| *o += value * c);
            }
        }
        out
    }

    /// A'C and friends on a row range of one joint: columns of the design times those of `other`.
    #[must_use]
    pub fn cross(&self, joint: usize, rows: &Range<usize>, other: &[&[f64]]) -> Vec<(usize, Vec<f64>)> {
        let local = &self.joints[joint];
        if rows.is_empty() || other.is_empty() {
            return Vec::new();
        }
        let right = pack(other, rows);
        let right = MatRef::from_column_major_slice(&right, rows.len(), other.len());
        let left = self.matrix(joint, rows);
        let mut out = Mat::zeros(local.global.len(), other.len());
        matmul(out.as_mut(), Accum::Replace, left.transpose(), right, 1.0, Par::Seq);
        local
            .global
            .iter()
            .enumerate()
            .map(|(i, g)| (*g, (0..other.len()).map(|c| out[(i, c)]).collect()))
            .collect()
    }
}

fn pack(columns: &[&[f64]], rows: &Range<usize>) -> Vec<f64> {
    let mut packed = Vec::with_capacity(rows.len() * columns.len());
    for column in columns {
        packed.extend_from_slice(&column[rows.clone()]);
    }
    packed
}

/// Cross products of a design with itself and the torques, by joint and cell of folds.
#[derive(Debug)]
pub struct Gram {
    /// `[joint][cell]`, over the joint's own columns.
    parts: Vec<Vec<NormalEquations>>,
    /// By joint over all cells.
    whole: Vec<NormalEquations>,
    globals: Vec<Vec<usize>>,
    size: usize,
    /// By column the precision with which it is known before anything is measured.
    prior: Vec<f64>,
}

impl Gram {
    /// Forms all cross products.
    #[must_use]
    pub fn new(data: &Data<'_>, design: &Design, folds: &Folds) -> Gram {
        let joints: Vec<usize> = (0..design.dof()).collect();
        let parts = parallel::map(&joints, |&j| {
            let local = &design.joints[j];
            let d = local.global.len();
            let mut cells = vec![NormalEquations::zero(d); folds.cells];
            for (cell, rows) in runs(data, folds, j) {
                let a = design.matrix(j, &rows);
                let y = &data.joints[j].torque[rows.clone()];
                let NormalEquations { gram, right, square } = &mut cells[cell];
                matmul(gram.as_mut(), Accum::Add, a.transpose(), a, 1.0, Par::Seq);
                for (c, r) in right.iter_mut().enumerate() {
                    let column = &local.values[c * local.rows + rows.start..c * local.rows + rows.end];
                    *r += column.iter().zip(y).map(|(a, b)| a * b).sum::<f64>();
                }
                *square += y.iter().map(|v| v * v).sum::<f64>();
            }
            cells
        });
        let globals: Vec<Vec<usize>> = design.joints.iter().map(|l| l.global.clone()).collect();
        let joint = |(cells, global): (&Vec<NormalEquations>, &Vec<usize>)| {
            let (mut sum, own) = (NormalEquations::zero(global.len()), (0..global.len()).collect::<Vec<_>>());
            cells.iter().for_each(|cell| sum.add(&own, cell, 1.0));
            sum
        };
        let whole: Vec<NormalEquations> = parts.iter().zip(&globals).map(joint).collect();
        let prior = prior(&whole, &globals, design.size);
        Gram { parts, whole, globals, size: design.size, prior }
    }

    /// The normal equations of all rows, with what is known beforehand (see [`fitted`](Self::fitted)).
    #[must_use]
    pub fn normal_equations(&self, weights: &[f64]) -> NormalEquations {
        self.with_prior(self.all(weights))
    }

    /// The normal equations of all rows alone.
    #[must_use]
    pub fn all(&self, weights: &[f64]) -> NormalEquations {
        let mut sum = NormalEquations::zero(self.size);
        for ((own, global), w) in self.whole.iter().zip(&self.globals).zip(weights) {
            sum.add(global, own, *w);
        }
        sum
    }

    /// Like [`sum`](Self::sum), with prior knowledge of an arm: none of its parameters alone makes more
    /// torque on a joint than was measured there. Parameters that logs determine do not change by that; those
    /// that they hardly determine stay in the range of a real arm, so that the model does not diverge on
    /// other paths.
    #[must_use]
    pub fn fitted(&self, weights: &[f64], wanted: impl Fn(usize) -> bool) -> NormalEquations {
        self.with_prior(self.sum(weights, wanted))
    }

    fn with_prior(&self, mut sum: NormalEquations) -> NormalEquations {
        for (c, precision) in self.prior.iter().enumerate() {
            sum.gram[(c, c)] += precision;
        }
        sum
    }

    /// The normal equations over the cells for which `wanted` holds.
    #[must_use]
    pub fn sum(&self, weights: &[f64], wanted: impl Fn(usize) -> bool) -> NormalEquations {
        let mut sum = NormalEquations::zero(self.size);
        for ((cells, global), w) in
            self.parts.iter().zip(&self.globals).zip(weights).filter(|(_, w)| **w != 0.0)
        {
            for (_, own) in cells.iter().enumerate().filter(|(cell, _)| wanted(*cell)) {
                sum.add(global, own, *w);
            }
        }
        sum
    }
}

/// By column 1/s², where s is the value at which it alone would make as much torque on some joint as was
/// measured there.
fn prior(whole: &[NormalEquations], globals: &[Vec<usize>], size: usize) -> Vec<f64> {
    let mut prior = vec![0.0f64; size];
    for (own, global) in whole.iter().zip(globals) {
        for (local, g) in global.iter().enumerate() {
            if own.square > 0.0 {
                prior[*g] = prior[*g].max(own.gram[(local, local)] / own.square);
            }
        }
    }
    prior
}

/// The row ranges of a joint by cell, neighbouring blocks of one cell joined.
#[must_use]
pub fn runs(data: &Data<'_>, folds: &Folds, joint: usize) -> Vec<(usize, Range<usize>)> {
    let mut runs: Vec<(usize, Range<usize>)> = Vec::new();
    for (block, cell) in data.blocks.iter().zip(&folds.cell_of_block) {
        let rows = block.rows[joint].clone();
        match runs.last_mut() {
            Some((last, range)) if last == cell && range.end == rows.start => range.end = rows.end,
            _ => runs.push((*cell, rows)),
        }
    }
    runs.retain(|(_, rows)| !rows.is_empty());
    runs
}

// Which blocks are held out together.

/// Parts that are held out in turn: whole logs where there are enough, else stretches of each with a guard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folds {
    /// The cell of each block; grams are summed by cell.
    pub cell_of_block: Vec<usize>,
    /// Number of cells.
    pub cells: usize,
    /// Whether folds are whole logs.
    pub by_log: bool,
    logs: Parts,
    stretches: Parts,
}

/// By fold: the cells that are predicted, and the cells that are not fitted (held ones and guards).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Parts {
    held: Vec<Vec<usize>>,
    left_out: Vec<Vec<usize>>,
}

/// Folds wanted.
const FOLDS: usize = 5;
/// More folds than this cost time and test no more.
const MOST: usize = 8;

impl Folds {
    /// Lays out both kinds of folds.
    ///
    /// Whole logs: at least five, at most eight folds of neighbouring logs. Stretches: the f-th fifth of
    /// every log is fold f, and the blocks next to it are not fitted either.
    #[must_use]
    pub fn new(data: &Data<'_>) -> Folds {
        let mut names: Vec<usize> = data.blocks.iter().map(|b| b.log).collect();
        names.dedup();
        let mut cell_of_block = vec![0; data.blocks.len()];
        let mut cells = 0;
        let mut stretches = Parts { held: vec![Vec::new(); FOLDS], left_out: vec![Vec::new(); FOLDS] };
        let folds = names.len().clamp(1, MOST);
        let mut logs = Parts { held: vec![Vec::new(); folds], left_out: vec![Vec::new(); folds] };
        for (at, log) in names.iter().enumerate() {
            let members: Vec<usize> =
                (0..data.blocks.len()).filter(|b| data.blocks[*b].log == *log).collect();
            let part_of = |k: usize| k * FOLDS / members.len();
            let mut previous = None;
            for (k, block) in members.iter().enumerate() {
                // The first and last block of a stretch guard its neighbours, so they are cells of their own.
                let part = part_of(k);
                let first = k == 0 || part_of(k - 1) != part;
                let last = k + 1 == members.len() || part_of(k + 1) != part;
                let key = (part, first, last);
                if previous != Some(key) {
                    cells += 1;
                    previous = Some(key);
                }
                let cell = cells - 1;
                cell_of_block[*block] = cell;
                stretches.held[part].push(cell);
                stretches.left_out[part].push(cell);
                if first && k > 0 {
                    stretches.left_out[part_of(k - 1)].push(cell);
                }
                if last && k + 1 < members.len() {
                    stretches.left_out[part_of(k + 1)].push(cell);
                }
                let fold = at * folds / names.len();
                logs.held[fold].push(cell);
                logs.left_out[fold].push(cell);
            }
        }
        stretches.held.retain(|f| !f.is_empty());
        stretches.left_out.retain(|f| !f.is_empty());
        for list in [&mut logs.held, &mut logs.left_out, &mut stretches.held, &mut stretches.left_out] {
            for fold in list.iter_mut() {
                fold.dedup();
            }
        }
        Folds { cell_of_block, cells, by_log: names.len() >= FOLDS, logs, stretches }
    }

    /// The folds for what happens everywhere, or for what happens in some logs only (`local`): held cells,
    /// and cells that are not fitted.
    #[must_use]
    pub fn folds(&self, local: bool) -> (&[Vec<usize>], &[Vec<usize>]) {
        let parts = if self.by_log && !local { &self.logs } else { &self.stretches };
        (&parts.held, &parts.left_out)
    }
}

// Columns that are added to a design: their products with it, from which the fit with them is a small solve.
//
// With the base's columns A, the added ones C and a signal y the normal equations of both need A'C, C'C and
// C'y in addition to those of A (partitioned regression: Frisch and Waugh 1933).

/// Weighted products of k added columns.
#[derive(Clone, Debug)]
pub struct Added {
    /// A'C: by column of C, over the columns of the design.
    pub cross: Vec<Vec<f64>>,
    /// C'C, k × k.
    pub square: Mat<f64>,
    /// C'y, k.
    pub right: Vec<f64>,
}

impl Added {
    /// Products without rows: k columns added to a design of `size`.
    #[must_use]
    pub fn zero(size: usize, k: usize) -> Added {
        Added { cross: vec![vec![0.0; size]; k], square: Mat::zeros(k, k), right: vec![0.0; k] }
    }

    /// Adds some rows of a joint; `signal` is y on all rows of the joint. A column that does not act on the
    /// joint is zero there.
    pub fn add_rows(
        &mut self,
        design: &Design,
        (joint, rows): (usize, &Range<usize>),
        columns: &[Column],
        signal: &[f64],
        weight: f64,
    ) {
        if weight == 0.0 || rows.is_empty() {
            return;
        }
        let acting = columns.iter().enumerate().filter_map(|(c, column)| Some((c, column.at(joint)?)));
        let (places, parts): (Vec<usize>, Vec<&[f64]>) = acting.unzip();
        for (g, values) in design.cross(joint, rows, &parts) {
            for (c, value) in places.iter().zip(values) {
                self.cross[*c][g] += weight * value;
            }
        }
        let parts: Vec<&[f64]> = parts.into_iter().map(|part| &part[rows.clone()]).collect();
        for (k, (a, part)) in places.iter().zip(&parts).enumerate() {
            for (b, other) in places.iter().zip(&parts).take(k + 1) {
                let product = weight * dot(part, other);
                self.square[(*a, *b)] += product;
                if a != b {
                    self.square[(*b, *a)] += product;
                }
            }
            self.right[*a] += weight * dot(part, &signal[rows.clone()]);
        }
    }

    /// Adds the products of other rows, or removes them (`sign` −1).
    pub fn add(&mut self, other: &Added, sign: f64) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += sign * f);
        self.cross.iter_mut().zip(&other.cross).for_each(|(to, from)| add(to, from));
        self.square += faer::Scale(sign) * &other.square;
        add(&mut self.right, &other.right);
    }

    /// The base's shares in the added columns, by column, and the products with each other of what the base
    /// does not imitate of them: C'C − C'A (A'A)⁻¹ A'C. `base` solves the normal equations of the design.
    #[must_use]
    pub fn without_base(&self, base: &Solver) -> (Vec<Vec<f64>>, Mat<f64>) {
        let shares: Vec<Vec<f64>> = self.cross.iter().map(|c| base.solve(c)).collect();
        let rest = Mat::from_fn(shares.len(), shares.len(), |a, b| {
            // By the lower triangle, so that it is symmetric to the last bit.
            let (a, b) = (a.max(b), a.min(b));
            self.square[(a, b)] - dot(&self.cross[a], &shares[b])
        });
        (shares, rest)
    }

    /// Solves for the added columns, from what the base does not imitate of them; a column that the base
    /// imitates wholly is left out.
    #[must_use]
    pub fn solver(&self, rest: &Mat<f64>) -> Solver {
        Solver::new(rest, |a| rest[(a, a)] > IMITATED * self.square[(a, a)])
    }
}

/// A column of whose square less is left is imitated by the base.
const IMITATED: f64 = 1e-6;
