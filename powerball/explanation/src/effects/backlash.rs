//! Backlash in a gear: after a reversal the motor turns through a gap before it drives the link again.

use super::candidate::{geometric, scaled};
use super::words::{Words, numbers};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use powerball_controller::correction::Law;
use serde::Serialize;

/// While the motor crosses the gap, it does not move a link that friction holds; a free link flies through
/// the gap where its load reverses; a slowly loaded link differs from the motor by half the gap.
pub(super) struct Backlash;

/// The visible part of the backlash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settings {
    /// The rigid torque is missing while the motor crosses a gap after a reversal of its motion.
    Gap {
        /// The gap, rad.
        gap: f64,
    },
    /// The link flies through the gap where its load turns, and is stopped at the other flank.
    Flight {
        /// The gap, rad.
        gap: f64,
        /// The inertia that flies, kg·m²: of the joint, on the average over the logs.
        inertia: f64,
    },
    /// The link stands back by half the gap on the side its load pushes it to.
    Offset {
        /// The largest load, N·m.
        scale: f64,
    },
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The gap, rad.
    pub gap: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        format!("{} {}", numbers(&self.gap), words.position())
    }
}

/// Gaps tried on a joint, and the largest, rad.
const GAPS: usize = 6;
const FLIGHTS: usize = 12;
const MOST: f64 = 0.05;

impl Effect for Backlash {
    fn name(&self) -> &'static str {
        "backlash"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    /// Play is not friction.
    fn is_friction(&self) -> bool {
        false
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
            let inertia = mean_inertia(context, j.index());
            let flights =
                geometric(1e-3, MOST, FLIGHTS).into_iter().map(|gap| Settings::Flight { gap, inertia });
            let all = gaps.chain(flights).chain([Settings::Offset { scale: top(j.index()) }]);
            candidates.extend(all.map(|settings| Candidate::on(j, settings, GAPS + FLIGHTS + 1)));
        }
        candidates
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        match Settings::of(candidate) {
            Some(Settings::Gap { gap }) => vec![Law::Gap { gap: *gap }],
            Some(Settings::Flight { gap, inertia }) => vec![Law::Flight { reach: gap * inertia }],
            Some(Settings::Offset { scale }) => vec![Law::HangingBack { scale: *scale }],
            None => Vec::new(),
        }
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn neighbours(&self, candidate: &Candidate, share: f64) -> Vec<Candidate> {
        let Some(&Settings::Flight { gap, inertia }) = Settings::of(candidate) else { return Vec::new() };
        let near = |f: f64| candidate.with(Settings::Flight { gap: scaled(gap, f, share), inertia });
        [0.7, 0.85, 1.2, 1.4].map(near).to_vec()
    }

    fn admissible(&self, candidate: &Candidate, c: &[f64]) -> bool {
        match Settings::of(candidate) {
            Some(Settings::Gap { .. } | Settings::Flight { .. }) => (0.1..2.0).contains(&c[0]),
            Some(Settings::Offset { .. }) => c[0] < MOST,
            None => false,
        }
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let gap = |f: &Found<'_>| match Settings::of(f.candidate) {
            Some(Settings::Gap { gap } | Settings::Flight { gap, .. }) => *gap,
            _ => 2.0 * f.coefficients[0],
        };
        Figures { gap: ByJoint::of(found, gap) }.into()
    }
}

/// For an average, one sample out of this many is enough.
const SPARSE: usize = 16;

/// The diagonal element of the mass matrix on the average over the logs, kg·m² or kg.
fn mean_inertia(context: &Context<'_>, joint: usize) -> f64 {
    let n = context.data.dof();
    let sparse = |signal: &[f64]| signal.chunks_exact(n).step_by(SPARSE).flatten().copied().collect();
    let (mut sum, mut samples) = (0.0, 0);
    for (recording, rigid) in context.data.recordings.iter().zip(context.rigid()) {
        let [q, v, mut a]: [Vec<f64>; 3] = [&recording.q, &recording.v, &recording.a].map(|s| sparse(s));
        a.iter_mut().skip(joint).step_by(n).for_each(|a| *a += 1.0);
        let faster = context.fit.rigid_torque(context.data.body, &q, &v, &a);
        let change = |(k, faster): (usize, &f64)| faster - rigid[k * SPARSE * n + joint];
        sum += faster.iter().skip(joint).step_by(n).enumerate().map(change).sum::<f64>();
        samples += faster.len() / n;
    }
    (sum / samples.max(1) as f64).max(f64::MIN_POSITIVE)
}
