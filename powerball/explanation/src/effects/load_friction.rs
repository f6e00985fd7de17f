//! Friction that grows with the torque a joint transmits: gears are pressed together harder.

use super::words::Words;
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use serde::Serialize;

/// τ = c·|τ_rigid|·tanh(γ·q̇), c ≥ 0 in N·m per N·m.
pub(super) struct LoadFriction;

/// Settings of this effect: it has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings;

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// c, N·m of friction for each N·m of load.
    pub coefficient: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let unit = words.torque();
        format!("{} {unit} per {unit}", words.sizes(&self.coefficient.0, 1.0))
    }
}

/// A gear that loses more than this share of its torque would not be used.
const MOST: f64 = 0.6;

impl Effect for LoadFriction {
    fn name(&self) -> &'static str {
        "load_friction"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Load
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        context.moving_joints().map(|j| Candidate::on(j, Settings, 1)).collect()
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Load { steepness: context.steepness(candidate.joints[0]) }]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn admissible(&self, _: &Candidate, coefficients: &[f64]) -> bool {
        coefficients.iter().all(|c| *c < MOST)
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures { coefficient: ByJoint::of(found, |f| f.coefficients[0]) }.into()
    }
}
