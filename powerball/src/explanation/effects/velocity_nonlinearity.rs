//! Friction at speed that Eq. 16 cannot bend to: growing faster or slower than in proportion.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// τ = c·q̇|q̇|, c·q̇³ or c·sign(q̇)·√|q̇|.
pub(super) struct VelocityNonlinearity;

const POWERS: [f64; 3] = [2.0, 3.0, 0.5];

impl Effect for VelocityNonlinearity {
    fn name(&self) -> &'static str {
        "velocity_nonlinearity"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Speed(candidate.joints[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on =
            |j: usize| (0..POWERS.len()).map(move |form| Candidate::on(j, form, Vec::new(), POWERS.len()));
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let steepness = context.steepness(candidate.joints[0]);
        vec![Law::Power { steepness, power: POWERS[candidate.form] }]
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let by = |f: fn(&Found<'_>) -> f64| found.iter().map(f).collect::<Vec<_>>();
        json!({ "coefficient": by(|f| f.coefficients[0]), "power": by(|f| POWERS[f.candidate.form]) })
    }
}
