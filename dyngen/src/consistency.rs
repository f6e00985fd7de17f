//! Whether a real arm can have given parameter values.
//!
//! Two conditions are checked: is the mass matrix B(q) positive definite at every pose, and, where a link's
//! ten parameters are all given, is its pseudo-inertia matrix positive semi-definite, which is exactly the
//! condition for a distribution of mass to have them (Wensing, Kim and Slotine 2018).

use crate::arm::{Arm, JointKind, MAX_JOINTS, Parameter, ParameterKind};
use crate::dynamics::Function;
use crate::evaluator::Evaluator;
use crate::exact::prime::Draws;
use crate::model::{Error, Model};
use crate::parameters::{ParameterSet, SetKind, SetParameter};
use nalgebra::{Matrix3, Matrix4, SMatrix, Vector3};
use std::path::Path;

/// Poses that are drawn before the worst of them are refined.
const POSES: usize = 512;
/// Rounding error that an eigenvalue is allowed, relative to the largest.
const ROUNDING: f64 = 1e-10;

/// The verdict on a set of values.
#[derive(Clone, Debug)]
pub struct Possibility {
    /// Whether there is no reason against the values.
    pub possible: bool,
    /// The reasons why they are impossible.
    pub reasons: Vec<String>,
    /// The pose where B(q) is worst, rad or m.
    pub pose: Vec<f64>,
    /// The smallest eigenvalue of B(q) there, kg·m² (where all joints are revolute).
    pub min_eigenvalue: f64,
    /// The share of poses drawn at random at which B(q) is not positive definite.
    pub indefinite: f64,
}

impl Possibility {
    /// The reasons against the values of a file, each with the values to use instead.
    #[must_use]
    pub fn warnings(&self, file: &Path) -> Vec<String> {
        let warning = |reason: &String| {
            format!(
                "{}: no real arm can have these values: {reason}; for the nearest possible values see \
                    consistent.json of `powerball identify`, or run `powerball consistent`",
                file.display()
            )
        };
        self.reasons.iter().map(warning).collect()
    }
}

/// Judges the values of a set's parameters, in the set's order.
///
/// # Errors
/// Those of [`Model::function`].
pub fn check(model: &Model, kind: SetKind, values: &[f64]) -> Result<Possibility, Error> {
    let arm = model.arm();
    let set = model.set(kind)?;
    let mass = Evaluator::new(model, Function::MassMatrix, kind)?;
    let mut reasons = impossible_links(arm, set, values);
    let search = Search { mass: &mass, values };
    let ((smallest, largest), pose, indefinite) = search.worst(arm);
    let share = indefinite as f64 / POSES as f64;
    if smallest < -ROUNDING * largest.abs() {
        reasons.push(format!(
            "B(q) is not positive definite: its smallest eigenvalue is {smallest:.6} at the pose shown, and \
                it is \
             negative at {indefinite} of {POSES} poses drawn at random"
        ));
    } else if smallest <= ROUNDING * largest.abs() {
        reasons
            .push(format!("B(q) is singular at the pose shown: its smallest eigenvalue is {smallest:.3e}"));
    }
    Ok(Possibility {
        possible: reasons.is_empty(),
        reasons,
        pose,
        min_eigenvalue: smallest,
        indefinite: share,
    })
}

/// The smallest eigenvalue of B(q), and the pose within the limits where it was found, rad or m.
///
/// # Errors
/// As [`Model::function`].
pub(crate) fn smallest_eigenvalue(
    model: &Model,
    kind: SetKind,
    values: &[f64],
) -> Result<(f64, Vec<f64>), Error> {
    let mass = Evaluator::new(model, Function::MassMatrix, kind)?;
    let ((smallest, _), pose, _) = Search { mass: &mass, values }.worst(model.arm());
    Ok((smallest, pose))
}

/// Poses within the limits, rad or m, drawn at random.
pub(crate) fn poses(arm: &Arm) -> Vec<Vec<f64>> {
    let limits = limits(arm);
    let mut draws = Draws::new(0x706f_7365);
    let mut uniform = || draws.element().residue() as f64 / crate::exact::prime::P as f64;
    (0..POSES).map(|_| limits.iter().map(|[low, high]| low + (high - low) * uniform()).collect()).collect()
}

/// Of each coordinate; a turn, or 1 m either way, where the arm file gives none.
fn limits(arm: &Arm) -> Vec<[f64; 2]> {
    arm.moving_joints()
        .map(|joint| {
            joint.position.unwrap_or(match joint.kind {
                JointKind::Revolute => [-std::f64::consts::PI, std::f64::consts::PI],
                JointKind::Prismatic => [-1.0, 1.0],
            })
        })
        .collect()
}

/// Poses at which B(q) is worst.
struct Search<'a> {
    mass: &'a Evaluator,
    values: &'a [f64],
}

