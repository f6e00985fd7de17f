//! Poses, and angles that are meant to be exact.

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// The pose of a frame in another: rotation (columns are its axes) and origin, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub(crate) rotation: Matrix3<f64>,
    pub(crate) origin: Vector3<f64>,
}

impl Pose {
    pub(crate) fn identity() -> Self {
        Pose { rotation: Matrix3::identity(), origin: Vector3::zeros() }
    }

    /// From a URDF's `<origin>`: R = Rz(yaw)·Ry(pitch)·Rx(roll).
    pub(crate) fn of(origin: &super::urdf::Origin, tolerance: f64) -> Self {
        let [(sr, cr), (sp, cp), (sy, cy)] = origin.rpy.map(|angle| sin_cos(angle, tolerance));
        let x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr);
        let y = Matrix3::new(cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp);
        let z = Matrix3::new(cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0);
        Pose { rotation: z * y * x, origin: Vector3::from(origin.xyz) }
    }

    /// From an axis z, a direction x at right angles to it, and an origin.
    pub(crate) fn from_axes(z: Vector3<f64>, x: Vector3<f64>, origin: Vector3<f64>) -> Self {
        Pose { rotation: Matrix3::from_columns(&[x, z.cross(&x), z]), origin }
    }

    /// `self` is given in a frame, `next` in `self`.
    pub(crate) fn then(&self, next: &Pose) -> Pose {
        Pose { rotation: self.rotation * next.rotation, origin: self.point(next.origin) }
    }

    /// A point given in this frame.
    pub(crate) fn point(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.origin + self.rotation * point
    }

    /// `other`, given in the same frame as `self`, as `self` sees it.
    pub(crate) fn see(&self, other: &Pose) -> Pose {
        let back = self.rotation.transpose();
        Pose { rotation: back * other.rotation, origin: back * (other.origin - self.origin) }
    }

    /// As a homogeneous transform, row by row.
    pub(crate) fn rows(&self) -> [[f64; 4]; 4] {
        let row =
            |i: usize| [self.rotation[(i, 0)], self.rotation[(i, 1)], self.rotation[(i, 2)], self.origin[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// Roll, pitch, yaw.
    pub(crate) fn rpy(&self) -> [f64; 3] {
        let r = &self.rotation;
        let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
        // Where the pitch is a quarter turn only the sum of the other two is determined.
        if r[(0, 0)].hypot(r[(1, 0)]) < 1e-9 {
            return [(-r[(1, 2)]).atan2(r[(1, 1)]), pitch, 0.0];
        }
        [r[(2, 1)].atan2(r[(2, 2)]), pitch, r[(1, 0)].atan2(r[(0, 0)])]
    }
}

/// The number of twelfths of pi that an angle is meant to be.
pub(crate) fn twelfths(angle: f64, tolerance: f64) -> Option<i64> {
    let count = (angle / (PI / 12.0)).round();
    // A thousand turns are no angle of a drawing.
    (count.abs() < 24e3 && (angle - count * PI / 12.0).abs() <= tolerance).then_some(count as i64)
}

/// Sine and cosine, exact at quarter turns.
fn sin_cos(angle: f64, tolerance: f64) -> (f64, f64) {
    match twelfths(angle, tolerance) {
        None => angle.sin_cos(),
        Some(count) if count % 6 != 0 => (count as f64 * PI / 12.0).sin_cos(),
        Some(count) => {
            let (s, c) = ((count / 6) as f64 * FRAC_PI_2).sin_cos();
            (s.round(), c.round())
        }
    }
}
