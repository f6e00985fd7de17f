//! A body on any link, or on a bar of a closed loop, as columns: first moment and mass about the link's
//! joint, and its inertia there.

use super::Context;
use nalgebra::{Matrix3, Vector3};
use powerball_logs::chain::Chain;
use powerball_logs::regression::Column;
use std::sync::Arc;

/// Columns of a body: first moment (three), mass, inertia.
pub(super) const COLUMNS: usize = 5;
/// Where the mass stands among them …
const MASS: usize = 3;
/// … and the inertia across the direction of the first moment.
pub(super) const INERTIA: usize = 4;

/// The parameters of a body that columns determine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body {
    /// First moment about the link's joint in the link's frame, kg·m.
    pub moment: Vector3<f64>,
    /// Mass, kg, and centre in the link's frame, m, as a point of that moment and inertia.
    pub mass: f64,
    pub centre: Vector3<f64>,
    /// Whether the mass itself shows. It does not where the link's joint does not move in space. Then it
    /// follows from the inertia, which in a slow motion looks like a moment: good enough for torques, and no
    /// figure to be given.
    pub shows_mass: bool,
}

impl Body {
    pub(super) fn new(context: &Context<'_>, link: usize, c: &[f64]) -> Body {
        let moment = Vector3::new(c[0], c[1], c[2]);
        let shows_mass = c[MASS] > 0.0;
        let mass = if shows_mass { c[MASS] } else { moment.norm_squared() / c[INERTIA] };
        Body { moment, mass, centre: joint(context, link) + moment / mass, shows_mass }
    }
}

/// Whether a body can be so: its mass, where it shows, is positive and no farther than `reach` from the
/// joint, and its inertia is positive: without its mass nothing else distinguishes a body from the lack of
/// one elsewhere.
pub(super) fn is_possible(c: &[f64], reach: f64) -> bool {
    let size = Vector3::new(c[0], c[1], c[2]).norm();
    let inertia = c[INERTIA];
    let centre = if c[MASS] > 0.0 { size / c[MASS] } else { inertia / size };
    c[MASS] >= 0.0 && inertia > 0.0 && centre < reach
}

/// The direction of its first moment.
pub(super) fn direction(c: &[f64]) -> Option<[f64; 3]> {
    Vector3::new(c[0], c[1], c[2]).try_normalize(0.0).map(Into::into)
}

/// The origin of a link's joint in the link's frame, m: where it is fixed in the link, else that of the
/// frame.
fn joint(context: &Context<'_>, link: usize) -> Vector3<f64> {
    let chain = Chain::new(context.data.body.arm());
    // A bar's frame is at its pin.
    let Some(row) = chain.rows().get(link) else { return Vector3::zeros() };
    if !row.offset_turns() {
        return Vector3::zeros();
    }
    let (rotation, origin) = row.pose(0.0);
    -(rotation.transpose() * origin)
}

/// The columns of a body on a link, on the joints that carry the link. Its inertia about the joint is that of
/// a point in the direction `along` of its first moment; the same about all axes while that is not known.
pub(super) fn columns(context: &Context<'_>, link: usize, along: Option<[f64; 3]>) -> Vec<Column> {
    let of_link = context.data.link_columns(link);
    if of_link.is_empty() {
        return Vec::new();
    }
    let joint = joint(context, link);
    let joints = context.data.body.arm().last_joint(link).map_or(0, |last| last + 1);
    (0..COLUMNS)
        .map(|c| {
            let mut unit = [0.0; COLUMNS];
            unit[c] = 1.0;
            let shares = parameters(joint, along.map(Vector3::from), &unit);
            let part = |j: usize| {
                let mut values = vec![0.0; context.data.joints[j].len()];
                let mut largest = 0.0f64;
                for (share, column) in shares.iter().zip(of_link).filter(|(share, _)| **share != 0.0) {
                    let own = column.at(j).unwrap_or_default();
                    values.iter_mut().zip(own).for_each(|(v, own)| *v += share * own);
                    largest = own.iter().fold(largest, |largest, own| largest.max((share * own).abs()));
                }
                // What cancels leaves rounding: of a mass on an axis that stands still, say.
                if values.iter().all(|v| v.abs() < 1e-9 * largest) {
                    values.fill(0.0);
                }
                (j, Arc::new(values))
            };
            Column { parts: (0..joints).map(part).collect() }
        })
        .collect()
}

/// m mx my mz Ixx Ixy Ixz Iyy Iyz Izz about the frame's origin of a body about `joint`; products as in Eq. 5
/// of the paper, positive sums.
fn parameters(joint: Vector3<f64>, along: Option<Vector3<f64>>, c: &[f64; COLUMNS]) -> [f64; 10] {
    let (moment, mass) = (Vector3::new(c[0], c[1], c[2]), c[MASS]);
    let about = moment + joint * mass;
    // ∫ x xᵀ dm, of which the inertias are sums: of a point in a direction J·û·ûᵀ.
    let own = match along {
        Some(along) => along * along.transpose() * c[INERTIA],
        None => Matrix3::identity() * (0.5 * c[INERTIA]),
    };
    let second =
        own + joint * moment.transpose() + moment * joint.transpose() + joint * joint.transpose() * mass;
    let [xx, yy, zz] = [second[(0, 0)], second[(1, 1)], second[(2, 2)]];
    let [xy, xz, yz] = [second[(0, 1)], second[(0, 2)], second[(1, 2)]];
    [mass, about.x, about.y, about.z, yy + zz, xy, xz, xx + zz, yz, xx + yy]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of 0.4 kg: about the joint or about the frame's origin, it is one body.
    #[test]
    fn a_point_about_its_joint_is_a_point_about_the_frame() {
        let (mass, joint) = (0.4, Vector3::new(-0.3, 0.1, 0.05));
        let arm = Vector3::new(0.2, -0.1, 0.15);
        let moment = arm * mass;
        let c = [moment.x, moment.y, moment.z, mass, mass * arm.norm_squared()];
        let found = parameters(joint, Some(arm.normalize()), &c);
        let x = joint + arm;
        let point = [
            1.0,
            x.x,
            x.y,
            x.z,
            x.y * x.y + x.z * x.z,
            x.x * x.y,
            x.x * x.z,
            x.x * x.x + x.z * x.z,
            x.y * x.z,
            x.x * x.x + x.y * x.y,
        ];
        for (found, point) in found.iter().zip(point) {
            approx::assert_relative_eq!(*found, mass * point, epsilon = 1e-12);
        }
    }
}
