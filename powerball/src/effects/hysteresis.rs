//! Presliding: after a reversal friction does not jump but winds up over a small distance.

use super::candidate::{by_joint, geometric};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::regression::Column;
use serde_json::{Value, json};

/// τ = c·z with Dahl's state dz/dq = (1 − z·sign(q̇))·sign(q̇)/δ, c ≥ 0, δ in rad.
pub(super) struct Hysteresis;

impl Effect for Hysteresis {
    fn name(&self) -> &'static str {
        "hysteresis"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Travel
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on =
            |j: usize| geometric(3e-4, 0.05, 8).into_iter().map(move |d| Candidate::on(j, 0, vec![d], 8));
        context.moving_joints().flat_map(on).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let (j, delta) = (candidate.joints[0], candidate.values[0]);
        vec![context.data.column_on(j, |_, r| state(r.position(j), delta))]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn neighbours(&self, candidate: &Candidate) -> Vec<Candidate> {
        let near = |f: f64| Candidate { values: vec![candidate.values[0] * f], ..candidate.clone() };
        [0.6, 0.8, 1.25, 1.6].map(near).to_vec()
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({
            "level": by_joint(found, |f| f.coefficients[0]),
            "distance": by_joint(found, |f| f.candidate.values[0]),
        })
    }
}

/// Dahl's state along positions, exact for any step; it starts as if the first motion had gone on before.
fn state(q: impl Iterator<Item = f64>, delta: f64) -> Vec<f64> {
    let q: Vec<f64> = q.collect();
    // Distances far below the state's own do not count as a start.
    let first = q.iter().find(|x| (*x - q[0]).abs() > delta).map_or(0.0, |x| (x - q[0]).signum());
    let mut z = first;
    let mut out = Vec::with_capacity(q.len());
    for (k, x) in q.iter().enumerate() {
        let step = if k == 0 { 0.0 } else { x - q[k - 1] };
        if step != 0.0 {
            z = step.signum() + (z - step.signum()) * (-step.abs() / delta).exp();
        }
        out.push(z);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::state;

    #[test]
    fn the_state_winds_up_over_its_distance_whatever_the_step() {
        let path = |steps: usize| -> Vec<f64> {
            let up = (0..=steps).map(|k| k as f64 / steps as f64 * 0.1);
            let down = (1..=steps).map(|k| 0.1 - k as f64 / steps as f64 * 0.01);
            up.chain(down).collect()
        };
        for steps in [10, 1000] {
            let z = state(path(steps).into_iter(), 0.01);
            assert!((z[steps] - 1.0).abs() < 1e-3);
            approx::assert_abs_diff_eq!(z[2 * steps], -1.0 + 2.0 * (-1.0f64).exp(), epsilon = 1e-3);
        }
    }
}
