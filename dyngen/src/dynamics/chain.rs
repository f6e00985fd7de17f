//! The chain that the recursions run along: stages of parallel axes.
//!
//! A frame of the chain sits in each link with z along the link's own joint axis. Consecutive revolute joints
//! with parallel axes form one stage: seen from the frame before them, each of their links turns by the sum
//! of the angles up to it, so those sums are the coordinates. An axis that points the other way (a twist of
//! pi) is turned round first, and its angle counts negatively. Origins lie on the axes, where as many as
//! possible coincide.

use crate::arm::{Arm, Convention, JointKind};
use crate::exact::algebra::Algebra;
use crate::lagrangian::elements::{ArmElements, JointElements};

/// A link's place in the chain.
#[derive(Clone, Debug)]
pub struct LinkGeometry<V> {
    /// Whether z points against the joint axis of the arm's file.
    pub reversed: bool,
    /// Sine and cosine of the twist about x from the frame of the link before; of a link within a stage 0 and
    /// 1.
    pub twist: (V, V),
    /// From the frame's origin to the next link's, in the frame's axes.
    pub reach: [V; 3],
    /// Origin of the file's frame of this link, in the frame's axes.
    pub file_origin: [V; 3],
    /// Sine and cosine of the turn about x from this frame to the file's.
    pub file_turn: (V, V),
}

/// The joints of each stage.
pub fn stages(arm: &Arm) -> Vec<std::ops::Range<usize>> {
    let mut stages: Vec<std::ops::Range<usize>> = Vec::new();
    for i in 0..arm.links() {
        let revolute = |i: usize| arm.joints[i].kind == JointKind::Revolute;
        match stages.last_mut() {
            Some(stage) if revolute(i) && revolute(i - 1) && is_parallel(arm, i) => stage.end = i + 1,
            _ => stages.push(i..i + 1),
        }
    }
    stages
}

/// The twist about x before a joint.
fn twist_index(arm: &Arm, joint: usize) -> Option<usize> {
    match arm.convention {
        Convention::Modified => Some(joint),
        Convention::Standard => joint.checked_sub(1),
    }
}

/// Quarter turns of the twist before a joint; `None` where it is not a multiple of pi/2.
fn quarter_turns(arm: &Arm, joint: usize) -> Option<u8> {
    twist_index(arm, joint).map_or(Some(0), |k| arm.joints[k].alpha.quarter_turns())
}

fn is_parallel(arm: &Arm, joint: usize) -> bool {
    matches!(quarter_turns(arm, joint), Some(0 | 2))
}

/// For each joint, whether z of the chain's frame points against its axis.
pub fn reversed(arm: &Arm) -> Vec<bool> {
    let mut reversed = Vec::with_capacity(arm.links());
    for i in 0..arm.links() {
        let before = i > 0 && reversed[i - 1];
        let now = match quarter_turns(arm, i) {
            Some(0) => before,
            Some(2) => !before,
            _ => false,
        };
        reversed.push(now);
    }
    reversed
}

/// For each joint, whether the origin of the chain's frame has moved along the axis by the joint's d, so that
/// as many origins as possible coincide.
fn slid(arm: &Arm, origins: Origins) -> Vec<bool> {
    let revolute = |i: usize| arm.joints[i].kind == JointKind::Revolute;
    // The cost to reach the next origin: along the common normal, along this axis, along the next one.
    let cost = |i: usize, here: bool, next: bool| -> usize {
        let normal = lengths(arm, i).iter().any(|length| !length.is_zero());
        let along = revolute(i) && !arm.joints[i].d.is_zero() && !here;
        let along_next = i + 1 < arm.links() && revolute(i + 1) && !arm.joints[i + 1].d.is_zero() && next;
        let lengths = [normal, along, along_next].iter().filter(|x| **x).count();
        let unwanted = match origins {
            Origins::Inner => along_next,
            Origins::Outer => along,
        };
        [0, 6, 10, 13][lengths] + usize::from(unwanted)
    };
    let n = arm.links();
    let choices = |i: usize| if revolute(i) && !arm.joints[i].d.is_zero() { 0..2 } else { 0..1 };
    // The cheapest way from each choice at a joint to the end, from the last joint inwards.
    let mut best = vec![[(0usize, false); 2]; n];
    for i in (0..n.saturating_sub(1)).rev() {
        for here in choices(i) {
            best[i][here] = choices(i + 1)
                .map(|next| (cost(i, here == 1, next == 1) + best[i + 1][next].0, next == 1))
                .min()
                .unwrap_or_default();
        }
    }
    let mut slid = Vec::with_capacity(n);
    let mut here = n > 0 && choices(0).min_by_key(|k| best[0][*k].0) == Some(1);
    for place in &best {
        slid.push(here);
        here = place[usize::from(here)].1;
    }
    slid
}

