//! Backlash in a gear: after a reversal the motor turns through a gap before it drives the link again.

use super::candidate::geometric;
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde::Serialize;

/// The rigid torque is missing while the motor is in the gap, or the link stands beside the motor by half the
/// gap.
pub(super) struct Backlash;

/// What of the backlash shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settings {
    /// The rigid torque is missing while the motor crosses a gap after a reversal of its motion.
    Gap {
        /// The gap, rad.
        gap: f64,
    },
    /// The link stands back by half the gap on the side its load pushes it to.
    Offset {
        /// The largest load, N·m.
        scale: f64,
    },
}

/// What it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The gap, rad.
    pub gap: ByJoint,
}

/// Gaps tried on a joint, and the largest, rad.
const GAPS: usize = 6;
const MOST: f64 = 0.05;

impl Effect for Backlash {
    fn name(&self) -> &'static str {
        "backlash"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    /// When the motor arrives at the other side of the gap depends on the load on the way.
    fn abrupt(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Torque
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let n = context.data.dof();
        let loads = |j: usize| context.rigid().iter().flat_map(move |t| t.iter().skip(j).step_by(n));
        let top = |j: usize| loads(j).fold(1e-9f64, |top, load| top.max(load.abs()));
        let mut candidates = Vec::new();
        for j in context.moving_joints() {
            let gaps = geometric(5e-4, MOST, GAPS).into_iter().map(|gap| Settings::Gap { gap });
            let all = gaps.chain([Settings::Offset { scale: top(j.index()) }]);
            candidates.extend(all.map(|settings| Candidate::on(j, settings, GAPS + 1)));
        }
        candidates
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        match Settings::of(candidate) {
            Some(Settings::Gap { gap }) => vec![Law::Gap { gap: *gap }],
            Some(Settings::Offset { scale }) => vec![Law::HangingBack { scale: *scale }],
            None => Vec::new(),
        }
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn admissible(&self, candidate: &Candidate, c: &[f64]) -> bool {
        match Settings::of(candidate) {
            Some(Settings::Gap { .. }) => (0.1..2.0).contains(&c[0]),
            Some(Settings::Offset { .. }) => c[0] < MOST,
            None => false,
        }
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let gap = |f: &Found<'_>| match Settings::of(f.candidate) {
            Some(Settings::Gap { gap }) => *gap,
            _ => 2.0 * f.coefficients[0],
        };
        Figures { gap: ByJoint::of(found, gap) }.into()
    }
}
