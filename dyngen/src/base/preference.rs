//! Which parameters a base set keeps where there is a choice.

use crate::arm::{Arm, Convention, Joint, JointKind, Parameter, ParameterKind};
use std::fmt;

/// A rule for what a base set keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preference {
    /// Keeps the second of the two inertias across the joint axis, not the first.
    pub second_across: bool,
    /// Keeps the parameter of the outer one of two links, not of the inner one.
    pub outer: bool,
}

impl Preference {
    /// The rule of Khalil and Dombre's regrouping, and its variants.
    pub const ALL: [Preference; 4] = [
        Preference { second_across: false, outer: false },
        Preference { second_across: true, outer: false },
        Preference { second_across: false, outer: true },
        Preference { second_across: true, outer: true },
    ];

    /// All parameters that an arm keeps, those to be kept in a base set first.
    ///
    /// For a revolute joint, what can be carried to the link before goes last: the mass, the first moment
    /// along the joint axis and one of the two inertias across it.
    pub fn order(self, arm: &Arm) -> Vec<Parameter> {
        let mut order = arm.kept_parameters();
        let link = |p: &Parameter| if self.outer { arm.bodies() - p.link } else { p.link };
        order.sort_by_key(|p| (self.rank(arm, *p), link(p), p.kind));
        order
    }

    /// All eleven parameters of a link by their place in it, those to be kept in a base set first.
    pub(super) fn within_link(self, arm: &Arm, link: usize) -> Vec<usize> {
        let mut order = ParameterKind::ALL;
        order.sort_by_key(|kind| (self.rank(arm, Parameter { link, kind: *kind }), *kind));
        order.map(|kind| kind as usize).to_vec()
    }

    fn rank(self, arm: &Arm, parameter: Parameter) -> u8 {
        use ParameterKind::*;
        // What a bar shares with the links is theirs.
        let Some(joint) = arm.joints.get(parameter.link) else { return 6 };
        let (along, across) =
            if axis_is_y(arm.convention, joint) { (My, [Ixx, Izz]) } else { (Mz, [Ixx, Iyy]) };
        let last_across = across[usize::from(!self.second_across)];
        let revolute = joint.kind == JointKind::Revolute;
        match parameter.kind {
            M => 5,
            Im => 4,
            kind if revolute && kind == along => 3,
            kind if revolute && kind == last_across => 2,
            Ixx | Iyy | Izz => 1,
            _ => 0,
        }
    }
}

impl fmt::Display for Preference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let across = if self.second_across { "second" } else { "first" };
        let link = if self.outer { "outer" } else { "inner" };
        write!(f, "{link} links, {across} inertia across the joint axis")
    }
}

/// Whether the joint's own axis lies nearer to y than to z of its link's frame: a standard frame stands
/// turned by the twist.
fn axis_is_y(convention: Convention, joint: &Joint) -> bool {
    let (sin, cos) = joint.alpha.sin_cos();
    convention == Convention::Standard && sin.abs() > cos.abs()
}
