//! The physically consistent parameters that are nearest to given values of a set.
//!
//! A body exists for a link's ten parameters exactly where its pseudo-inertia P is positive semi-definite
//! (Wensing, Kim and Slotine 2018). A link that carries the next joint's rotor has that rotor's mass in its
//! own parameters, so what is left of it without a ring of the inertia Iₘ about the joint's axis must be a
//! body: otherwise B(q) could be negative through Eq. 5's coupling although every link by itself is possible.
//! Among all full parameter vectors π of such bodies and rotors of inertia ≥ 0, the one is sought whose sums
//! K·π come nearest to the given values in a metric G: a convex problem,
//!
//! minimise ½·(Kπ − θ)ᵀ·G·(Kπ − θ) + μ·Σ (tr(P₀⁻¹·P) − ln det P) + μ·Σ (Iₘ/Iₘ₀ − ln Iₘ),
//!
//! solved by Newton's method for a falling μ. The barrier keeps P definite and, through its trace, draws
//! parameters that the values do not determine towards an ordinary body P₀ (entropic regularisation, Lee,
//! Wensing and Park 2019). The certificate is the barrier's: the value found exceeds the least possible one
//! by at most μ times the number of barrier dimensions.
//!
//! The module also makes a fit whose parameters a real arm can have, with the rise of its error, and the
//! metric between values of a parameter set, in torque.

use super::bounded::bounded;
use super::estimates::{ResidualStats, stats_of};
use super::reduced::Solution;
use super::solve::{NormalEquations, Solver, dot};
use chacha20::ChaCha8Rng;
use dyngen::arm::{Arm, Convention, Parameter, ParameterKind};
use dyngen::consistency::pseudo_inertia;
use dyngen::{Error, Evaluator, Function, Model, SetKind};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use nalgebra::Matrix4;
use powerball_logs::regression::RigidArm;
use rand::{RngExt, SeedableRng};
use serde::Serialize;
use std::collections::BTreeMap;

/// Dynamic parameters of a link.
const PER_LINK: usize = ParameterKind::ALL.len();

/// Consistent parameters with their certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct Consistent {
    /// All eleven parameters a link, in the order of `Arm::all_parameters`, SI units.
    pub all: Vec<f64>,
    /// The set's values that they give.
    pub set: Vec<f64>,
    /// (Kπ − θ)ᵀ·G·(Kπ − θ): how far the given values were from any real arm's, in units of the metric.
    pub distance: f64,
    /// How much nearer another real arm could be at most, in the same units.
    pub gap: f64,
    /// The smallest eigenvalue of each link's pseudo-inertia.
    pub eigenvalues: Vec<f64>,
    /// Links whose declared zeros no body can have; they were left as they came out.
    pub without_body: Vec<usize>,
}

/// The ordinary body: mass, kg, and radius of gyration, m; and the ordinary rotor's inertia seen at the
/// joint, kg·m².
const MASS: f64 = 2.0;
const RADIUS: f64 = 0.1;
const ROTOR: f64 = 0.1;
/// First and last weight of the barrier, and the factor from one to the next. At the last one the certificate
/// is a hundredth of what a standard error is for a metric in units of χ².
const FIRST: f64 = 100.0;
const LAST: f64 = 1e-4;
const FALL: f64 = 0.2;
/// Newton steps for each weight at most.
const STEPS: usize = 40;

/// A link's body: the columns of its parameters, and what a unit of each puts into its pseudo-inertia.
struct Link {
    parts: Vec<(usize, Matrix4<f64>)>,
}

