//! A joint that deflects under its torque: the link is not at the position of the motor's encoder.

use super::words::Words;
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use powerball_logs::regression::Column;
use serde::Serialize;

/// q_link = q − τ/K: the change of rigid torque on all joints over 1/K.
pub(super) struct JointElasticity;

/// Settings of this effect: the point at which the change of torque is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The compliance 1/K about which it is taken, rad/(N·m); `None` while it is unknown: then the change is
    /// taken to first order.
    pub about: Option<f64>,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// K, N·m/rad.
    pub stiffness: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        format!("{} {}/{}", words.sizes(&self.stiffness.0, 1.0), words.torque(), words.position())
    }
}

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
        context.moving_joints().map(|j| Candidate::on(j, Settings { about: None }, 1)).collect()
    }

    fn laws(&self, _: &Context<'_>, _: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Compliance]
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let Some(Settings { about }) = Settings::of(candidate) else { return Vec::new() };
        vec![context.moved_link_column(candidate.joints[0], Law::Compliance, *about)]
    }

    /// A soft gear moves its link far enough to change gravity there.
    fn refined(&self, candidate: &Candidate, c: &[f64]) -> Option<Candidate> {
        (c[0] > 0.0).then(|| candidate.with(Settings { about: Some(c[0]) }))
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures { stiffness: ByJoint::of(found, |f| 1.0 / f.coefficients[0].max(1e-12)) }.into()
    }
}
