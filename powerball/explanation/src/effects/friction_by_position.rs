//! Friction that differs from place to place: a gear that runs out of true, a worn stretch, a seal that is
//! pressed on one side.

use super::words::{Words, list, number, numbers};
use super::{Axis, ByJoint, Candidate, Class, Context, Effect, Found};
use dyngen::arm::JointKind;
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use powerball_logs::regression::Recording;
use serde::Serialize;
use std::f64::consts::TAU;

/// τ = tanh(γ·q̇)·(a·cos(k·q) + b·sin(k·q)), k = 1 or 2 cycles a joint turn: what the first two orders of a
/// joint's turn add to its Coulomb friction.
pub(super) struct FrictionByPosition;

/// Settings of this effect, which the search varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// k, cycles a joint turn.
    pub order: f64,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// √(a² + b²), N·m.
    pub amplitude: ByJoint,
    /// k, cycles a joint turn.
    pub order: ByJoint,
    /// The position at which friction is largest, rad.
    pub position: ByJoint,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        // Of a joint that slides the order counts on 2π m.
        let (way, unit) = if words.slides { ("m", TAU.recip()) } else { ("turn", 1.0) };
        let orders = list(self.order.0.iter().map(|order| number(order * unit)));
        let (amplitude, at) = (words.sizes(&self.amplitude.0, 1.0), numbers(&self.position));
        let (torque, position) = (words.torque(), words.position());
        format!(
            "friction that varies by ±{amplitude} {torque} in {orders} cycles a {way}, largest at {at} \
            {position}"
        )
    }
}

/// Cycles a turn that are tried: no higher one has been reported for friction.
const ORDERS: [f64; 2] = [1.0, 2.0];

impl Effect for FrictionByPosition {
    fn name(&self) -> &'static str {
        "friction_by_position"
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let of = |j: JointNumber| {
            let unit = match context.data.body.arm().joints[j.index()].kind {
                JointKind::Revolute => 1.0,
                JointKind::Prismatic => TAU / travel(context, j),
            };
            ORDERS.map(|order| Candidate::on(j, Settings { order: order * unit }, ORDERS.len()))
        };
        context.moving_joints().flat_map(of).collect()
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let (order, steepness) = (order(candidate), context.steepness(candidate.joints[0]));
        vec![Law::DirectionCosine { order, steepness }, Law::DirectionSine { order, steepness }]
    }

    /// Friction takes energy wherever the joint was.
    fn possible(&self, context: &Context<'_>, candidate: &Candidate, c: &[f64]) -> bool {
        let (joint, order) = (candidate.joints[0], order(candidate));
        let [g1, _, g3, _, _] = context.fit.friction(joint.index());
        positions(context, joint).all(|q| {
            let (sine, cosine) = (order * q).sin_cos();
            g1 + g3 + c[0] * cosine + c[1] * sine >= 0.0
        })
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        Figures {
            amplitude: ByJoint::of(found, |f| f.coefficients[0].hypot(f.coefficients[1])),
            order: ByJoint::of(found, |f| order(f.candidate)),
            position: ByJoint::of(found, |f| f.coefficients[1].atan2(f.coefficients[0]) / order(f.candidate)),
        }
        .into()
    }
}

fn positions<'c>(context: &'c Context<'_>, joint: JointNumber) -> impl Iterator<Item = f64> + 'c {
    context.data.recordings.iter().flat_map(move |r: &Recording| r.position(joint.index()))
}

/// How far a joint moves along the logs, rad or m.
fn travel(context: &Context<'_>, joint: JointNumber) -> f64 {
    let ends = |(low, high): (f64, f64), q: f64| (low.min(q), high.max(q));
    let (low, high) = positions(context, joint).fold((f64::MAX, f64::MIN), ends);
    high - low
}

/// The order of a candidate of this effect.
fn order(candidate: &Candidate) -> f64 {
    Settings::of(candidate).map_or(f64::NAN, |settings| settings.order)
}
