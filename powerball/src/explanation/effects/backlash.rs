//! Play in a gear: after a reversal the motor turns through a gap before it drives the link again.

use super::candidate::{by_joint, geometric};
use super::{Axis, Candidate, Class, Context, Effect, Found};
use crate::controller::correction::Law;
use serde_json::{Value, json};

/// Form 0: the rigid torque is missing while the motor is in the gap after a reversal of its motion. Form 1:
/// the link hangs back by half the gap on the side its load pushes it to.
pub(super) struct Backlash;

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
        let on = |j: usize| {
            let gaps = geometric(5e-4, 0.05, 6).into_iter().map(move |gap| Candidate::on(j, 0, vec![gap], 7));
            gaps.chain([Candidate::on(j, 1, vec![top(j)], 7)])
        };
        context.moving_joints().flat_map(on).collect()
    }

    fn laws(&self, _: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let setting = candidate.values[0];
        vec![if candidate.form == 0 {
            Law::Gap { gap: setting }
        } else {
            Law::HangingBack { scale: setting }
        }]
    }

    fn non_negative(&self) -> bool {
        true
    }

    fn admissible(&self, candidate: &Candidate, c: &[f64]) -> bool {
        if candidate.form == 0 { (0.1..2.0).contains(&c[0]) } else { c[0] < 0.05 }
    }

    fn parameters(&self, _: &Context<'_>, found: &[Found<'_>]) -> Value {
        let gap = |f: &Found<'_>| {
            if f.candidate.form == 0 { f.candidate.values[0] } else { 2.0 * f.coefficients[0] }
        };
        json!({ "gap": by_joint(found, gap) })
    }
}
