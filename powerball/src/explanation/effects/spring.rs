//! A torque that grows with position: a hose, a cable, a balancer.

use super::candidate::by_joint;
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// τ = k·(q − q_rest).
pub(super) struct Spring;

impl Effect for Spring {
    fn name(&self) -> &'static str {
        "spring"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Position(candidate.joints[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        context.moving_joints().map(|j| Candidate::on(j, 0, Vec::new(), 1)).collect()
    }

    fn laws(&self, _: &Context<'_>, _: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Position, Law::Constant]
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let rest = |f: &Found<'_>| {
            if f.coefficients[0] == 0.0 { 0.0 } else { -f.coefficients[1] / f.coefficients[0] }
        };
        json!({ "stiffness": by_joint(found, |f| f.coefficients[0]), "rest": by_joint(found, rest) })
    }
}
