//! The fit of reduced logs.

use super::solve::{NormalEquations, dot};
use super::variable_projection::{FRICTION, Layout, Scatter, SeparableRows, Trials, variable_projection};
use faer::Mat;
use powerball_logs::summary::{
    Columns, Identity, NODES, OCTAVES, RFactor, SLOW, Steepness, Summary, SummaryError,
};

/// The terms of a joint's torque model in addition to the minimal set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionKind {
    /// Eq. 16 of the paper: γ1·tanh(γ2·q̇) + γ3·tanh(γ4·q̇) + γ5·q̇.
    #[default]
    Symmetric,
    /// Eq. 16 and a constant torque, as drives have whose friction depends on the direction.
    Asymmetric,
}

/// A model fitted to reduced logs.
#[derive(Debug)]
pub struct Solution {
    /// The order of the coefficients; the further columns are the constant torques by joint, where the law
    /// has them.
    pub layout: Layout,
    /// γ2, γ4 by joint, s/rad.
    pub shapes: Vec<[f64; 2]>,
    /// The coefficients; those of tangents are 0.
    pub theta: Vec<f64>,
    /// The joints' weights, 1/(N·m)².
    pub weights: Vec<f64>,
    /// The columns whose coefficients are free, tangents among them.
    pub free: Vec<bool>,
    /// The end of each joint's band, Hz.
    pub bands: Vec<f64>,
    /// The rows of each joint and octave at these shapes.
    pub(super) parts: Vec<Vec<Part>>,
    /// The arm and the options of the logs.
    pub(super) identity: Identity,
}

impl Solution {
    /// γ1 … γ5 of a joint.
    #[must_use]
    pub fn friction(&self, joint: usize) -> [f64; 5] {
        self.layout.gamma(&self.theta, joint, self.shapes[joint])
    }

    /// The constant torque of a joint, N·m: 0 where the law has none.
    #[must_use]
    pub fn offset(&self, joint: usize) -> f64 {
        if self.layout.extra > 0 { self.theta[self.layout.extra(joint)] } else { 0.0 }
    }

    /// The minimal set's values.
    #[must_use]
    pub fn inertial(&self) -> &[f64] {
        &self.theta[..self.layout.inertial]
    }

    /// The normal equations of all joints.
    pub(super) fn products(&self) -> NormalEquations {
        let mut sum = NormalEquations::zero(self.layout.size());
        for (parts, weight) in self.parts.iter().zip(&self.weights) {
            parts.iter().for_each(|part| part.add_to(&mut sum, *weight));
        }
        sum
    }

    /// Mean squares of what coefficients leave on a joint, and of its torque; and its rows.
    pub(super) fn mean_squares(&self, joint: usize, theta: &[f64]) -> (f64, f64, u64) {
        let parts = &self.parts[joint];
        let rows: u64 = parts.iter().map(|p| p.rows).sum();
        let count = rows.max(1) as f64;
        let left: f64 = parts.iter().map(|p| p.left(theta)).sum();
        let torque: f64 = parts.iter().map(|p| p.left(&vec![0.0; theta.len()])).sum();
        (left / count, torque / count, rows)
    }

    /// Applies this model to other reduced logs of the same arm and band: its residuals on logs that were not
    /// fitted.
    ///
    /// # Errors
    /// [`SummaryError::Differs`] if they are of another arm, set or band.
    pub fn on(&self, summary: &Summary) -> Result<Solution, SummaryError> {
        self.identity.same_as(&summary.identity)?;
        let law = if self.layout.extra > 0 { FrictionKind::Asymmetric } else { FrictionKind::Symmetric };
        Ok(Solution {
            layout: self.layout,
            identity: summary.identity.clone(),
            shapes: self.shapes.clone(),
            theta: self.theta.clone(),
            weights: self.weights.clone(),
            free: self.free.clone(),
            bands: summary.joint_bands.clone(),
            parts: parts_at(&Reduced::new(summary, law), &self.shapes),
        })
    }
}

/// The columns of each joint and octave at given shapes.
fn parts_at(reduced: &Reduced<'_>, shapes: &[[f64; 2]]) -> Vec<Vec<Part>> {
    let joints = reduced.summary.joints.iter().enumerate();
    joints.map(|(j, o)| o.levels().iter().map(|t| reduced.part(t, j, shapes[j])).collect()).collect()
}

/// Fits the base model to reduced logs.
#[must_use]
pub fn solve_reduced(summary: &Summary, law: FrictionKind) -> Solution {
    let reduced = Reduced::new(summary, law);
    let done = variable_projection(&reduced, &[], None);
    Solution {
        layout: reduced.layout,
        identity: summary.identity.clone(),
        parts: parts_at(&reduced, &done.shapes),
        shapes: done.shapes,
        theta: done.theta,
        weights: done.weights,
        free: done.free,
        bands: summary.joint_bands.clone(),
    }
}

/// A factor whose columns are those of the model, the torque last.
#[derive(Debug)]
pub(super) struct Part {
    /// By model column, then the torque: a column of the factor.
    pub(super) columns: Vec<Vec<f64>>,
    /// Index in the layout by model column.
    pub(super) global: Vec<usize>,
    pub(super) rows: u64,
}

impl Part {
    /// Sum of squares of y − A·θ.
    pub(super) fn left(&self, theta: &[f64]) -> f64 {
        let Some((torque, columns)) = self.columns.split_last() else { return 0.0 };
        let mut left = torque.clone();
        for (column, g) in columns.iter().zip(&self.global) {
            let value = theta[*g];
            if value != 0.0 {
                left.iter_mut().zip(column).for_each(|(l, c)| *l -= value * c);
            }
        }
        left.iter().map(|l| l * l).sum()
    }

