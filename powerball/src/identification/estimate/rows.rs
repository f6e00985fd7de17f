//! Rows of a regression whose friction steepnesses are free, whatever they are kept in.

use super::solve::Products;
use crate::logs::regression::Data;
pub(super) use crate::logs::regression::FRICTION;
use faer::Mat;

/// Where a coefficient stands: the minimal set, five friction columns a joint, further columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Inertial columns.
    pub inertial: usize,
    /// Joints.
    pub dof: usize,
    /// Further columns.
    pub extra: usize,
}

impl Layout {
    /// That of some data's rows.
    #[must_use]
    pub fn of(data: &Data<'_>, extra: usize) -> Layout {
        let (dof, set) = (data.dof(), data.inertial_columns());
        Layout { inertial: if data.per_joint { dof * set } else { set }, dof, extra }
    }

    /// Columns in all.
    #[must_use]
    pub fn size(&self) -> usize {
        self.inertial + FRICTION * self.dof + self.extra
    }

    /// Index of a joint's friction column: the levels γ1, γ3, the viscous γ5, the tangents of γ2, γ4.
    #[must_use]
    pub fn friction(&self, joint: usize, which: usize) -> usize {
        self.inertial + FRICTION * joint + which
    }

    /// Index of a further column.
    #[must_use]
    pub fn extra(&self, which: usize) -> usize {
        self.inertial + FRICTION * self.dof + which
    }

    /// Whether a column is a tangent of a shape, whose coefficient is no parameter.
    #[must_use]
    pub fn is_tangent(&self, column: usize) -> bool {
        column.checked_sub(self.inertial).is_some_and(|f| f < FRICTION * self.dof && f % FRICTION >= 3)
    }

    /// γ1 … γ5 of a joint from all coefficients and its steepnesses.
    #[must_use]
    pub fn gamma(&self, theta: &[f64], joint: usize, shape: [f64; 2]) -> [f64; 5] {
        let level = |k| theta[self.friction(joint, k)];
        [level(0), shape[0], level(1), shape[1], level(2)]
    }

    /// The columns whose coefficients must not be negative: friction's, so that it dissipates.
    pub(super) fn levels(&self) -> Vec<usize> {
        (0..self.dof).flat_map(|j| [0, 1, 2].map(|k| self.friction(j, k))).collect()
    }
}

/// How a model misses its rows, by joint.
#[derive(Clone, Debug, Default)]
pub(super) struct Scatter {
    /// rms of the residual, N·m.
    pub sigma: Vec<f64>,
    /// How many times the variance of slow means exceeds that of independent samples, at least 1.
    pub inflation: Vec<f64>,
}

/// Cross products of trial columns on one joint, by trial.
#[derive(Debug)]
pub(super) struct Trials {
    /// With the columns of all rows, columns × trials.
    pub cross: Mat<f64>,
    /// With each other.
    pub square: Mat<f64>,
    /// With the torque.
    pub score: Vec<f64>,
}

/// Rows of a regression whose friction steepnesses are free.
pub(super) trait Rows: Sync {
    /// The columns at given steepnesses.
    type At;
    /// Their order.
    fn layout(&self) -> Layout;
    /// Whether a joint has rows.
    fn moves(&self, joint: usize) -> bool;
    /// The steepnesses that a joint may take, s/rad.
    fn range(&self, joint: usize) -> (f64, f64);
    /// Mean square of a joint's torque.
    fn power(&self, joint: usize) -> f64;
    /// The columns at γ2, γ4 of each joint.
    fn at(&self, shapes: &[[f64; 2]]) -> Self::At;
    /// Their cross products, summed over joints.
    fn products(&self, at: &Self::At, weights: &[f64]) -> Products;
    /// Cross products of one joint's columns tanh(γ·q̇) for some γ with all others, with each other and with
    /// the torque.
    fn trials(&self, at: &Self::At, joint: usize, steep: &[f64]) -> Trials;
    /// What coefficients leave.
    fn scatter(&self, at: &Self::At, theta: &[f64]) -> Scatter;
}
