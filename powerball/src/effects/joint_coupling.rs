//! One joint's motion that loads another: shared bearings, cables, belts through a joint.

use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::correction::Law;
use serde_json::{Value, json};

/// On joint i: c·tanh(γ·q̇ₖ), c·q̇ₖ or c·q̈ₖ of another joint k.
pub(super) struct JointCoupling;

const FORMS: [&str; 3] = ["coulomb", "viscous", "inertial"];

impl Effect for JointCoupling {
    fn name(&self) -> &'static str {
        "joint_coupling"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Speed(candidate.values[0] as usize)
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let joints: Vec<usize> = context.moving_joints().collect();
        let options = FORMS.len() * joints.len().saturating_sub(1);
        let mut candidates = Vec::new();
        for &i in &joints {
            for &k in joints.iter().filter(|k| **k != i) {
                for form in 0..FORMS.len() {
                    candidates.push(Candidate::on(i, form, vec![k as f64], options));
                }
            }
        }
        candidates
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let other = candidate.values[0] as usize;
        vec![match candidate.form {
            0 => Law::OtherDirection { other, steepness: context.steepness(other) },
            1 => Law::OtherSpeed { other },
            _ => Law::OtherAcceleration { other },
        }]
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({
            "coefficient": found.iter().map(|f| f.coefficients[0]).collect::<Vec<_>>(),
            "from_joint": found.iter().map(|f| f.candidate.values[0] as usize + 1).collect::<Vec<_>>(),
            "law": found.iter().map(|f| FORMS[f.candidate.form]).collect::<Vec<_>>(),
        })
    }
}
