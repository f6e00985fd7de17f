//! Friction that falls with rising velocity where a film of lubricant builds up.

use super::candidate::{geometric, scaled};
use super::words::{Words, numbers};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use serde::Serialize;

/// τ = c·tanh(γ·q̇)·exp(−(q̇/v_s)²), c ≥ 0.
pub(super) struct Stribeck;

/// Settings of this effect, which the search varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// v_s, rad/s.
    pub velocity: f64,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// c, N·m.
    pub level: ByJoint,
    /// v_s, rad/s.
    pub velocity: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let (torque, position) = (words.torque(), words.position());
        let (level, velocity) = (words.sizes(&self.level.0, 1.0), numbers(&self.velocity));
        format!("{level} {torque} more at rest, gone beyond {velocity} {position}/s")
    }
}

/// Velocities tried on a joint.
const TRIED: usize = 8;

impl Effect for Stribeck {
    fn name(&self) -> &'static str {
        "stribeck"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Velocity(candidate.joints[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on = |j| {
            let top = context.top_velocity(j);
            let velocities = geometric(0.02 * top, 0.3 * top, TRIED).into_iter();
            velocities.map(move |velocity| Candidate::on(j, Settings { velocity }, TRIED))
        };
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let velocity = velocity(candidate);
        // The sign must have changed well inside the bump.
        let steepness = context.steepness(candidate.joints[0]).max(4.0 / velocity);
        vec![Law::Stribeck { steepness, velocity }]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn neighbours(&self, candidate: &Candidate, share: f64) -> Vec<Candidate> {
        let near = |f: f64| candidate.with(Settings { velocity: scaled(velocity(candidate), f, share) });
        [0.7, 0.85, 1.2, 1.4].map(near).to_vec()
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let level = ByJoint::of(found, |f| f.coefficients[0]);
        Figures { level, velocity: ByJoint::of(found, |f| velocity(f.candidate)) }.into()
    }
}

fn velocity(candidate: &Candidate) -> f64 {
    Settings::of(candidate).map_or(f64::NAN, |settings| settings.velocity)
}
