//! A fit whose parameters a real arm can have, and what that costs.

use super::consistent::{Consistent, nearest};
use super::estimates::{ResidualStats, stats_of};
use super::reduced::Solution;
use super::solve::{Solver, bounded};
use crate::logs::regression::RigidArm;
use dyngen::{Error, SetKind};
use faer::Mat;
use serde::Serialize;
use std::collections::BTreeMap;

/// A physically consistent fit.
#[derive(Debug)]
pub struct ConsistentFit {
    /// The parameters and their certificate.
    pub consistent: Consistent,
    /// All coefficients in the order of the design: the consistent set, and the friction refitted beside it.
    pub theta: Vec<f64>,
}

/// The consistent fit as it is reported.
#[derive(Clone, Debug, Serialize)]
pub struct ConsistentReport {
    /// Every parameter of the arm: a body for each link.
    pub parameters: BTreeMap<String, f64>,
    /// γ1 … γ5 by joint.
    pub friction: Vec<[f64; 5]>,
    /// Error of the fit.
    pub fit: ResidualStats,
    /// rms of this fit over rms of the unconstrained one, less one, by joint.
    pub cost: Vec<f64>,
    /// How far the unconstrained parameters are from any real arm's, in units of χ².
    pub distance: f64,
    /// How much nearer a real arm could be at most, in the same units.
    pub gap: f64,
    /// Smallest eigenvalue of each link's pseudo-inertia: above zero where a body exists.
    pub eigenvalues: Vec<f64>,
    /// Links, from 1, whose declared symmetries no body can have.
    pub without_body: Vec<usize>,
}

/// The consistent parameters nearest to a solution in its own χ², friction refitted with every step:
/// dissipative, as in the fit.
///
/// # Errors
/// As [`nearest`].
pub fn consistent_fit(body: &RigidArm, solution: &Solution) -> Result<ConsistentFit, Error> {
    let layout = solution.layout;
    let (p, size) = (layout.inertial, layout.size());
    let (gram, right, _) = solution.products();
    // χ² as a function of the inertial parameters alone, all other columns refitted: a Schur complement.
    let others = Solver::new(&gram, |c| c >= p && solution.free[c]);
    let mut metric = Mat::<f64>::zeros(p, p);
    for k in 0..p {
        let column: Vec<f64> = (0..size).map(|c| if c >= p { gram[(c, k)] } else { 0.0 }).collect();
        let moved = others.solve(&column);
        for i in 0..p {
            metric[(i, k)] = gram[(i, k)] - (p..size).map(|c| gram[(c, i)] * moved[c]).sum::<f64>();
        }
    }
    let metric = Mat::from_fn(p, p, |i, k| 0.5 * (metric[(i, k)] + metric[(k, i)]));
    let consistent = nearest(body.model(), SetKind::Minimal, solution.inertial(), &metric)?;
    let rest: Vec<f64> =
        (0..size).map(|c| right[c] - (0..p).map(|k| gram[(c, k)] * consistent.set[k]).sum::<f64>()).collect();
    let (mut theta, _) = bounded(&gram, &rest, |c| c >= p && !layout.is_tangent(c), &layout.levels());
    theta[..p].copy_from_slice(&consistent.set);
    Ok(ConsistentFit { consistent, theta })
}

impl ConsistentFit {
    /// In the words of a report.
    #[must_use]
    pub fn report(&self, body: &RigidArm, solution: &Solution) -> ConsistentReport {
        let error = stats_of(solution, &self.theta);
        let free = stats_of(solution, &solution.theta);
        let ratio = |(a, b): (&f64, &f64)| if *b > 0.0 { a / b - 1.0 } else { 0.0 };
        ConsistentReport {
            parameters: body
                .arm()
                .kept_parameters()
                .iter()
                .map(|p| (p.to_string(), self.consistent.all[p.index()]))
                .collect(),
            friction: (0..solution.layout.dof)
                .map(|j| solution.layout.gamma(&self.theta, j, solution.shapes[j]))
                .collect(),
            cost: error.rms.iter().zip(&free.rms).map(ratio).collect(),
            fit: error,
            distance: self.consistent.distance,
            gap: self.consistent.gap,
            eigenvalues: self.consistent.eigenvalues.clone(),
            without_body: self.consistent.without_body.iter().map(|l| l + 1).collect(),
        }
    }
}
