//! Ranges of LᵀDL and of B⁻¹ from the links' bodies alone, for every pose: where boxes of poses prove
//! nothing, since the last links are light.
//!
//! Twice the kinetic energy, q̇ᵀBq̇, is at least twice that of any one link, where every link is a body.
//!
//! * A pivot dᵢ is q̇ᵀBq̇ at its smallest with q̇ᵢ = 1 and the joints before at rest (Featherstone, *Rigid
//!   Body Dynamics Algorithms* (2008), §7.3: the articulated inertia about the joint). The link alone has its
//!   inertia about the axis, and dᵢ ≤ Bᵢᵢ.
//! * (B⁻¹)ᵢᵢ is the largest q̇ᵢ² with q̇ᵀBq̇ = 1. A joint's velocity is the difference of those of two links
//!   about its axis z, and ω of a body with inertia I about its centre has (z·ω)² ≤ zᵀI⁻¹z times ωᵀIω. The
//!   sum of both links' zᵀI⁻¹z is bᵢ ≥ (B⁻¹)ᵢᵢ.
//! * A rotor on the link before joint i turns about z with that link's w = z·ω and k·q̇ᵢ more. Its energy is
//!   ½Iₘ(w + k·q̇ᵢ)². The link's parameters hold the part ½Iₘw²: a body is a link without the rotor on it. A
//!   pivot gets Iₘk² more, as the links before are at rest; and by the difference of w + k·q̇ᵢ and w
//!   (B⁻¹)ᵢᵢ ≤ (1/Iₘ + zᵀI⁻¹z)/k² too.
//! * Everything else follows from these ([`Factors::of_energy`]).

use super::factors::{Factors, PosedMatrix, ROUNDED};
use crate::arm::{Arm, Convention, Joint, JointKind, Parameter, ParameterKind};
use crate::consistency::{parameters_of_body, pseudo_inertia};
use crate::exact::rational::to_f64;
use crate::parameters::{ParameterSet, SetParameter};
use nalgebra::{Matrix3, Vector3};

/// A link as a body, without the rotor on it.
struct Body {
    /// kg
    mass: f64,
    /// The centre of mass in the link's frame, m.
    centre: Vector3<f64>,
    /// Inverse of the inertia about the centre, 1/(kg·m²).
    of_inertia: Matrix3<f64>,
    /// Inertia about the frame's origin, kg·m².
    about_origin: Matrix3<f64>,
    /// First moment of mass in the link's frame, kg·m.
    moment: Vector3<f64>,
}

/// A joint's axis in a link's frame: its direction, and a point that it goes through, m.
struct Axis {
    z: Vector3<f64>,
    point: Vector3<f64>,
}

/// The rotor of a joint, on the link before it.
struct Rotor {
    /// kg·m²
    inertia: f64,
    ratio: f64,
    /// Its axis in that link's frame.
    axis: Vector3<f64>,
}

impl Rotor {
    fn of(arm: &Arm, set: &ParameterSet, values: &[f64], joint: usize) -> Option<Rotor> {
        let at = &arm.joints[joint];
        let ratio = to_f64(at.rotor_ratio.as_ref()?);
        let [before, _] = axis(arm.convention, at);
        let inertia = given(set, values, joint, ParameterKind::Im);
        // One without inertia has no energy.
        (inertia != 0.0).then_some(Rotor { inertia, ratio, axis: before.z })
    }

    /// Twice its energy where the joint moves with 1 and the links before are at rest.
    fn reflected(&self) -> f64 {
        self.inertia * self.ratio * self.ratio
    }
}

/// A parameter's value; zero where the set has none of it.
fn given(set: &ParameterSet, values: &[f64], link: usize, kind: ParameterKind) -> f64 {
    let wanted = Parameter { link, kind };
    let own = |p: &SetParameter| matches!(&p.terms[..], [(q, _)] if *q == wanted);
    set.parameters.iter().position(own).and_then(|k| values.get(k)).copied().unwrap_or(0.0)
}

/// The ranges for `values` of the full set.
///
/// # Errors
/// Where a link without the rotors on it is no body with mass and volume, a rotor has a negative inertia, or
/// the energy is more than that of
/// links and rotors: bars of loops, joints that follow others, motors that drive several joints.
pub(super) fn factors(
    arm: &Arm,
    set: &ParameterSet,
    values: &[f64],
    mass: &PosedMatrix,
) -> Result<Factors, String> {
    if arm.has_mimics() || !arm.bars.is_empty() {
        return Err("joints follow others".to_string());
    }
    if !arm.transmissions.is_empty() {
        return Err("motors drive several joints".to_string());
    }
    if values.len() != set.parameters.len() {
        return Err(format!("{} values for {} parameters", values.len(), set.parameters.len()));
    }
    let n = arm.joints.len();
    let rotors: Vec<Option<Rotor>> = (0..n).map(|i| Rotor::of(arm, set, values, i)).collect();
    if let Some(i) = rotors.iter().position(|rotor| rotor.as_ref().is_some_and(|r| r.inertia < 0.0)) {
        return Err(format!("rotor {} has a negative inertia", i + 1));
    }
    let of = |link: usize| {
        let on_it = rotors.get(link + 1).and_then(Option::as_ref);
        Body::of(set, values, link, on_it).ok_or_else(|| format!("link {} has no volume", link + 1))
    };
    let bodies = (0..n).map(of).collect::<Result<Vec<Body>, String>>()?;
    of_bodies(arm, (&bodies, &rotors), mass)
        .ok_or_else(|| "rounded parameters may change B by too much".to_string())
}