/// The nearest consistent parameters to `values` of a set; `metric` is symmetric, positive semi-definite, one
/// row a value.
///
/// # Errors
/// Those of [`Model::set`].
pub fn nearest(model: &Model, kind: SetKind, values: &[f64], metric: &Mat<f64>) -> Result<Consistent, Error> {
    let arm = model.arm();
    let set = model.set(kind)?;
    let kept: Vec<Parameter> = arm.kept_parameters();
    let mut sums = Mat::<f64>::zeros(values.len(), kept.len());
    for (row, parameter) in set.parameters.iter().enumerate() {
        for (p, c) in &parameter.terms {
            if let Some(k) = kept.iter().position(|k| k == p) {
                sums[(row, k)] += model.sets().field.value(c);
            }
        }
    }
    let (problem, mut x, without_body) = ordinary_arm(arm, &kept, sums, metric);
    let mut weight = FIRST;
    loop {
        problem.descend(&mut x, values, metric, weight);
        if weight <= LAST {
            break;
        }
        weight = (weight * FALL).max(LAST);
    }
    let set_values = times(&problem.sums, &x);
    let miss: Vec<f64> = set_values.iter().zip(values).map(|(a, b)| a - b).collect();
    let mut all = vec![0.0; arm.all_parameters().len()];
    for (p, value) in kept.iter().zip(&x) {
        all[p.index()] = *value;
    }
    let eigenvalues = all
        .chunks_exact(PER_LINK)
        .filter_map(|link| link.first_chunk::<10>())
        .map(|link| pseudo_inertia(link).symmetric_eigenvalues().min())
        .collect();
    Ok(Consistent {
        distance: dot(&miss, &times(metric, &miss)),
        // ½ of the distance is what the barrier's bound holds for.
        gap: 2.0 * weight * (4 * problem.links.len() + problem.rotors.len()) as f64,
        all,
        set: set_values,
        eigenvalues,
        without_body,
    })
}

/// The problem and where its descent starts: an arm of ordinary bodies. The last value has the links to which
/// the kept parameters give no body.
fn ordinary_arm(
    arm: &Arm,
    kept: &[Parameter],
    sums: Mat<f64>,
    metric: &Mat<f64>,
) -> (Problem, Vec<f64>, Vec<usize>) {
    let column = |p: &Parameter| kept.iter().position(|k| k == p);
    let mut problem =
        Problem { curvature: sums.transpose() * metric * &sums, sums, links: Vec::new(), rotors: Vec::new() };
    let mut x = vec![0.0; kept.len()];
    let mut without_body = Vec::new();
    for link in 0..arm.bodies() {
        let mut parts: Vec<(usize, Matrix4<f64>)> = ParameterKind::ALL[..10]
            .iter()
            .enumerate()
            .filter_map(|(i, kind)| {
                let mut unit = [0.0; 10];
                unit[i] = 1.0;
                Some((column(&Parameter { link, kind: *kind })?, pseudo_inertia(&unit)))
            })
            .collect();
        // An ordinary body at the origin has a mass and equal moments of inertia.
        for (kind, value) in [
            (ParameterKind::M, MASS),
            (ParameterKind::Ixx, 2.0 * MASS * RADIUS * RADIUS),
            (ParameterKind::Iyy, 2.0 * MASS * RADIUS * RADIUS),
            (ParameterKind::Izz, 2.0 * MASS * RADIUS * RADIUS),
        ] {
            if let Some(k) = column(&Parameter { link, kind }) {
                x[k] = value;
            }
        }
        if let Some(k) = column(&Parameter { link: link + 1, kind: ParameterKind::Im }) {
            parts.push((k, ring(arm, link + 1) * -1.0));
        }
        let body = Link { parts };
        if body.matrix(&x).cholesky().is_some() {
            problem.links.push(body);
        } else {
            without_body.push(link);
        }
        if let Some(k) = column(&Parameter { link, kind: ParameterKind::Im }) {
            let ratio = arm.joints[link].rotor_ratio.as_ref().map_or(1.0, dyngen::exact::rational::to_f64);
            let ordinary = ROTOR / (ratio * ratio);
            // The ordinary body at the link before can hold this much.
            x[k] = ordinary.min(0.1 * MASS * RADIUS * RADIUS);
            problem.rotors.push((k, ordinary));
        }
    }
    (problem, x, without_body)
}

/// The pseudo-inertia of a rotor of unit inertia on the link before: a ring about the joint's axis, in that
/// link's frame.
fn ring(arm: &Arm, joint: usize) -> Matrix4<f64> {
    let axis = match arm.convention {
        Convention::Standard => [0.0, 0.0, 1.0],
        Convention::Modified => {
            let (sine, cosine) = arm.joints[joint].alpha.radians().sin_cos();
            [0.0, -sine, cosine]
        }
    };
    Matrix4::from_fn(|i, k| match (i < 3 && k < 3, i == k) {
        (true, same) => 0.5 * (f64::from(u8::from(same)) - axis[i] * axis[k]),
        _ => 0.0,
    })
}

