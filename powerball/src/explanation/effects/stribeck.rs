//! Friction that falls with rising speed where a film of lubricant builds up.

use super::candidate::{by_joint, geometric};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// τ = c·tanh(γ·q̇)·exp(−(q̇/v_s)²), c ≥ 0.
pub(super) struct Stribeck;

impl Effect for Stribeck {
    fn name(&self) -> &'static str {
        "stribeck"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Speed(candidate.joints[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on = |j: usize| {
            let top = context.top_speed(j);
            let speeds = geometric(0.02 * top, 0.3 * top, 8);
            speeds.into_iter().map(move |v| Candidate::on(j, 0, vec![v], 8))
        };
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let speed = candidate.values[0];
        // The sign must have changed well inside the bump.
        let steepness = context.steepness(candidate.joints[0]).max(4.0 / speed);
        vec![Law::Stribeck { steepness, speed }]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn neighbours(&self, candidate: &Candidate) -> Vec<Candidate> {
        let near = |f: f64| Candidate { values: vec![candidate.values[0] * f], ..candidate.clone() };
        [0.7, 0.85, 1.2, 1.4].map(near).to_vec()
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({
            "level": by_joint(found, |f| f.coefficients[0]),
            "speed": by_joint(found, |f| f.candidate.values[0]),
        })
    }
}
