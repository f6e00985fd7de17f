//! The five ways in which a MuJoCo model says how a frame is turned.

use super::numbers::finite;
use nalgebra::{Matrix3, Rotation3, Vector3};
use roxmltree::Node;

/// Unit and order of angles.
#[derive(Clone, Debug)]
pub(super) struct Angles {
    /// Whether angles are radians, not degrees.
    pub(super) radian: bool,
    /// The axes of Euler angles: small letters turn with the frame, capitals stand.
    pub(super) order: String,
}

impl Default for Angles {
    fn default() -> Self {
        Angles { radian: false, order: "xyz".to_string() }
    }
}

impl Angles {
    /// The file's unit in rad.
    pub(super) fn unit(&self) -> f64 {
        if self.radian { 1.0 } else { std::f64::consts::PI / 180.0 }
    }
}

/// How an element turns its frame: the axes of the frame as columns.
pub(super) fn turn(node: Node<'_, '_>, angles: &Angles) -> Result<Matrix3<f64>, String> {
    let list = |key: &str, count: usize| -> Result<Option<Vec<f64>>, String> {
        let Some(text) = node.attribute(key) else { return Ok(None) };
        let element = node.tag_name().name();
        match finite(text).filter(|n| n.len() == count) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(format!("{key} of <{element}> must be {count} numbers, found '{text}'")),
        }
    };
    let unit = |v: Vector3<f64>, key: &str| {
        let length = v.norm();
        if length > 1e-9 { Ok(v / length) } else { Err(format!("{key} has no direction")) }
    };
    if let Some(q) = list("quat", 4)? {
        return quaternion([q[0], q[1], q[2], q[3]]);
    }
    if let Some(v) = list("axisangle", 4)? {
        let axis = unit(Vector3::new(v[0], v[1], v[2]), "axisangle")?;
        return Ok(Rotation3::new(axis * (v[3] * angles.unit())).into_inner());
    }
    if let Some(e) = list("euler", 3)? {
        let mut turned = Matrix3::identity();
        for (axis, angle) in angles.order.chars().zip(e) {
            let direction = match axis.to_ascii_lowercase() {
                'x' => Vector3::x(),
                'y' => Vector3::y(),
                _ => Vector3::z(),
            };
            let step = Rotation3::new(direction * (angle * angles.unit())).into_inner();
            turned = if axis.is_lowercase() { turned * step } else { step * turned };
        }
        return Ok(turned);
    }
    if let Some(v) = list("xyaxes", 6)? {
        let x = unit(Vector3::new(v[0], v[1], v[2]), "xyaxes")?;
        let y = Vector3::new(v[3], v[4], v[5]);
        let y = unit(y - x * x.dot(&y), "xyaxes")?;
        return Ok(Matrix3::from_columns(&[x, y, x.cross(&y)]));
    }
    if let Some(v) = list("zaxis", 3)? {
        // The smallest turn that takes z there.
        let z = unit(Vector3::new(v[0], v[1], v[2]), "zaxis")?;
        let axis = Vector3::z().cross(&z);
        let angle = axis.norm().atan2(z[2]);
        let axis = if axis.norm() > 1e-12 { axis.normalize() } else { Vector3::x() };
        return Ok(Rotation3::new(axis * angle).into_inner());
    }
    Ok(Matrix3::identity())
}

/// w, x, y, z; of any length but zero.
fn quaternion([w, x, y, z]: [f64; 4]) -> Result<Matrix3<f64>, String> {
    let square = w * w + x * x + y * y + z * z;
    if square < 1e-18 {
        return Err("quat has no direction".to_string());
    }
    let s = 2.0 / square;
    Ok(Matrix3::new(
        1.0 - s * (y * y + z * z),
        s * (x * y - w * z),
        s * (x * z + w * y),
        s * (x * y + w * z),
        1.0 - s * (x * x + z * z),
        s * (y * z - w * x),
        s * (x * z - w * y),
        s * (y * z + w * x),
        1.0 - s * (x * x + y * y),
    ))
}
