//! Friction that differs with the direction, or a constant torque: an offset of the current looks the same.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// τ = c, τ = d·|q̇|, or both.
pub(super) struct Asymmetry;

const FORMS: [&[usize]; 3] = [&[0], &[1], &[0, 1]];

impl Effect for Asymmetry {
    fn name(&self) -> &'static str {
        "asymmetry"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Speed(candidate.joints[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on = |j: usize| (0..FORMS.len()).map(move |form| Candidate::on(j, form, Vec::new(), FORMS.len()));
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        FORMS[candidate.form].iter().map(|which| [Law::Constant, Law::SpeedMagnitude][*which]).collect()
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let of = |which: usize| -> Vec<f64> {
            let sum = |f: &Found<'_>| {
                FORMS[f.candidate.form]
                    .iter()
                    .zip(f.coefficients)
                    .filter(|(w, _)| **w == which)
                    .map(|(_, c)| c)
                    .sum()
            };
            found.iter().map(sum).collect()
        };
        json!({ "torque": of(0), "viscous": of(1) })
    }
}
