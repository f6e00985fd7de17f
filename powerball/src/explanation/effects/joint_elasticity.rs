//! A joint that gives way under its torque: the link is not where the motor's encoder says.

use super::candidate::by_joint;
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use crate::logs::regression::Column;
use serde_json::{Value, json};

/// q_link = q − τ/K: the change of rigid torque on all joints over 1/K. The candidate's value is the 1/K
/// about which it is taken: none while nothing is known of it, when the change is taken to first order.
pub(super) struct JointElasticity;

impl Effect for JointElasticity {
    fn name(&self) -> &'static str {
        "joint_elasticity"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        context.moving_joints().map(|j| Candidate::on(j, 0, Vec::new(), 1)).collect()
    }

    fn laws(&self, _: &Context<'_>, _: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Compliance]
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        vec![context.moved_link_column(
            candidate.joints[0],
            Law::Compliance,
            candidate.values.first().copied(),
        )]
    }

    /// A soft gear moves its link so far that gravity there is another one.
    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        (c[0] > 0.0).then(|| Candidate { values: vec![c[0]], ..candidate.clone() })
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        json!({ "stiffness": by_joint(found, |f| 1.0 / f.coefficients[0].max(1e-12)) })
    }
}