impl Link {
    fn matrix(&self, x: &[f64]) -> Matrix4<f64> {
        self.parts.iter().fold(Matrix4::zeros(), |sum, (k, part)| sum + part * x[*k])
    }
}

/// The convex problem over the kept parameters.
struct Problem {
    /// K
    sums: Mat<f64>,
    /// Kᵀ·G·K
    curvature: Mat<f64>,
    links: Vec<Link>,
    /// Column and ordinary inertia.
    rotors: Vec<(usize, f64)>,
}

impl Problem {
    /// The function at x; infinite outside.
    fn value(&self, x: &[f64], values: &[f64], metric: &Mat<f64>, weight: f64) -> f64 {
        let miss: Vec<f64> = times(&self.sums, x).iter().zip(values).map(|(a, b)| a - b).collect();
        let mut barrier = 0.0;
        for link in &self.links {
            let p = link.matrix(x);
            let Some(factor) = p.cholesky() else { return f64::INFINITY };
            let logarithm: f64 = factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
            barrier += ordinary_inverse().dot(&p) - logarithm;
        }
        for (k, ordinary) in &self.rotors {
            if x[*k] <= 0.0 {
                return f64::INFINITY;
            }
            barrier += x[*k] / ordinary - x[*k].ln();
        }
        0.5 * dot(&miss, &times(metric, &miss)) + weight * barrier
    }

    /// Newton's method from a point inside.
    fn descend(&self, x: &mut Vec<f64>, values: &[f64], metric: &Mat<f64>, weight: f64) {
        let mut value = self.value(x, values, metric, weight);
        for _ in 0..STEPS {
            let miss: Vec<f64> = times(&self.sums, x).iter().zip(values).map(|(a, b)| a - b).collect();
            let mut slope = times_transposed(&self.sums, &times(metric, &miss));
            let mut curve = self.curvature.clone();
            for link in &self.links {
                let Some(inverse) = link.matrix(x).try_inverse() else { return };
                let turned: Vec<(usize, Matrix4<f64>)> =
                    link.parts.iter().map(|(k, part)| (*k, inverse * part)).collect();
                for ((k, a), (_, part)) in turned.iter().zip(&link.parts) {
                    slope[*k] += weight * (ordinary_inverse().dot(part) - a.trace());
                    for (l, b) in &turned {
                        curve[(*k, *l)] += weight * a.transpose().dot(b);
                    }
                }
            }
            for (k, ordinary) in &self.rotors {
                slope[*k] += weight * (1.0 / ordinary - 1.0 / x[*k]);
                curve[(*k, *k)] += weight / (x[*k] * x[*k]);
            }
            let Some(step) = newton_step(&curve, &slope) else { return };
            let fall = dot(&slope, &step);
            // Half the square of Newton's decrement bounds what is left to gain.
            if fall < 1e-9 * weight {
                return;
            }
            let mut length = 1.0;
            loop {
                let trial: Vec<f64> = x.iter().zip(&step).map(|(a, s)| a - length * s).collect();
                let reached = self.value(&trial, values, metric, weight);
                if reached <= value - 1e-4 * length * fall {
                    (*x, value) = (trial, reached);
                    break;
                }
                length *= 0.5;
                if length < 1e-12 {
                    return;
                }
            }
        }
    }
}

/// H⁻¹·g with every variable scaled to a unit diagonal.
fn newton_step(curve: &Mat<f64>, slope: &[f64]) -> Option<Vec<f64>> {
    let n = slope.len();
    let scale: Vec<f64> = (0..n).map(|i| curve[(i, i)].max(1e-300).sqrt().recip()).collect();
    let scaled =
        Mat::from_fn(n, n, |i, k| curve[(i, k)] * scale[i] * scale[k] + if i == k { 1e-14 } else { 0.0 });
    let right = Mat::from_fn(n, 1, |i, _| slope[i] * scale[i]);
    let solved = scaled.llt(Side::Lower).ok()?.solve(&right);
    let step: Vec<f64> = (0..n).map(|i| solved[(i, 0)] * scale[i]).collect();
    step.iter().all(|s| s.is_finite()).then_some(step)
}

/// P₀⁻¹
fn ordinary_inverse() -> Matrix4<f64> {
    let second = 1.0 / (MASS * RADIUS * RADIUS);
    Matrix4::from_diagonal(&nalgebra::Vector4::new(second, second, second, 1.0 / MASS))
}