fn of_bodies(
    arm: &Arm,
    (bodies, rotors): (&[Body], &[Option<Rotor>]),
    mass: &PosedMatrix,
) -> Option<Factors> {
    let most = mass.largest_diagonal()?;
    let n = most.len();
    let (mut least, mut velocity) = (vec![0.0; n], vec![0.0; n]);
    for (i, joint) in arm.joints.iter().enumerate() {
        let [before, own] = axis(arm.convention, joint);
        let rotor = rotors[i].as_ref();
        least[i] = bodies[i].along(joint.kind, &own) + rotor.map_or(0.0, Rotor::reflected);
        velocity[i] = match i.checked_sub(1) {
            None => 1.0 / least[i],
            Some(k) => {
                let of_links = bodies[i].mobility(joint.kind, &own) + bodies[k].mobility(joint.kind, &before);
                let turning = bodies[k].mobility(JointKind::Revolute, &before);
                rotor.map_or(of_links, |r| of_links.min((1.0 / r.inertia + turning) / r.ratio.powi(2)))
            }
        };
    }
    // The emitted code has the parameters of its set, rounded: a B' with |xᵀ(B' − B)x| ≤ share·xᵀBx.
    let moved = mass.moved_by_parameters()?;
    let entry = |at: usize| (velocity[at / n] * velocity[at % n]).sqrt() * moved[at];
    let share = (0..n * n).map(entry).sum::<f64>() * ROUNDED;
    if share.is_nan() || share >= MOVED {
        return None;
    }
    least.iter_mut().for_each(|x| *x *= 1.0 - share);
    velocity.iter_mut().for_each(|x| *x /= 1.0 - share);
    Factors::of_energy(&least, &velocity, &most)
}

/// The share of B by which rounded parameters may move it.
const MOVED: f64 = 0.5;

/// Of the smallest eigenvalue of a pseudo-inertia, relative to the largest: below that a body has no volume.
const THIN: f64 = 1e-9;

impl Body {
    /// A link without the rotor on it; `None` where it has no volume ([`THIN`]).
    fn of(set: &ParameterSet, values: &[f64], link: usize, rotor: Option<&Rotor>) -> Option<Body> {
        let v: [f64; 10] = std::array::from_fn(|k| given(set, values, link, ParameterKind::ALL[k]));
        let [mass, mx, my, mz, xx, xy, xz, yy, yz, zz] = v;
        let moment = Vector3::new(mx, my, mz);
        let centre = moment / mass;
        let spin = rotor.map_or(Matrix3::zeros(), |r| r.axis * r.axis.transpose() * r.inertia);
        let about_origin = Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz) - spin;
        let eigenvalues =
            pseudo_inertia(&parameters_of_body(mass, &moment, &about_origin)).symmetric_eigenvalues();
        if eigenvalues.min() <= THIN * eigenvalues.max() {
            return None;
        }
        let shift = centre.cross_matrix();
        let inertia = about_origin + shift * shift * mass;
        let of_inertia = inertia.try_inverse()?;
        Some(Body { mass, centre, of_inertia, about_origin, moment })
    }

    /// Twice the energy where it moves with 1 about or along an axis alone.
    fn along(&self, kind: JointKind, axis: &Axis) -> f64 {
        match kind {
            JointKind::Prismatic => self.mass,
            JointKind::Revolute => {
                // About the origin it is zᵀ·I·z; the axis goes through another point p: v = z × (r − p).
                let arm = axis.z.cross(&axis.point);
                let moved = self.about_origin * axis.z;
                axis.z.dot(&moved) - 2.0 * arm.dot(&axis.z.cross(&self.moment))
                    + self.mass * arm.norm_squared()
            }
        }
    }

    /// The largest square of its velocity about or along an axis where twice its energy is 1.
    fn mobility(&self, kind: JointKind, axis: &Axis) -> f64 {
        let about = |v: &Vector3<f64>| v.dot(&(self.of_inertia * v));
        match kind {
            JointKind::Revolute => about(&axis.z),
            JointKind::Prismatic => 1.0 / self.mass + about(&(axis.point - self.centre).cross(&axis.z)),
        }
    }
}

/// A joint's axis in the frame of the link before it, and in that of its own.
fn axis(convention: Convention, joint: &Joint) -> [Axis; 2] {
    let (s, c) = joint.alpha.radians().sin_cos();
    let [a, b, d] = [&joint.a, &joint.b, &joint.d].map(to_f64);
    let z = Vector3::z();
    match convention {
        Convention::Standard => {
            // T = Rz(θ)·(a, b, d)·Rx(α): z of the frame before, seen from the far end.
            let point = -Vector3::new(a, c * b + s * d, c * d - s * b);
            [Axis { z, point: Vector3::zeros() }, Axis { z: Vector3::new(0.0, s, c), point }]
        }
        Convention::Modified => {
            let before = Axis { z: Vector3::new(0.0, -s, c), point: Vector3::new(a, b, 0.0) };
            [before, Axis { z, point: Vector3::zeros() }]
        }
    }
}
