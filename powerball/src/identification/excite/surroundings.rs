//! What stands around an arm: the floor, and the arm's own links as capsules.

use super::{Limits, Mounting, Shape, Space};
use dyngen::Arm;

/// Radius of the links' capsules, m, where nothing is said.
pub const RADIUS: f64 = 0.06;
/// The distance that capsules keep from each other and from the floor, m, where nothing is said.
pub const CLEARANCE: f64 = 0.02;

/// A floor at its base that blocks more than this share of an arm's poses is not what it was built on.
const HANGS: f64 = 0.95;

/// A floor's height above the base frame's origin, m; or that there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorAt(pub Option<f64>);

/// The links and the floor of an arm in a mounting, and the floor's height: at the base where nothing is said
/// of it, the base stands upright and the arm can be above it, as an arm that is below its base wherever it
/// is hangs over something.
#[must_use]
pub fn surroundings(
    arm: &Arm,
    mounting: &Mounting,
    shape: &Shape,
    floor: Option<FloorAt>,
    clearance: f64,
    limits: &Limits,
) -> (Space, Option<f64>) {
    let up = mounting.up(arm);
    let free =
        |height: &f64| shape.blocked(&shape.floor(up, *height, &limits.0), clearance, &limits.0) < HANGS;
    let height = match floor {
        Some(FloorAt(height)) => height,
        None => (up.z > 0.5).then_some(0.0).filter(free),
    };
    let floor = height.map(|height| shape.floor(up, height, &limits.0));
    (Space { shape: shape.clone(), floor, clearance }, height)
}
