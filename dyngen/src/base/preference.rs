//! Which parameters a base set keeps where there is a choice.

use crate::arm::{Arm, Convention, Joint, JointKind, Parameter, ParameterKind};

/// All parameters that an arm keeps, those to be kept in a base set first.
///
/// As in Khalil and Dombre's regrouping for a revolute joint, what can be carried to the link before goes last: the mass, the
/// first moment along the joint axis and one of the two inertias across it. Of two links the inner one keeps.
pub fn preference(arm: &Arm) -> Vec<Parameter> {
    let mut order = arm.kept_parameters();
    order.sort_by_key(|p| (rank(arm, *p), p.link, p.kind));
    order
}

fn rank(arm: &Arm, parameter: Parameter) -> u8 {
    use ParameterKind::*;
    let joint = &arm.joints[parameter.link];
    let along_y = axis_is_y(arm.convention, joint);
    let (along, second_across) = if along_y { (My, Izz) } else { (Mz, Iyy) };
    let revolute = joint.kind == JointKind::Revolute;
    match parameter.kind {
        M => 5,
        Im => 4,
        kind if revolute && kind == along => 3,
        kind if revolute && kind == second_across => 2,
        Ixx | Iyy | Izz => 1,
        _ => 0,
    }
}

/// Whether the joint's own axis lies nearer to y than to z of its link's frame: a standard frame stands
/// turned by the twist.
fn axis_is_y(convention: Convention, joint: &Joint) -> bool {
    let (sin, cos) = joint.alpha.sin_cos();
    convention == Convention::Standard && sin.abs() > cos.abs()
}
