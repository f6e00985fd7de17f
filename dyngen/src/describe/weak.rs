//! Parameters that are identifiable through residues of the arm's numbers alone.
//!
//! A twist of 1.5708 in place of pi/2 makes sums identifiable that no measurement can show. They are the
//! directions in which the regressor has almost no length, its columns scaled by the longest of their unit.

use crate::arm::{JointKind, ParameterKind};
use crate::dynamics::Function;
use crate::evaluator::{Evaluator, Samples};
use crate::exact::prime::Draws;
use crate::model::{Error, Model};
use crate::parameters::SetKind;
use std::f64::consts::PI;

/// Singular values below this share of the largest are reported. Real arms have 1e-3, residues 1e-5.
const WEAK: f64 = 1e-4;
/// Random states.
const STATES: usize = 60;
/// Sweeps of Jacobi's rotations at most; ten do for a hundred columns.
const SWEEPS: usize = 30;

/// A direction of the parameters that torques hardly show.
#[derive(Clone, Debug)]
pub struct Weak {
    /// Of the scaled regressor, relative to the largest.
    pub singular_value: f64,
    /// The parameters in it with the largest shares.
    pub parameters: Vec<String>,
}

/// The weak directions of the minimal set, weakest first.
pub(super) fn weak(model: &Model) -> Result<Vec<Weak>, Error> {
    let set = model.set(SetKind::Minimal)?;
    let evaluator = Evaluator::new(model, Function::Regressor, SetKind::Minimal)?;
    let (n, p) = evaluator.shape();
    let mut draws = Draws::new(0x7765_616b);
    let mut unit = || draws.element().residue() as f64 / (1u64 << 61) as f64;
    let mut states = [Vec::new(), Vec::new(), Vec::new()];
    for _ in 0..STATES {
        for joint in model.arm().moving_joints() {
            let [low, high] = joint.position.unwrap_or(match joint.kind {
                JointKind::Revolute => [-PI, PI],
                JointKind::Prismatic => [-0.5, 0.5],
            });
            states[0].push(low + (high - low) * unit());
            states[1].push(4.0 * unit() - 2.0);
            states[2].push(20.0 * unit() - 10.0);
        }
    }
    let [q, dq, ddq] = &states;
    let samples = Samples { q, dq, ddq, ..Samples::default() };
    let mut rows = vec![0.0; STATES * n * p];
    evaluator.run(&samples, &mut rows);
    let mut columns: Vec<Vec<f64>> =
        (0..p).map(|c| rows.iter().skip(c).step_by(p).copied().collect()).collect();
    // Masses, moments and inertias have units of their own; a column that is short compared with others of
    // its kind is what is looked for.
    let kinds: Vec<u8> =
        set.parameters.iter().map(|p| p.terms.first().map_or(0, |(p, _)| unit_of(p.kind))).collect();
    let norms: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt()).collect();
    for (column, kind) in columns.iter_mut().zip(&kinds) {
        let same = norms.iter().zip(&kinds).filter(|(_, k)| *k == kind);
        let longest = same.fold(0.0f64, |m, (norm, _)| m.max(*norm));
        column.iter_mut().for_each(|x| *x /= longest);
    }
    let directions = orthogonalized(&mut columns);
    let lengths: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt()).collect();
    let largest = lengths.iter().fold(0.0f64, |m, x| m.max(*x));
    let mut found: Vec<Weak> = Vec::new();
    for (direction, length) in directions.iter().zip(&lengths).filter(|(_, l)| **l < WEAK * largest) {
        let most = direction.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let shares = direction.iter().enumerate().filter(|(_, share)| share.abs() > 0.3 * most);
        let carrier = |(k, _): (usize, &f64)| set.parameters[k].terms.first().map(|(p, _)| p.to_string());
        found.push(Weak {
            singular_value: length / largest,
            parameters: shares.filter_map(carrier).collect(),
        });
    }
    found.sort_by(|a, b| a.singular_value.total_cmp(&b.singular_value));
    Ok(found)
}

/// kg, kg·m or kg·m², or a rotor's kg·m² before its gear.
fn unit_of(kind: ParameterKind) -> u8 {
    match kind {
        ParameterKind::M => 0,
        ParameterKind::Mx | ParameterKind::My | ParameterKind::Mz => 1,
        ParameterKind::Im => 3,
        _ => 2,
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Hestenes' one-sided Jacobi: turns columns until they are at right angles, and returns the turns: the right
/// singular vectors. The columns' lengths are then the singular values, small ones to full relative accuracy.
fn orthogonalized(columns: &mut [Vec<f64>]) -> Vec<Vec<f64>> {
    let p = columns.len();
    let mut turns: Vec<Vec<f64>> =
        (0..p).map(|i| (0..p).map(|k| f64::from(u8::from(i == k))).collect()).collect();
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for i in 0..p {
            for k in i + 1..p {
                let (a, b) = (dot(&columns[i], &columns[i]), dot(&columns[k], &columns[k]));
                let c = dot(&columns[i], &columns[k]);
                if c.abs() <= 1e-12 * (a * b).sqrt() {
                    continue;
                }
                rotated = true;
                let zeta = (b - a) / (2.0 * c);
                let t = 1.0f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let cos = 1.0 / (1.0 + t * t).sqrt();
                rotate(columns, (i, k), cos, cos * t);
                rotate(&mut turns, (i, k), cos, cos * t);
            }
        }
        if !rotated {
            break;
        }
    }
    turns
}

fn rotate(vectors: &mut [Vec<f64>], (i, k): (usize, usize), cos: f64, sin: f64) {
    let (left, right) = vectors.split_at_mut(k);
    for (x, y) in left[i].iter_mut().zip(&mut right[0]) {
        (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
    }
}

#[cfg(test)]
mod tests {
    /// A = diag(3, 2, 1e-7) turned on both sides.
    #[test]
    fn small_singular_values_are_found() {
        let (c, s) = (0.6, 0.8);
        let mut columns =
            vec![vec![3.0 * c, 2.0 * s, 0.0], vec![-3.0 * s, 2.0 * c, 0.0], vec![c * 3.0, s * 2.0, 1e-7]];
        let before = columns.clone();
        let turns = super::orthogonalized(&mut columns);
        let mut lengths: Vec<f64> = columns.iter().map(|x| super::dot(x, x).sqrt()).collect();
        lengths.sort_by(f64::total_cmp);
        // The product of singular values is the determinant, 3·2·1e-7.
        assert!((lengths.iter().product::<f64>() / 6e-7 - 1.0).abs() < 1e-9, "{lengths:?}");
        assert!(lengths[0] < 1e-7);
        for (column, turn) in columns.iter().zip(&turns) {
            let sum = |r: usize| (0..3).map(|k| before[k][r] * turn[k]).sum::<f64>();
            assert!((0..3).all(|r| (sum(r) - column[r]).abs() < 1e-12));
        }
    }
}
