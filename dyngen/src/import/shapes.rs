//! The inertia that MuJoCo gives a body without `<inertial>`: that of its shapes, each solid and even.

use super::numbers::finite;
use super::pose::Pose;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Of water, which MuJoCo takes where a shape has neither mass nor density, kg/m³.
const DENSITY: f64 = 1000.0;
/// Groups of shapes whose mass counts where the file does not say which do.
pub(super) const GROUPS: [f64; 2] = [0.0, 5.0];

/// A shape with its mass and its moments of inertia about its own axes.
pub(super) struct Solid {
    mass: f64,
    moments: Vector3<f64>,
    /// In the body.
    pose: Pose,
}

impl Solid {
    /// The shape of a geom's attributes at a pose in its body; none where it has no mass.
    ///
    /// # Errors
    /// What is not known of it.
    pub(super) fn read(
        all: &BTreeMap<String, String>,
        pose: Pose,
        groups: [f64; 2],
    ) -> Result<Option<Solid>, String> {
        let list = |key: &str| -> Result<Option<Vec<f64>>, String> {
            let Some(text) = all.get(key) else { return Ok(None) };
            finite(text)
                .map(Some)
                .ok_or_else(|| format!("{key} of its <geom> must be numbers, found '{text}'"))
        };
        let number = |key: &str| list(key).map(|n| n.and_then(|n| n.first().copied()));
        let group = number("group")?.unwrap_or(0.0);
        let kind = all.get("type").map_or("sphere", String::as_str);
        let (given, density) = (number("mass")?, number("density")?.unwrap_or(DENSITY));
        let weightless = given == Some(0.0) || given.is_none() && density == 0.0;
        if !(groups[0]..=groups[1]).contains(&group) || weightless || matches!(kind, "plane" | "hfield") {
            return Ok(None);
        }
        if all.get("shellinertia").is_some_and(|x| x == "true") {
            return Err("its <geom> is a shell".to_string());
        }
        let (mut size, mut pose) = (list("size")?.unwrap_or_default(), pose);
        if let Some(ends) = list("fromto")? {
            let [a, b, c, d, e, f] = ends[..] else { return Err("fromto must be 6 numbers".to_string()) };
            let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
            let way = to - from;
            let z = way.try_normalize(1e-12).ok_or("fromto has no length")?;
            let side = if z.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
            pose = Pose::from_axes(z, (side - z * z.dot(&side)).normalize(), (from + to) / 2.0);
            let [radius, ..] = size[..] else { return Err("its <geom> has no size".to_string()) };
            let half = way.norm() / 2.0;
            size = if matches!(kind, "box" | "ellipsoid") {
                vec![radius, radius, half]
            } else {
                vec![radius, half]
            };
        }
        let solid = match (kind, &size[..]) {
            ("sphere", [r, ..]) => (4.0 / 3.0 * PI * r.powi(3), Vector3::repeat(0.4 * r * r)),
            ("box", [x, y, z, ..]) => (8.0 * x * y * z, across(1.0 / 3.0, [*x, *y, *z])),
            ("ellipsoid", [x, y, z, ..]) => (4.0 / 3.0 * PI * x * y * z, across(0.2, [*x, *y, *z])),
            ("cylinder", [r, h, ..]) => {
                let side = r * r / 4.0 + h * h / 3.0;
                (2.0 * PI * r * r * h, Vector3::new(side, side, r * r / 2.0))
            }
            ("capsule", [r, h, ..]) => capsule(*r, *h),
            ("sphere" | "box" | "ellipsoid" | "cylinder" | "capsule", _) => {
                return Err(format!("its <geom> of type {kind} has too few sizes"));
            }
            _ => return Err(format!("its <geom> is a {kind}, of which only MuJoCo makes a mass")),
        };
        let (volume, per_mass) = solid;
        let mass = given.unwrap_or(density * volume);
        Ok(Some(Solid { mass, moments: per_mass * mass, pose }))
    }

    /// This solid, where what it lies in lies at a pose.
    pub(super) fn seen_from(self, pose: &Pose) -> Solid {
        Solid { pose: pose.then(&self.pose), ..self }
    }

    /// Mass, centre of mass, and inertia tensor about it, of several solids, in the body's axes.
    pub(super) fn together(solids: &[Solid]) -> (f64, Vector3<f64>, Matrix3<f64>) {
        let mass: f64 = solids.iter().map(|solid| solid.mass).sum();
        let moment: Vector3<f64> = solids.iter().map(|solid| solid.pose.origin * solid.mass).sum();
        let centre = if mass > 0.0 { moment / mass } else { Vector3::zeros() };
        let about_centre = |solid: &Solid| {
            let (r, turn) = (solid.pose.origin - centre, solid.pose.rotation);
            // Huygens–Steiner.
            turn * Matrix3::from_diagonal(&solid.moments) * turn.transpose()
                + (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * solid.mass
        };
        (mass, centre, solids.iter().map(about_centre).sum())
    }
}

/// factor·(y² + z²) and so on, for each axis.
fn across(factor: f64, [x, y, z]: [f64; 3]) -> Vector3<f64> {
    Vector3::new(y * y + z * z, z * z + x * x, x * x + y * y) * factor
}

/// Volume, and moments of inertia for a unit of mass: a cylinder of half length h between two half spheres,
/// whose centres of mass lie 3/8 of the radius r behind their faces.
fn capsule(r: f64, h: f64) -> (f64, Vector3<f64>) {
    let (ends, middle) = (4.0 / 3.0 * PI * r.powi(3), 2.0 * PI * r * r * h);
    let volume = ends + middle;
    let side = middle * (r * r / 4.0 + h * h / 3.0) + ends * (0.4 * r * r + h * h + 0.75 * h * r);
    let along = middle * r * r / 2.0 + ends * 0.4 * r * r;
    (volume, Vector3::new(side, side, along) / volume)
}