impl Search<'_> {
    /// Smallest and largest eigenvalue of B at a pose.
    fn extremes(&self, q: &[f64]) -> (f64, f64) {
        let n = q.len();
        let mut flat = vec![0.0; n * n];
        self.mass.evaluate(q, &[], &[], self.values, &mut flat);
        if flat.iter().any(|x| !x.is_finite()) {
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        // The largest arm's matrix, padded; its extra rows are zero and are skipped below.
        let matrix = SMatrix::<f64, MAX_JOINTS, MAX_JOINTS>::from_fn(|i, j| {
            if i < n && j < n { 0.5 * (flat[i * n + j] + flat[j * n + i]) } else { 0.0 }
        });
        let eigen = matrix.symmetric_eigen();
        let mut values: Vec<f64> = (0..MAX_JOINTS)
            .filter(|k| (0..n).any(|i| eigen.eigenvectors[(i, *k)].abs() > 0.5 / (MAX_JOINTS as f64).sqrt()))
            .map(|k| eigen.eigenvalues[k])
            .collect();
        values.sort_by(f64::total_cmp);
        (values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(0.0))
    }

    /// The pose of the smallest eigenvalue: random poses within the limits, the best of them refined joint by
    /// joint.
    fn worst(&self, arm: &Arm) -> ((f64, f64), Vec<f64>, usize) {
        let limits = limits(arm);
        let mut poses: Vec<(f64, Vec<f64>)> =
            poses(arm).into_iter().map(|q| (self.extremes(&q).0, q)).collect();
        let indefinite = poses.iter().filter(|(e, _)| *e < 0.0).count();
        poses.sort_by(|a, b| a.0.total_cmp(&b.0));
        poses.truncate(4);
        for (value, q) in &mut poses {
            self.refine(value, q, &limits);
        }
        poses.sort_by(|a, b| a.0.total_cmp(&b.0));
        let q = poses.swap_remove(0).1;
        (self.extremes(&q), q, indefinite)
    }

    fn refine(&self, value: &mut f64, q: &mut [f64], limits: &[[f64; 2]]) {
        for round in 0..12 {
            let step = 0.5f64.powi(round);
            for i in 0..q.len() {
                for direction in [step, -step] {
                    let old = q[i];
                    q[i] = (old + direction).clamp(limits[i][0], limits[i][1]);
                    let trial = self.extremes(q).0;
                    if trial < *value {
                        *value = trial;
                    } else {
                        q[i] = old;
                    }
                }
            }
        }
    }
}

/// Links whose parameters are all given but impossible for a body, and rotors of negative inertia.
fn impossible_links(arm: &Arm, set: &ParameterSet, values: &[f64]) -> Vec<String> {
    let given = |p: Parameter| {
        let one = Some(crate::exact::rational::integer(1));
        let single = |s: &SetParameter| matches!(&s.terms[..], [(q, c)] if *q == p && c.as_rational() == one);
        set.parameters.iter().position(single).map(|i| values[i])
    };
    let mut reasons = Vec::new();
    for link in 0..arm.bodies() {
        let of = |kind| {
            let p = Parameter { link, kind };
            if arm.keeps(p) { given(p) } else { Some(0.0) }
        };
        if let Some(rotor) = of(ParameterKind::Im).filter(|im| *im < 0.0) {
            reasons.push(format!("rotor {}: its inertia {rotor} is negative", link + 1));
        }
        let given: Option<Vec<f64>> = ParameterKind::ALL[..10].iter().map(|kind| of(*kind)).collect();
        let Some(v) = given.and_then(|v| <[f64; 10]>::try_from(v).ok()) else { continue };
        let smallest = pseudo_inertia(&v).symmetric_eigenvalues().min();
        let scale = v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if smallest < -ROUNDING * scale {
            reasons.push(format!("{}: {}", arm.body_name(link), why_no_body(&v, smallest)));
        }
    }
    reasons
}

/// The ten inertial parameters of a body, in order, from its mass, its first moment and its inertia about the
/// frame's origin. Products of inertia are the negative elements off the diagonal (Eq. 8).
#[must_use]
pub fn parameters_of_body(mass: f64, moment: &Vector3<f64>, tensor: &Matrix3<f64>) -> [f64; 10] {
    let t = tensor;
    [
        mass,
        moment[0],
        moment[1],
        moment[2],
        t[(0, 0)],
        -t[(0, 1)],
        -t[(0, 2)],
        t[(1, 1)],
        -t[(1, 2)],
        t[(2, 2)],
    ]
}

/// The pseudo-inertia of a link from its ten inertial parameters, in order: [Σ s; sᵀ m] with the second
/// moments Σ = ½ tr(I) − I. A body can have them exactly where it is positive semi-definite.
#[must_use]
pub fn pseudo_inertia(v: &[f64; 10]) -> Matrix4<f64> {
    let [m, mx, my, mz, xx, xy, xz, yy, yz, zz] = *v;
    let half = 0.5 * (xx + yy + zz);
    Matrix4::new(half - xx, xy, xz, mx, xy, half - yy, yz, my, xz, yz, half - zz, mz, mx, my, mz, m)
}

fn why_no_body(v: &[f64; 10], smallest: f64) -> String {
    let (xx, yy, zz) = (v[4], v[7], v[9]);
    let triangle = [("Ixx", xx, yy + zz), ("Iyy", yy, xx + zz), ("Izz", zz, xx + yy)];
    if v[0] < 0.0 {
        return format!("its mass {} is negative", v[0]);
    }
    if let Some((name, value, others)) = triangle.iter().find(|(_, value, others)| value > others) {
        return format!(
            "{name} = {value} exceeds the sum {others} of the other two moments of inertia, which is \
                impossible for a body"
        );
    }
    if v[0] == 0.0 {
        return "it has moments but no mass".to_string();
    }
    format!("no distribution of mass has its parameters: the pseudo-inertia has the eigenvalue {smallest:.6}")
}
