//! Presliding: after a reversal friction does not jump but winds up over a small distance.

use super::candidate::{geometric, scaled};
use super::words::{Words, numbers};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use serde::Serialize;

/// τ = c·z with Dahl's state dz/dq = (1 − z·sign(q̇))·sign(q̇)/δ, c ≥ 0, δ in rad.
pub(super) struct Hysteresis;

/// Settings of this effect, which the search varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// δ: the distance over which friction winds up, rad.
    pub distance: f64,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// δ, rad.
    pub distance: ByJoint,
    /// c, N·m.
    pub level: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let (level, distance) = (words.sizes(&self.level.0, 1.0), numbers(&self.distance));
        format!("{level} {} within {distance} {} of a reversal", words.torque(), words.position())
    }
}

/// Distances tried on a joint.
const TRIED: usize = 8;

impl Effect for Hysteresis {
    fn name(&self) -> &'static str {
        "hysteresis"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Travel(distance(candidate))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let distances = geometric(3e-4, 0.05, TRIED);
        let on = |j| distances.iter().map(move |d| Candidate::on(j, Settings { distance: *d }, TRIED));
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        vec![Law::Presliding { distance: distance(candidate) }]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn neighbours(&self, candidate: &Candidate, share: f64) -> Vec<Candidate> {
        let near = |f: f64| candidate.with(Settings { distance: scaled(distance(candidate), f, share) });
        [0.6, 0.8, 1.25, 1.6].map(near).to_vec()
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let level = ByJoint::of(found, |f| f.coefficients[0]);
        Figures { distance: ByJoint::of(found, |f| distance(f.candidate)), level }.into()
    }
}

fn distance(candidate: &Candidate) -> f64 {
    Settings::of(candidate).map_or(f64::NAN, |settings| settings.distance)
}
