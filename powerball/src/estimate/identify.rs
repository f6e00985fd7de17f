//! A fit in the words of a model: values with standard errors that hold for coloured residuals.

use super::design::FRICTION;
use super::fit::Fit;
use super::solve::Solver;
use crate::regression::Data;
use serde::{Deserialize, Serialize};

/// A parameter with its standard error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// Its name: the sum it stands for.
    pub name: String,
    /// Its value, SI units.
    pub value: f64,
    /// Standard error from independent blocks; `None` where the logs do not determine the parameter.
    pub std: Option<f64>,
    /// Standard error over |value|.
    pub relative_std: Option<f64>,
}

/// Eq. 16 of a joint with standard errors of γ1 … γ5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointFriction {
    /// Joint, from 1.
    pub joint: usize,
    /// γ1, N·m.
    pub gamma1: f64,
    /// γ2, s/rad.
    pub gamma2: f64,
    /// γ3, N·m.
    pub gamma3: f64,
    /// γ4, s/rad.
    pub gamma4: f64,
    /// γ5, N·m·s/rad.
    pub gamma5: f64,
    /// Standard errors of γ1 … γ5; null where not determined or at a bound.
    #[serde(default)]
    pub std: [Option<f64>; 5],
}

/// The parameters of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct Identified {
    /// The minimal set.
    pub parameters: Vec<ParameterEstimate>,
    /// Friction by joint.
    pub friction: Vec<JointFriction>,
}

/// How large an error is, by joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// rms of the error, N·m.
    pub rms: Vec<f64>,
    /// rms of the error over rms of the measured torque.
    pub relative: Vec<f64>,
    /// Samples in the band, of all joints' rows the most.
    pub samples: usize,
}

/// The spread of residuals on their data.
#[must_use]
pub fn spread(data: &Data<'_>, residual: &[Vec<f64>]) -> Spread {
    // A sum over nothing is -0 and would print so.
    let rms = |x: &[f64]| (x.iter().fold(0.0, |sum, v| sum + v * v) / x.len().max(1) as f64).sqrt();
    let errors: Vec<f64> = residual.iter().map(|r| rms(r)).collect();
    let relative = errors
        .iter()
        .zip(&data.joints)
        .map(|(e, joint)| {
            let measured = rms(&joint.torque);
            if measured > 0.0 { e / measured } else { 0.0 }
        })
        .collect();
    Spread { rms: errors, relative, samples: data.joints.iter().map(|j| j.len()).max().unwrap_or(0) }
}

/// Values and cluster-robust standard errors: the sandwich with blocks of [`crate::regression::Block`] as clusters.
#[must_use]
pub fn identify(data: &Data<'_>, fit: &Fit) -> Identified {
    let design = &fit.design;
    let (gram, _, _) = fit.gram.sum(&fit.weights, |_| true);
    let solver = Solver::new(&gram, |c| fit.free[c]);
    let mut variance = vec![0.0; design.size];
    let mut clusters = 0.0;
    for block in &data.blocks {
        let mut score = vec![0.0; design.size];
        for (j, rows) in block.rows.iter().enumerate() {
            for (g, value) in design.cross(j, rows, &[fit.residual[j].as_slice()]) {
                score[g] += fit.weights[j] * value[0];
            }
        }
        for (v, x) in variance.iter_mut().zip(solver.solve(&score)) {
            *v += x * x;
        }
        clusters += 1.0;
    }
    let small = if clusters > 1.0 { clusters / (clusters - 1.0) } else { 1.0 };
    let std = |c: usize| solver.kept().contains(&c).then(|| (small * variance[c]).sqrt());
    let parameters = data
        .body
        .names()
        .iter()
        .enumerate()
        .map(|(c, name)| {
            let (value, std) = (fit.theta[c], std(c));
            let relative_std = std.filter(|_| value != 0.0).map(|s| s / value.abs());
            ParameterEstimate { name: name.clone(), value, std, relative_std }
        })
        .collect();
    let friction = (0..data.dof())
        .map(|j| {
            let [gamma1, gamma2, gamma3, gamma4, gamma5] = fit.friction(j);
            let at = |k: usize| design.friction(j, k);
            // The tangent's coefficient is level · Δ ln γ.
            let shape = |k: usize, gamma: f64| {
                let level = fit.theta[at(k)];
                std(at(3 + k)).filter(|_| level > 0.0).map(|s| s / level * gamma)
            };
            debug_assert_eq!(FRICTION, 5);
            JointFriction {
                joint: j + 1,
                gamma1,
                gamma2,
                gamma3,
                gamma4,
                gamma5,
                std: [std(at(0)), shape(0, gamma2), std(at(1)), shape(1, gamma4), std(at(2))],
            }
        })
        .collect();
    Identified { parameters, friction }
}
