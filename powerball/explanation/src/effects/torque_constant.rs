//! A wrong factor between current and torque, or one that falls as the motor saturates.

use super::words::{Words, list, number};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use serde::Serialize;
use std::ops::Range;

/// τ_measured = τ·(1 + c) or τ·(1 + c·|τ|/τ_max) or τ·(1 + c·(τ/τ_max)²).
pub(super) struct TorqueConstant;

/// How the factor changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The power of the torque with which the factor changes.
    pub kind: Kind,
    /// τ_max, N·m.
    pub scale: f64,
}

/// The power of the torque with which the factor changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The factor has one other value throughout.
    Constant,
    /// The factor changes with |τ|.
    Linear,
    /// The factor changes with τ²: a motor that saturates.
    Square,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The change of the factor at [`torque`](Self::torque).
    pub change_at_torque: ByJoint,
    /// The factor at small torques.
    pub gain: ByJoint,
    /// τ_max, N·m.
    pub torque: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let one = |k: usize| {
            let (gain, change) = (self.gain.0[k] - 1.0, self.change_at_torque.0[k]);
            match change == 0.0 {
                true => format!("{} %", words.size(k, 100.0 * gain)),
                false => {
                    let at = number(self.torque.0[k]);
                    format!("{} % at {at} {}", words.size(k, 100.0 * change), words.torque())
                }
            }
        };
        list((0..self.gain.0.len()).map(one))
    }
}

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

    fn change_of_a_log(&self, candidate: &Candidate) -> Option<(f64, Range<f64>)> {
        let constant = Settings::of(candidate).is_some_and(|settings| settings.kind == Kind::Constant);
        constant.then_some((1.0, -0.8..0.8))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        const ALL: [Kind; 3] = [Kind::Constant, Kind::Linear, Kind::Square];
        let on = |j: JointNumber| {
            let scale = scale(context, j.index());
            ALL.map(|kind| Candidate::on(j, Settings { kind, scale }, ALL.len()))
        };
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let Some(Settings { kind, scale }) = Settings::of(candidate).copied() else { return Vec::new() };
        vec![match kind {
            Kind::Constant => Law::Torque,
            Kind::Linear => Law::TorqueMagnitude { scale },
            Kind::Square => Law::TorqueSquare { scale },
        }]
    }

    fn admissible(&self, _: &Candidate, c: &[f64]) -> bool {
        c[0].abs() < 0.8
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let constant =
            |f: &Found<'_>| Settings::of(f.candidate).is_some_and(|settings| settings.kind == Kind::Constant);
        let gain = |f: &Found<'_>| if constant(f) { 1.0 + f.coefficients[0] } else { 1.0 };
        let change = |f: &Found<'_>| if constant(f) { 0.0 } else { f.coefficients[0] };
        let torque = |f: &Found<'_>| Settings::of(f.candidate).map_or(f64::NAN, |settings| settings.scale);
        Figures {
            change_at_torque: ByJoint::of(found, change),
            gain: ByJoint::of(found, gain),
            torque: ByJoint::of(found, torque),
        }
        .into()
    }
}

/// The joint's own limit, or else a torque of the size that these logs hold.
fn scale(context: &Context<'_>, joint: usize) -> f64 {
    context.data.body.arm().joints[joint].torque.unwrap_or_else(|| {
        let torque = &context.data.joints[joint].torque;
        (torque.iter().map(|t| t * t).sum::<f64>() / torque.len().max(1) as f64).sqrt().max(1e-6) * 3.0
    })
}
