//! A wrong factor between current and torque, or one that falls as the motor saturates.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// τ_measured = τ·(1 + c) or τ·(1 + c·|τ|/τ_max) or τ·(1 + c·(τ/τ_max)²).
pub(super) struct TorqueConstant;

const FORMS: usize = 3;

impl Effect for TorqueConstant {
    fn name(&self) -> &'static str {
        "torque_constant"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Torque
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on = |j: usize| {
            let top = scale(context, j);
            (0..FORMS).map(move |form| Candidate::on(j, form, vec![top], FORMS))
        };
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let scale = candidate.values[0];
        vec![match candidate.form {
            0 => Law::Torque,
            1 => Law::TorqueMagnitude { scale },
            _ => Law::TorqueSquare { scale },
        }]
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c[0].abs() < 0.8
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let gain: Vec<f64> =
            found.iter().map(|f| if f.candidate.form == 0 { 1.0 + f.coefficients[0] } else { 1.0 }).collect();
        let bend: Vec<f64> =
            found.iter().map(|f| if f.candidate.form == 0 { 0.0 } else { f.coefficients[0] }).collect();
        let at: Vec<f64> = found.iter().map(|f| f.candidate.values[0]).collect();
        match gain.as_slice() {
            [one] => json!({ "gain": one, "change_at_torque": bend[0], "torque": at[0] }),
            _ => json!({ "gain": gain, "change_at_torque": bend, "torque": at }),
        }
    }
}

/// The joint's own limit, or else a torque of the size that these logs hold.
fn scale(context: &Context<'_>, joint: usize) -> f64 {
    context.data.body.arm().joints[joint].torque.unwrap_or_else(|| {
        let torque = &context.data.joints[joint].torque;
        (torque.iter().map(|t| t * t).sum::<f64>() / torque.len().max(1) as f64).sqrt().max(1e-6) * 3.0
    })
}