fn times(a: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    (0..a.nrows()).map(|i| (0..a.ncols()).map(|k| a[(i, k)] * x[k]).sum()).collect()
}

fn times_transposed(a: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    (0..a.ncols()).map(|k| (0..a.nrows()).map(|i| a[(i, k)] * x[i]).sum()).collect()
}

// A fit whose parameters a real arm can have, and what that costs.

/// A physically consistent fit.
#[derive(Debug)]
pub struct ConsistentFit {
    /// The parameters and their certificate.
    pub consistent: Consistent,
    /// All coefficients in the order of the design: the consistent set, and the friction refitted with it.
    pub theta: Vec<f64>,
}

/// The report on the consistent fit.
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
/// Those of [`nearest`].
pub fn consistent_fit(body: &RigidArm, solution: &Solution) -> Result<ConsistentFit, Error> {
    let layout = solution.layout;
    let (p, size) = (layout.inertial, layout.size());
    let NormalEquations { gram, right, .. } = solution.products();
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
    /// The result in the form of a report.
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

// How far apart values of a parameter set are, in torque.

/// States over which torques are compared.
const STATES: usize = 400;
/// Velocities and accelerations where the arm file gives no limit.
const SPEED: f64 = 1.0;
const ACCELERATION: f64 = 3.0;
/// Weight of a unit of a parameter compared with a N·m: it alone holds directions that no torque shows.
const UNSEEN: f64 = 1e-2;

/// Torque differences of a parameter set's values over random states within an arm's limits.
#[derive(Clone, Debug)]
pub struct TorqueMetric {
    /// By joint: mean of YᵀY over the states, (N·m)² for each unit².
    joints: Vec<Mat<f64>>,
}

impl TorqueMetric {
    /// For a set of an arm; the states are the same at every call.
    ///
    /// # Errors
    /// Those of [`Evaluator::new`].
    pub fn new(model: &Model, kind: SetKind) -> Result<TorqueMetric, Error> {
        let evaluator = Evaluator::new(model, Function::Regressor, kind)?;
        let arm = model.arm();
        let n = arm.dof();
        let p = evaluator.outputs() / n.max(1);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let [mut q, mut v, mut a] = [const { Vec::new() }; 3];
        for _ in 0..STATES {
            for joint in &arm.joints {
                let [low, high] = joint.position.unwrap_or([-std::f64::consts::PI, std::f64::consts::PI]);
                q.push(low + (high - low) * rng.random_range(0.0..1.0));
                v.push(joint.velocity.unwrap_or(SPEED) * rng.random_range(-1.0..1.0));
                a.push(joint.acceleration.unwrap_or(ACCELERATION) * rng.random_range(-1.0..1.0));
            }
        }
        let mut y = vec![0.0; STATES * n * p];
        evaluator.evaluate(&q, &v, &a, &[], &mut y);
        let joint = |j: usize| {
            let rows = Mat::from_fn(STATES, p, |s, c| y[(s * n + j) * p + c]);
            rows.transpose() * &rows * faer::Scale(1.0 / STATES as f64)
        };
        Ok(TorqueMetric { joints: (0..n).map(joint).collect() })
    }

    /// The metric for [`super::nearest`], in which a torque of `noise` N·m counts 1.
    #[must_use]
    pub fn matrix(&self, noise: f64) -> Mat<f64> {
        let p = self.joints.first().map_or(0, Mat::ncols);
        Mat::from_fn(p, p, |i, k| {
            let seen: f64 = self.joints.iter().map(|g| g[(i, k)]).sum();
            (seen + if i == k { UNSEEN * UNSEEN } else { 0.0 }) / (noise * noise)
        })
    }

    /// rms of the torque that a difference of values makes, by joint, N·m.
    #[must_use]
    pub fn rms(&self, difference: &[f64]) -> Vec<f64> {
        let square = |g: &Mat<f64>| -> f64 {
            (0..g.nrows())
                .map(|i| difference[i] * (0..g.ncols()).map(|k| g[(i, k)] * difference[k]).sum::<f64>())
                .sum()
        };
        self.joints.iter().map(|g| square(g).max(0.0).sqrt()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dyngen::consistency;
    use dyngen::{Arm, Values};
    use rand::{RngExt, SeedableRng};

    fn model(text: &str) -> Model {
        Model::derive(Arm::parse(text, "arm").unwrap()).unwrap()
    }

    /// Rotors as large as Table 3's on links that must carry them: B(q) of what comes out is positive at
    /// random poses.
    #[test]
    fn links_have_room_for_their_rotors() {
        let model = model(include_str!("../../../controller/arm.toml"));
        let set = model.set(SetKind::Published).unwrap();
        let values = Values::parse(include_str!("../../../table3.json"), "table3.json").unwrap();
        let values = values.of_set(&model, set).unwrap();
        let metric = crate::estimate::TorqueMetric::new(&model, SetKind::Published).unwrap();
        let found = nearest(&model, SetKind::Published, &values, &metric.matrix(1e-3)).unwrap();
        let verdict = consistency::check(&model, SetKind::Full, &kept(&model, &found.all)).unwrap();
        assert!(verdict.possible, "{:?}", verdict.reasons);
    }

    fn unit(n: usize) -> Mat<f64> {
        Mat::from_fn(n, n, |i, k| if i == k { 1e4 } else { 0.0 })
    }

    /// Values that a real arm gave are kept, whatever full parameters come out.
    #[test]
    fn what_is_consistent_stays() {
        let model = model(include_str!("../../../lwa4p.toml"));
        let set = model.set(SetKind::Minimal).unwrap();
        let links = powerball_virtual_arm::lwa4p::links();
        let all: Vec<f64> = links.iter().flat_map(powerball_virtual_arm::Body::parameters).collect();
        let values = model.set_values(set, &all);
        let found = nearest(&model, SetKind::Minimal, &values, &unit(values.len())).unwrap();
        assert!(found.distance <= found.gap, "{} {}", found.distance, found.gap);
        assert!(found.eigenvalues.iter().all(|e| *e > 0.0) && found.without_body.is_empty());
        assert!(consistency::check(&model, SetKind::Full, &kept(&model, &found.all)).unwrap().possible);
    }

    fn kept(model: &Model, all: &[f64]) -> Vec<f64> {
        model.arm().kept_parameters().iter().map(|p| all[p.index()]).collect()
    }

    /// Table 3 is not that of an arm; the nearest arm is one, and no other real arm is nearer by more than
    /// the certificate.
    #[test]
    fn table_3_becomes_an_arm_and_none_is_nearer() {
        let model = model(include_str!("../../../controller/arm.toml"));
        let set = model.set(SetKind::Published).unwrap();
        let values = Values::parse(include_str!("../../../table3.json"), "table3.json").unwrap();
        let values = values.of_set(&model, set).unwrap();
        assert!(!consistency::check(&model, SetKind::Published, &values).unwrap().possible);
        let metric = unit(values.len());
        let found = nearest(&model, SetKind::Published, &values, &metric).unwrap();
        let full = kept(&model, &found.all);
        assert!(consistency::check(&model, SetKind::Full, &full).unwrap().possible);
        assert!(consistency::check(&model, SetKind::Published, &found.set).unwrap().possible);
        // Mixtures with other real arms are real arms too: the distance must not fall along any of them.
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(4);
        let distance = |all: &[f64]| {
            let sums = model.set_values(set, all);
            let miss: Vec<f64> = sums.iter().zip(&values).map(|(a, b)| a - b).collect();
            dot(&miss, &times(&metric, &miss))
        };
        approx::assert_relative_eq!(distance(&found.all), found.distance, max_relative = 1e-9);
        for _ in 0..200 {
            let mut other = vec![0.0; found.all.len()];
            for link in other.chunks_exact_mut(PER_LINK) {
                for _ in 0..3 {
                    let m: f64 = rng.random_range(0.0..3.0);
                    let r: [f64; 3] = std::array::from_fn(|_| rng.random_range(-0.3..0.3));
                    // Mirrored in every plane, so that declared zeros stay.
                    link[0] += m;
                    for (k, (a, b)) in [(4, (1, 2)), (7, (0, 2)), (9, (0, 1))] {
                        link[k] += m * (r[a] * r[a] + r[b] * r[b]);
                    }
                }
                link[10] = rng.random_range(0.0..0.3);
            }
            for share in [1e-3, 0.05, 0.5] {
                let mixed: Vec<f64> =
                    found.all.iter().zip(&other).map(|(a, b)| (1.0 - share) * a + share * b).collect();
                assert!(distance(&mixed) > found.distance - found.gap);
            }
        }
    }
}
