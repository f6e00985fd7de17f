//! How well a fit is known, all coefficients together, and what they weigh along its logs: what a comparison
//! of two fits needs beside their values.

use super::distribution::freedom_of;
use super::errors::StandardErrors;
use super::friction_shape::tangent;
use super::reduced::Solution;
use super::rows::FRICTION;
use serde::{Deserialize, Serialize};

/// The covariance of a fit's coefficients. Their order: the minimal set; five a joint, which are the levels
/// γ1 and γ3, γ5, and the tangents γ1·Δln γ2 and γ3·Δln γ4; a constant torque a joint where the friction law
/// has one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// The names of the minimal set.
    pub parameters: Vec<String>,
    /// Joints n.
    pub joints: usize,
    /// Lower triangle by rows, SI units.
    pub covariance: Vec<Vec<f64>>,
    /// Degrees of freedom of each coefficient's standard error; 0 where the logs do not determine it, or
    /// where it is at its bound.
    pub freedom: Vec<f64>,
    /// By joint: the fitted logs in the eyes of the model.
    pub path: Vec<Path>,
}

/// What the coefficients weigh in the torque of one joint along logs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// The coefficients that load the joint, as places in the order of [`Uncertainty`].
    pub columns: Vec<usize>,
    /// Mean products of their columns, lower triangle by rows.
    pub products: Vec<Vec<f64>>,
    /// Mean square of the joint's torque, (N·m)².
    pub torque: f64,
}

impl Uncertainty {
    /// That of a solution of the minimal set `names`.
    #[must_use]
    pub fn of(names: &[String], solution: &Solution, errors: &StandardErrors) -> Uncertainty {
        let layout = solution.layout;
        let lower = |i: usize| (0..=i).map(|k| errors.covariance[(i, k)]).collect();
        let freedom = |c: usize| errors.std[c].map_or(0.0, |_| freedom_of(errors.quantile[c]));
        Uncertainty {
            parameters: names.to_vec(),
            joints: layout.dof,
            covariance: (0..layout.size()).map(lower).collect(),
            freedom: (0..layout.size()).map(freedom).collect(),
            path: (0..layout.dof).map(|j| path(solution, j)).collect(),
        }
    }

    /// The place of a joint's friction coefficient, 0 to 4.
    #[must_use]
    pub fn friction(&self, joint: usize, which: usize) -> usize {
        self.parameters.len() + FRICTION * joint + which
    }

    /// The place of a joint's constant torque, where the law has one.
    #[must_use]
    pub fn constant(&self, joint: usize) -> Option<usize> {
        let at = self.parameters.len() + FRICTION * self.joints + joint;
        (at < self.freedom.len()).then_some(at)
    }

    /// The covariance of two coefficients.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance.get(a.max(b)).and_then(|row| row.get(a.min(b))).copied().unwrap_or(0.0)
    }

    /// Whether the parts fit together: a file may have been changed by hand.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let least = self.parameters.len() + FRICTION * self.joints;
        let size = self.freedom.len();
        let rows = |rows: &[Vec<f64>], size: usize| {
            rows.len() == size && rows.iter().enumerate().all(|(i, row)| row.len() == i + 1)
        };
        let path = |p: &Path| rows(&p.products, p.columns.len()) && p.columns.iter().all(|c| *c < size);
        (size == least || size == least + self.joints)
            && rows(&self.covariance, size)
            && self.path.len() == self.joints
            && self.path.iter().all(path)
    }
}

/// Eq. 16's columns of a joint at one velocity, and those of the tangents of its steepnesses: what the
/// coefficients of [`Uncertainty`] are multiplied with, free of units but for γ5's.
#[must_use]
pub fn friction_row([gamma2, gamma4]: [f64; 2], velocity: f64) -> [f64; FRICTION] {
    let saturating = |gamma: f64| (gamma * velocity).tanh();
    [saturating(gamma2), saturating(gamma4), velocity, tangent(gamma2, velocity), tangent(gamma4, velocity)]
}

fn path(solution: &Solution, joint: usize) -> Path {
    let parts = &solution.parts[joint];
    let rows: u64 = parts.iter().map(|part| part.rows).sum();
    if rows == 0 {
        return Path::default();
    }
    let mut sum = super::normal_equations::zeros(solution.layout.size());
    parts.iter().for_each(|part| part.add_to(&mut sum, 1.0 / rows as f64));
    let (gram, _, torque) = sum;
    let columns: Vec<usize> = (0..solution.layout.size()).filter(|c| gram[(*c, *c)] > 0.0).collect();
    let row = |i: usize| (0..=i).map(|k| gram[(columns[i], columns[k])]).collect();
    let products = (0..columns.len()).map(row).collect();
    Path { columns, products, torque }
}
