//! Friction that differs with the direction, or a constant torque: an offset of the current looks the same.

use super::words::{Words, list, number};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::Range;

/// τ = c, τ = d·|q̇|, or both.
pub(super) struct Asymmetry;

/// Which of the two it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Settings {
    /// A constant torque.
    Constant,
    /// A torque in proportion to |q̇|.
    Viscous,
    /// Both.
    Both,
}

/// Figures of this effect in a result, by joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The constant torque, N·m.
    pub torque: Vec<f64>,
    /// The torque over |q̇|, N·m·s/rad.
    pub viscous: Vec<f64>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let (torque, position) = (words.torque(), words.position());
        let one = |(k, (constant, viscous)): (usize, (&f64, &f64))| {
            // A joint's two parts may be one effect or two: the standard error is that of a part which stands
            // alone.
            let alone =
                words.relative_std.len() == self.torque.len() && (*constant == 0.0 || *viscous == 0.0);
            let size = |value: f64| if alone { words.size(k, value) } else { number(value) };
            let constant_in_words = || format!("{} {torque} constant", size(*constant));
            let viscous_in_words = || format!("{} {torque}·s/{position} of |dq|", size(*viscous));
            match (*constant != 0.0, *viscous != 0.0) {
                (true, true) => format!("{} and {}", constant_in_words(), viscous_in_words()),
                (false, true) => viscous_in_words(),
                _ => constant_in_words(),
            }
        };
        list(self.torque.iter().zip(&self.viscous).enumerate().map(one))
    }
}

impl Effect for Asymmetry {
    /// Every torque sensor has a zero.
    fn baseline(&self, context: &Context<'_>) -> Vec<Candidate> {
        let two_way = context.moving_joints().filter(|j| turns_both_ways(context, *j));
        two_way.map(|j| Candidate::on(j, Settings::Constant, 1)).collect()
    }

    /// A constant torque and one in proportion to |q̇| may both be there.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        let which = |c: &Candidate| Settings::of(c).copied();
        let pair = [which(a), which(b)];
        let apart = pair.contains(&Some(Settings::Constant)) && pair.contains(&Some(Settings::Viscous));
        a.joints == b.joints && !apart
    }

    fn name(&self) -> &'static str {
        "asymmetry"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    /// A zero of torques is not friction.
    fn is_friction(&self) -> bool {
        false
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Velocity(candidate.joints[0])
    }

    fn change_of_a_log(&self, candidate: &Candidate) -> Option<(f64, Range<f64>)> {
        (Settings::of(candidate) == Some(&Settings::Constant)).then_some((1.0, f64::MIN..f64::MAX))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        const ALL: [Settings; 3] = [Settings::Constant, Settings::Viscous, Settings::Both];
        let two_way = context.moving_joints().filter(|j| turns_both_ways(context, *j));
        two_way.flat_map(|j| ALL.map(|which| Candidate::on(j, which, ALL.len()))).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        match Settings::of(candidate) {
            Some(Settings::Constant) => vec![Law::Constant],
            Some(Settings::Viscous) => vec![Law::VelocityMagnitude],
            Some(Settings::Both) => vec![Law::Constant, Law::VelocityMagnitude],
            None => Vec::new(),
        }
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let both = |f: &Found<'_>| match (Settings::of(f.candidate), f.coefficients) {
            (Some(Settings::Viscous), [viscous]) => (0.0, *viscous),
            (_, [torque]) => (*torque, 0.0),
            (_, [torque, viscous, ..]) => (*torque, *viscous),
            (_, []) => (0.0, 0.0),
        };
        // A joint's two parts may have been found one after the other.
        let mut by_joint: BTreeMap<JointNumber, (f64, f64)> = BTreeMap::new();
        for f in found {
            let (torque, viscous) = both(f);
            let sum = by_joint.entry(f.candidate.joints[0]).or_default();
            *sum = (sum.0 + torque, sum.1 + viscous);
        }
        let (torque, viscous) = by_joint.into_values().unzip();
        Figures { torque, viscous }.into()
    }
}

/// A direction with less than this share of a joint's motion does not count.
const BOTH_WAYS: f64 = 0.05;

/// Whether a joint turns either way: where it turns one way only, what differs with the direction is its
/// friction.
fn turns_both_ways(context: &Context<'_>, joint: JointNumber) -> bool {
    let (data, j) = (context.data, joint.index());
    let moving =
        data.recordings.iter().flat_map(|r| r.velocity(j)).filter(|v| v.abs() > data.rest_velocity[j]);
    let (ahead, back) = moving
        .fold((0.0, 0.0), |(ahead, back), v| if v > 0.0 { (ahead + 1.0, back) } else { (ahead, back + 1.0) });
    f64::min(ahead, back) >= BOTH_WAYS * (ahead + back)
}
