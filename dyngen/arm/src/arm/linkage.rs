//! Linkages of four bars whose opposite bars differ: how long they are, and between which angles they close.

use super::loops::SAME;
use crate::exact::rational::{Rational, to_f64};
use std::f64::consts::{PI, TAU};

/// A loop of four bars on one joint of the chain. Its rod goes from the first pin, on the link behind the
/// joint, to the middle one, its rocker from there to the last pin, on the link before the joint.
///
/// With D² the square of the distance of the first from the last pin, L₂ and L₃ the lengths of rod and
/// rocker, both bars' sines and cosines are rational in those of the joint and in the root of one number, S =
/// ((L₂ + L₃)² − D²)·(D² − (L₂ − L₃)²). √S/4 is the area of the triangle of rod, rocker and D: where it is
/// zero the loop is at a dead point.
#[derive(Clone, Debug, PartialEq)]
pub struct Linkage {
    /// The loop's joint of the chain, from 0.
    pub joint: usize,
    /// The first pin, from the joint's axis, in the plane's axes behind the joint's turn, m.
    pub outer: [Rational; 2],
    /// The last pin, from the joint's axis, in the plane's axes before the joint's turn, m.
    pub inner: [Rational; 2],
    /// Length of the rod, m.
    pub rod: Rational,
    /// Length of the rocker, m.
    pub rocker: Rational,
    /// Whether the middle pin is on the left of the way from the first pin to the last, about the joint's
    /// axis z; else it is on the right.
    pub left: bool,
}

/// A bar's own turn against the link that carries its pin, about the axis of a linkage's joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Hinge {
    /// The linkage that turns it.
    pub linkage: Linkage,
    /// Whether the bar is the rocker; else it is the rod.
    pub rocker: bool,
}

impl Linkage {
    /// Numbers between which the cosine of the angle at the joint, from the last pin to the first, must be
    /// for the loop to close.
    fn closing(&self) -> [f64; 2] {
        let [outer, inner, rod, rocker] = self.lengths();
        let cosine =
            |distance: f64| (outer * outer + inner * inner - distance * distance) / (2.0 * outer * inner);
        [cosine(rod + rocker), cosine(rod - rocker)]
    }

    /// Distances of the first and the last pin from the joint, lengths of rod and rocker, m.
    fn lengths(&self) -> [f64; 4] {
        let distance = |[x, y]: &[Rational; 2]| to_f64(x).hypot(to_f64(y));
        [distance(&self.outer), distance(&self.inner), to_f64(&self.rod), to_f64(&self.rocker)]
    }

    /// The angle at the joint, from the last pin to the first, where the joint's own angle q + theta is zero,
    /// rad.
    fn offset(&self) -> f64 {
        let angle = |[x, y]: &[Rational; 2]| to_f64(y).atan2(to_f64(x));
        angle(&self.outer) - angle(&self.inner)
    }

    /// The positions q of its joint between which the loop closes, in words, where it does not close at every
    /// position within limits (rad; without limits at all). At the ends of such a range it is at a dead
    /// point. `theta` is what the joint's angle has in addition to q, rad.
    pub fn open_within(&self, limits: Option<[f64; 2]>, theta: f64) -> Option<String> {
        let limits = limits.map_or([-PI, PI], |limits| limits.map(|q| q + theta));
        if self.closes(limits) {
            return None;
        }
        let middle = (limits[0] + limits[1]) / 2.0;
        let text = |[from, to]: [f64; 2]| {
            let turns = TAU * ((middle - (from + to) / 2.0) / TAU).round();
            format!("{:.6} and {:.6}", from + turns - theta, to + turns - theta)
        };
        let ranges: Vec<String> = self.ranges().into_iter().map(text).collect();
        Some(format!("between {} rad", ranges.join(", or between ")))
    }

    /// Whether the loop closes, away from its dead points, at every angle q + theta of the joint between two,
    /// rad.
    fn closes(&self, [from, to]: [f64; 2]) -> bool {
        let [low, high] = self.closing();
        let [from, to] = [from, to].map(|angle| angle + self.offset());
        // Whether an angle that is a whole number of turns away from `of` is among them.
        let holds = |of: f64| of + TAU * ((from - of) / TAU).ceil() <= to;
        let least = if holds(PI) { -1.0 } else { from.cos().min(to.cos()) };
        let most = if holds(0.0) { 1.0 } else { from.cos().max(to.cos()) };
        low + SAME < least && most < high - SAME
    }

    /// Angles q + theta of the joint between which the loop closes, rad: one range or two.
    fn ranges(&self) -> Vec<[f64; 2]> {
        let [low, high] = self.closing();
        let (near, far) = (high.min(1.0).acos(), low.max(-1.0).acos());
        let ranges = match (high > 1.0 + SAME, low < -1.0 - SAME) {
            (true, _) => vec![[-far, far]],
            (false, true) => vec![[near, TAU - near]],
            (false, false) => vec![[near, far], [-far, -near]],
        };
        ranges.into_iter().map(|range| range.map(|angle| angle - self.offset())).collect()
    }
}
