//! A torque that grows with position: a hose, a cable, a balancer.

use super::words::{Words, numbers};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use serde::Serialize;

/// τ = k·(q − q_rest).
pub(super) struct Spring;

/// Settings of this effect: it has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings;

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The position at which it does not pull, rad.
    pub rest: ByJoint,
    /// k, N·m/rad.
    pub stiffness: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let (torque, position) = (words.torque(), words.position());
        let (stiffness, rest) = (words.sizes(&self.stiffness.0, 1.0), numbers(&self.rest));
        format!("{stiffness} {torque}/{position}, at rest at {rest} {position}")
    }
}

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
        context.moving_joints().map(|j| Candidate::on(j, Settings, 1)).collect()
    }

    fn laws(&self, _: &Context<'_>, _: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Position, Law::Constant]
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let rest = |f: &Found<'_>| {
            if f.coefficients[0] == 0.0 { 0.0 } else { -f.coefficients[1] / f.coefficients[0] }
        };
        let stiffness = ByJoint::of(found, |f| f.coefficients[0]);
        Figures { rest: ByJoint::of(found, rest), stiffness }.into()
    }
}