/// From a joint's axis to the next: the length of the common normal, and the offset across it.
fn lengths(arm: &Arm, joint: usize) -> [&crate::exact::rational::Rational; 2] {
    let row = match arm.convention {
        Convention::Standard => &arm.joints[joint],
        // The tip beyond the last axis has no length.
        Convention::Modified => &arm.joints[(joint + 1).min(arm.links() - 1)],
    };
    [&row.a, &row.b]
}

/// The position of an origin on its axis if two positions cost the same: nearer to the link before or to the
/// next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Origins {
    /// At the common normal with the axis before.
    Inner,
    /// At the common normal with the next axis.
    Outer,
}

/// The frames of an arm's links in any algebra.
pub fn geometry<A: Algebra>(
    alg: &A,
    arm: &Arm,
    origins: Origins,
    elements: &ArmElements<A::Value>,
) -> Vec<LinkGeometry<A::Value>> {
    let (zero, one) = (alg.integer(0), alg.integer(1));
    let (reversed, slid) = (reversed(arm), slid(arm, origins));
    let n = arm.links();
    let joint = |i: usize| &elements.joints[i];
    let turned = |negative: bool, (s, c): (A::Value, A::Value)| {
        if negative { (alg.neg(&s), alg.neg(&c)) } else { (s, c) }
    };
    let trig = |j: &JointElements<A::Value>| (j.sin_alpha.clone(), j.cos_alpha.clone());
    let twist = |i: usize| match twist_index(arm, i) {
        _ if is_parallel(arm, i) => (zero.clone(), one.clone()),
        Some(k) => turned(i > 0 && reversed[i - 1], trig(joint(k))),
        None => (zero.clone(), one.clone()),
    };
    let signed = |i: usize, v: &A::Value| if reversed[i] { alg.neg(v) } else { v.clone() };
    let is_revolute = |i: usize| arm.joints[i].kind == JointKind::Revolute;
    // The remaining part of d along the own axis. A prismatic joint's shift comes before its frame.
    let rest = |i: usize| if is_revolute(i) && !slid[i] { signed(i, &joint(i).shift) } else { zero.clone() };
    (0..n)
        .map(|i| {
            let (normal, across) = match arm.convention {
                Convention::Standard => (joint(i).a.clone(), signed(i, &joint(i).b)),
                Convention::Modified if i + 1 < n => (joint(i + 1).a.clone(), signed(i, &joint(i + 1).b)),
                Convention::Modified => (zero.clone(), zero.clone()),
            };
            let mut reach = [normal, across, rest(i)];
            if i + 1 < n && slid[i + 1] {
                let (s, c) = twist(i + 1);
                let d = signed(i + 1, &joint(i + 1).shift);
                reach[1] = alg.sub(&reach[1], &alg.mul(&s, &d));
                reach[2] = alg.add(&reach[2], &alg.mul(&c, &d));
            }
            let (lengths, file_turn) = match arm.convention {
                Convention::Standard => ([joint(i).a.clone(), signed(i, &joint(i).b)], trig(joint(i))),
                Convention::Modified => ([zero.clone(), zero.clone()], (zero.clone(), one.clone())),
            };
            let [file_length, file_across] = lengths;
            LinkGeometry {
                reversed: reversed[i],
                twist: twist(i),
                reach,
                file_origin: [file_length, file_across, rest(i)],
                file_turn: turned(reversed[i], file_turn),
            }
        })
        .collect()
}
