//! A fit whose parameters a real arm can have, and what that costs.

use super::consistent::{Consistent, nearest};
use super::fit::Fit;
use super::identify::{Spread, spread};
use super::solve::{Solver, bounded};
use crate::regression::Data;
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
    pub fit: Spread,
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

/// The consistent parameters nearest to a fit in its own χ², friction refitted with every step: dissipative, as in the fit.
///
/// # Errors
/// As [`nearest`].
pub fn consistent_fit(data: &Data<'_>, fit: &Fit) -> Result<ConsistentFit, Error> {
    let design = &fit.design;
    let p = design.inertial;
    let (gram, right, _) = fit.gram.sum(&fit.weights, |_| true);
    // χ² as a function of the inertial parameters alone, all other columns refitted: a Schur complement.
    let others = Solver::new(&gram, |c| c >= p && fit.free[c]);
    let mut metric = Mat::<f64>::zeros(p, p);
    for k in 0..p {
        let column: Vec<f64> = (0..design.size).map(|c| if c >= p { gram[(c, k)] } else { 0.0 }).collect();
        let moved = others.solve(&column);
        for i in 0..p {
            metric[(i, k)] = gram[(i, k)] - (p..design.size).map(|c| gram[(c, i)] * moved[c]).sum::<f64>();
        }
    }
    let metric = Mat::from_fn(p, p, |i, k| 0.5 * (metric[(i, k)] + metric[(k, i)]));
    let consistent = nearest(data.body.model(), SetKind::Minimal, fit.inertial(), &metric)?;
    let rest: Vec<f64> = (0..design.size)
        .map(|c| right[c] - (0..p).map(|k| gram[(c, k)] * consistent.set[k]).sum::<f64>())
        .collect();
    let levels: Vec<usize> = (0..data.dof()).flat_map(|j| [0, 1, 2].map(|k| design.friction(j, k))).collect();
    let tangent =
        |c: usize| (0..data.dof()).any(|j| c == design.friction(j, 3) || c == design.friction(j, 4));
    let (mut theta, _) = bounded(&gram, &rest, |c| c >= p && !tangent(c), &levels);
    theta[..p].copy_from_slice(&consistent.set);
    Ok(ConsistentFit { consistent, theta })
}

impl ConsistentFit {
    /// The residual on the data that were fitted.
    #[must_use]
    pub fn residual(&self, data: &Data<'_>, fit: &Fit) -> Vec<Vec<f64>> {
        let joint = |j: usize| -> Vec<f64> {
            let predicted = fit.design.predict(j, &self.theta);
            data.joints[j].torque.iter().zip(predicted).map(|(y, p)| y - p).collect()
        };
        (0..data.dof()).map(joint).collect()
    }

    /// In the words of a report.
    #[must_use]
    pub fn report(&self, data: &Data<'_>, fit: &Fit) -> ConsistentReport {
        let error = spread(data, &self.residual(data, fit));
        let free = spread(data, &fit.residual);
        let arm = data.body.arm();
        let kept = arm.kept_parameters();
        ConsistentReport {
            parameters: kept.iter().map(|p| (p.to_string(), self.consistent.all[p.index()])).collect(),
            friction: (0..data.dof())
                .map(|j| {
                    let level = |k| self.theta[fit.design.friction(j, k)];
                    let [g2, g4] = fit.shapes[j];
                    [level(0), g2, level(1), g4, level(2)]
                })
                .collect(),
            cost: error
                .rms
                .iter()
                .zip(&free.rms)
                .map(|(a, b)| if *b > 0.0 { a / b - 1.0 } else { 0.0 })
                .collect(),
            fit: error,
            distance: self.consistent.distance,
            gap: self.consistent.gap,
            eigenvalues: self.consistent.eigenvalues.clone(),
            without_body: self.consistent.without_body.iter().map(|l| l + 1).collect(),
        }
    }
}
