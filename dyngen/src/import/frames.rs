//! Denavit–Hartenberg frames on given joint axes.
//!
//! Normal k is the common normal of the axes k and k+1; it carries `a` and `alpha`, and its direction is the
//! x axis of frame k. Joint k turns from normal k−1 to normal k: `theta` and `d`. The two conventions differ
//! only in which axis a frame sits on, and so in which normal belongs to a row. J. Denavit, R. Hartenberg, J.
//! Appl. Mech. 22 (1955) 215; J. J. Craig, Introduction to Robotics, 3rd ed., §3.4.
//!
//! Axes that are almost parallel have their common normal far away, and a small change of an axis moves it by
//! metres (S. Hayati, IEEE CDC 1983). There only the normal's direction is taken: the origin of the far axis
//! is where it meets the plane across the near one, and a row goes to it by `a` and `b`, along x and y.

use super::Options;
use super::chain::{Chain, ChainJoint};
use super::pose::Pose;
use crate::arm::Convention;
use nalgebra::Vector3;

/// Lengths below this are zero: it is how finely lengths are written, m.
const SMALLEST_LENGTH: f64 = 1e-12;
/// Beyond this, m, rounding eats the inertia's digits.
const LARGEST_LENGTH: f64 = 100.0;
/// Sine of the angle below which axes count as almost parallel: above it a common normal is at most ten times
/// as far away as the axes are from each other.
const ALMOST_PARALLEL: f64 = 0.1;

/// A row of the table at q = 0: a, b, d in m, alpha, theta in rad.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) alpha: f64,
    pub(super) d: f64,
    pub(super) theta: f64,
}

/// The frames in the root link's frame at q = 0, and the rows between them.
pub(super) struct Frames {
    pub(super) base: Pose,
    pub(super) links: Vec<Pose>,
    pub(super) rows: Vec<Row>,
}

/// The way from one axis to the next: along their common normal, or off it where that is far away.
#[derive(Clone, Copy)]
struct Normal {
    /// Of the common normal.
    direction: Vector3<f64>,
    /// Where the way leaves the nearer axis and meets the farther one.
    foot: Vector3<f64>,
    head: Vector3<f64>,
    /// Part of the way along the normal, and the one across normal and nearer axis.
    a: f64,
    b: f64,
    alpha: f64,
}

/// Places the frames, or says which axes cannot have them.
pub(super) fn place(chain: &Chain, options: &Options) -> Result<Frames, String> {
    let joints = &chain.joints;
    let mut normals = vec![base(&joints[0])];
    for pair in joints.windows(2) {
        let [near, far] = pair else { continue };
        let normal = common(near, far, &normals[normals.len() - 1], options.angle_tolerance);
        let away = [normal.foot - near.point, normal.head - far.point].map(|way| way.norm());
        let farthest = normal.a.max(away[0]).max(away[1]);
        if farthest.is_nan() || farthest > LARGEST_LENGTH {
            return Err(format!(
                "the axes of joints '{}' and '{}' are {farthest:.0} m apart, or their common normal is as \
                 far from their origins: is a length in mm?",
                near.name, far.name
            ));
        }
        normals.push(normal);
    }
    // Behind the last joint nothing asks for a direction: the one that makes theta and d zero.
    let Normal { direction, head, .. } = normals[normals.len() - 1];
    normals.push(Normal { direction, foot: head, head, a: 0.0, b: 0.0, alpha: 0.0 });

    let (mut links, mut rows) = (Vec::new(), Vec::new());
    for (k, joint) in joints.iter().enumerate() {
        let (before, after) = (normals[k], normals[k + 1]);
        let z = joint.direction;
        let theta =
            z.dot(&before.direction.cross(&after.direction)).atan2(before.direction.dot(&after.direction));
        let d = z.dot(&(after.foot - before.head));
        let (sized, next) = match options.convention {
            Convention::Modified => (before, joint),
            Convention::Standard => (after, joints.get(k + 1).unwrap_or(joint)),
        };
        rows.push(Row { a: sized.a, b: sized.b, alpha: sized.alpha, d, theta });
        links.push(match options.convention {
            Convention::Modified => Pose::from_axes(z, after.direction, after.foot),
            Convention::Standard => Pose::from_axes(next.direction, after.direction, after.head),
        });
    }
    let base = Pose::from_axes(joints[0].direction, normals[0].direction, normals[0].head);
    Ok(Frames { base, links, rows })
}

/// Frame 0: z along the first axis, as close to the root link's frame as that allows.
fn base(first: &ChainJoint) -> Normal {
    let z = first.direction;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let square = axes.iter().find(|e| e.dot(&z).abs() < 1e-9);
    let least = axes.iter().min_by(|a, b| a.dot(&z).abs().total_cmp(&b.dot(&z).abs()));
    let x = square.or(least).copied().unwrap_or(Vector3::x());
    let origin = first.point - z * z.dot(&first.point);
    let direction = (x - z * z.dot(&x)).normalize();
    Normal { direction, foot: origin, head: origin, a: 0.0, b: 0.0, alpha: 0.0 }
}

fn common(near: &ChainJoint, far: &ChainJoint, before: &Normal, tolerance: f64) -> Normal {
    let (z, next) = (near.direction, far.direction);
    let cross = z.cross(&next);
    let (sine, cosine) = (cross.norm(), z.dot(&next));
    if sine <= tolerance {
        // Parallel: any point of the axis will do; the one where the last normal ended makes d zero.
        let foot = before.head;
        let way = far.point - foot;
        let way = way - z * z.dot(&way);
        let a = way.norm();
        let alpha = if cosine > 0.0 { 0.0 } else { std::f64::consts::PI };
        return if a > SMALLEST_LENGTH {
            Normal { direction: way / a, foot, head: foot + way, a, b: 0.0, alpha }
        } else {
            Normal { direction: before.direction, foot, head: foot, a: 0.0, b: 0.0, alpha }
        };
    }
    // Of two opposite directions the one that needs the smaller turn.
    let (turn, quarter) = (before.direction.dot(&cross), before.direction.cross(&cross).dot(&z));
    let towards = if turn.abs() > 1e-9 * sine { turn > 0.0 } else { quarter > 0.0 };
    if sine < ALMOST_PARALLEL {
        let direction = if towards { cross / sine } else { -cross / sine };
        let foot = before.head;
        let head = far.point + next * (z.dot(&(foot - far.point)) / cosine);
        let (a, b) = (direction.dot(&(head - foot)), z.cross(&direction).dot(&(head - foot)));
        return Normal { direction, foot, head, a, b, alpha: cross.dot(&direction).atan2(cosine) };
    }
    let way = far.point - near.point;
    let distance = way.dot(&cross) / sine;
    // Between skew axes x points outwards; where they meet, to the side that needs the smaller turn.
    let forwards = if distance.abs() > SMALLEST_LENGTH { distance > 0.0 } else { towards };
    let direction = if forwards { cross / sine } else { -cross / sine };
    let squared = sine * sine;
    Normal {
        direction,
        foot: near.point + z * (way.cross(&next).dot(&cross) / squared),
        head: far.point + next * (way.cross(&z).dot(&cross) / squared),
        a: distance.abs(),
        b: 0.0,
        alpha: cross.dot(&direction).atan2(cosine),
    }
}
