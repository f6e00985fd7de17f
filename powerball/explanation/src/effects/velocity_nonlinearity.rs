//! Friction at velocity that Eq. 16 cannot bend to: growing faster or slower than in proportion.

use super::words::{Words, list, number};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use serde::Serialize;

/// τ = c·q̇|q̇|, c·q̇³ or c·sign(q̇)·√|q̇|.
pub(super) struct VelocityNonlinearity;

/// Settings of this effect, which the search varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The power of q̇.
    pub power: f64,
}

/// Figures of this effect in a result, by joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// c, N·m for 1 rad/s.
    pub coefficient: Vec<f64>,
    /// The power of q̇.
    pub power: Vec<f64>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let (torque, position) = (words.torque(), words.position());
        let one = |(k, (c, power)): (usize, (&f64, &f64))| {
            format!("{} {torque}·|dq|^{} (dq in {position}/s)", words.size(k, *c), number(*power))
        };
        list(self.coefficient.iter().zip(&self.power).enumerate().map(one))
    }
}

const POWERS: [f64; 3] = [2.0, 3.0, 0.5];

impl Effect for VelocityNonlinearity {
    fn name(&self) -> &'static str {
        "velocity_nonlinearity"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Velocity(candidate.joints[0])
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let on = |j| POWERS.map(|power| Candidate::on(j, Settings { power }, POWERS.len()));
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let steepness = context.steepness(candidate.joints[0]);
        vec![Law::Power { steepness, power: power(candidate) }]
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures {
            coefficient: found.iter().map(|f| f.coefficients[0]).collect(),
            power: found.iter().map(|f| power(f.candidate)).collect(),
        }
        .into()
    }
}

fn power(candidate: &Candidate) -> f64 {
    Settings::of(candidate).map_or(f64::NAN, |settings| settings.power)
}
