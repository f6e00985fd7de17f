//! Presliding: after a reversal friction does not jump but winds up over a small distance.

use super::candidate::{by_joint, geometric};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
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

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Travel(candidate.values[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on =
            |j: usize| geometric(3e-4, 0.05, 8).into_iter().map(move |d| Candidate::on(j, 0, vec![d], 8));
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Presliding { distance: candidate.values[0] }]
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