    /// Adds the products times a weight.
    pub(super) fn add_to(&self, sum: &mut NormalEquations, weight: f64) {
        let Some((torque, columns)) = self.columns.split_last() else { return };
        sum.add_columns(&self.global, columns, torque, weight);
    }
}

/// Reduced logs as rows of a fit.
struct Reduced<'a> {
    summary: &'a Summary,
    columns: Columns,
    layout: Layout,
    /// By joint: the factor of all rows, and of what is slower than the means of weights.
    totals: Vec<[RFactor; 2]>,
}

impl Reduced<'_> {
    fn new(summary: &Summary, law: FrictionKind) -> Reduced<'_> {
        let dof = summary.joints.len();
        let columns = summary.columns();
        let totals = summary
            .joints
            .iter()
            .map(|octaves| {
                let mut slow = RFactor::new(columns.width());
                octaves.levels()[SLOW..].iter().for_each(|level| slow.merge(level));
                [octaves.total(), slow]
            })
            .collect();
        let extra = if law == FrictionKind::Asymmetric { dof } else { 0 };
        Reduced { summary, columns, layout: Layout { inertial: columns.inertial, dof, extra }, totals }
    }

    fn steepness(&self, joint: usize) -> &Steepness {
        &self.summary.identity.steepness[joint]
    }

    /// The combination of a factor's saturating columns.
    fn saturating(&self, factor: &RFactor, weights: &[f64; NODES]) -> Vec<f64> {
        let mut out = vec![0.0; factor.width()];
        for (k, w) in weights.iter().enumerate() {
            out.iter_mut().zip(factor.column(self.columns.node(k))).for_each(|(o, c)| *o += w * c);
        }
        out
    }

    /// The model's columns of a joint's factor.
    fn part(&self, factor: &RFactor, joint: usize, shape: [f64; 2]) -> Part {
        let (mut columns, mut global) = (Vec::new(), Vec::new());
        for c in 0..self.layout.inertial {
            // Links inside a joint do not load it.
            if factor.column(c).iter().any(|x| *x != 0.0) {
                columns.push(factor.column(c).to_vec());
                global.push(c);
            }
        }
        if factor.rows() > 0 {
            let steepness = self.steepness(joint);
            let [g2, g4] = shape;
            let friction: [Vec<f64>; FRICTION] = [
                self.saturating(factor, &steepness.weights(g2)),
                self.saturating(factor, &steepness.weights(g4)),
                factor.column(self.columns.viscous()).to_vec(),
                self.saturating(factor, &steepness.slopes(g2)),
                self.saturating(factor, &steepness.slopes(g4)),
            ];
            for (k, column) in friction.into_iter().enumerate() {
                columns.push(column);
                global.push(self.layout.friction(joint, k));
            }
            if self.layout.extra > 0 {
                columns.push(factor.column(self.columns.constant()).to_vec());
                global.push(self.layout.extra(joint));
            }
        }
        columns.push(factor.column(self.columns.torque()).to_vec());
        Part { columns, global, rows: factor.rows() }
    }
}

impl SeparableRows for Reduced<'_> {
    /// By joint: all rows, and the slow ones.
    type At = Vec<[Part; 2]>;

    fn layout(&self) -> Layout {
        self.layout
    }

    fn moves(&self, joint: usize) -> bool {
        self.summary.joints[joint].rows() > 0
    }

    fn range(&self, joint: usize) -> (f64, f64) {
        self.steepness(joint).range()
    }

    fn power(&self, joint: usize) -> f64 {
        let [all, _] = &self.totals[joint];
        let torque = all.column(self.columns.torque());
        dot(torque, torque) / all.rows().max(1) as f64
    }

    fn at(&self, shapes: &[[f64; 2]]) -> Vec<[Part; 2]> {
        self.totals
            .iter()
            .enumerate()
            .map(|(j, factors)| factors.each_ref().map(|f| self.part(f, j, shapes[j])))
            .collect()
    }

    fn products(&self, at: &Vec<[Part; 2]>, weights: &[f64]) -> NormalEquations {
        let mut sum = NormalEquations::zero(self.layout.size());
        for ([all, _], weight) in at.iter().zip(weights) {
            all.add_to(&mut sum, *weight);
        }
        sum
    }

    fn trials(&self, at: &Vec<[Part; 2]>, joint: usize, steep: &[f64]) -> Trials {
        let [factor, _] = &self.totals[joint];
        let [all, _] = &at[joint];
        let trial: Vec<Vec<f64>> =
            steep.iter().map(|g| self.saturating(factor, &self.steepness(joint).weights(*g))).collect();
        let torque = factor.column(self.columns.torque());
        let mut cross = Mat::zeros(self.layout.size(), steep.len());
        for (column, g) in all.columns.iter().zip(&all.global) {
            trial.iter().enumerate().for_each(|(k, t)| cross[(*g, k)] = dot(column, t));
        }
        Trials {
            cross,
            square: Mat::from_fn(steep.len(), steep.len(), |a, b| dot(&trial[a], &trial[b])),
            score: trial.iter().map(|t| dot(t, torque)).collect(),
        }
    }

    fn scatter(&self, at: &Vec<[Part; 2]>, theta: &[f64]) -> Scatter {
        let mut scatter = Scatter::default();
        for [all, slow] in at {
            let mean = |part: &Part| part.left(theta) / part.rows.max(1) as f64;
            let power = mean(all);
            let enough = slow.rows >= 5 && power > 0.0;
            scatter.sigma.push(power.sqrt());
            scatter.inflation.push(if enough { (mean(slow) / power).max(1.0) } else { 1.0 });
        }
        scatter
    }
}

const _: () = assert!(SLOW < OCTAVES);
