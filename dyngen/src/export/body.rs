//! A link's body in other axes: from the arm's parameters to mass, centre and inertia for a robot
//! description.

use crate::arm::{Arm, Convention, JointKind, Placement};
use crate::consistency::{parameters_of_body, pseudo_inertia};
use crate::exact::rational::to_f64;
use crate::import::pose::Pose;
use nalgebra::{Matrix3, Vector3};

/// A body in a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// kg
    pub(super) mass: f64,
    /// Mass times centre of mass, kg·m.
    pub(super) moment: Vector3<f64>,
    /// Inertia tensor about the frame's origin, kg·m².
    pub(super) tensor: Matrix3<f64>,
}

impl Body {
    /// The body of a link's ten parameters, in the link's frame.
    pub(super) fn of_parameters(v: &[f64]) -> Body {
        Body {
            mass: v[0],
            moment: Vector3::new(v[1], v[2], v[3]),
            // Products of inertia are the negative elements off the diagonal (Eq. 8).
            tensor: Matrix3::new(v[4], -v[5], -v[6], -v[5], v[7], -v[8], -v[6], -v[8], v[9]),
        }
    }

    /// The body of a mass, a centre and the tensor about the centre, all in one frame's axes.
    pub(super) fn about_centre(mass: f64, centre: Vector3<f64>, inertia: &Matrix3<f64>) -> Body {
        Body { mass, moment: centre * mass, tensor: inertia + mass * steiner(&centre) }
    }

    /// The body in a frame that has this pose in the frame in which the body is given.
    pub(super) fn seen_from(&self, frame: &Pose) -> Body {
        let back = frame.rotation.transpose();
        let p = frame.origin;
        // About the other origin: I + m·(p² − p pᵀ) − (2 p·s − p sᵀ − s pᵀ).
        let s = self.moment;
        let mixed = Matrix3::identity() * (2.0 * p.dot(&s)) - p * s.transpose() - s * p.transpose();
        let tensor = self.tensor + self.mass * steiner(&p) - mixed;
        Body { mass: self.mass, moment: back * (s - p * self.mass), tensor: back * tensor * frame.rotation }
    }

    pub(super) fn less(&self, other: &Body) -> Body {
        Body {
            mass: self.mass - other.mass,
            moment: self.moment - other.moment,
            tensor: self.tensor - other.tensor,
        }
    }

    /// Centre of mass, m, and the tensor about it; the origin where there is no mass.
    pub(super) fn centre(&self) -> (Vector3<f64>, Matrix3<f64>) {
        if self.mass == 0.0 {
            return (Vector3::zeros(), self.tensor);
        }
        let centre = self.moment / self.mass;
        (centre, self.tensor - self.mass * steiner(&centre))
    }

    /// Whether a distribution of mass has it.
    pub(super) fn is_possible(&self) -> bool {
        let v = parameters_of_body(self.mass, &self.moment, &self.tensor);
        self.mass > 0.0 && pseudo_inertia(&v).symmetric_eigenvalues().min() >= 0.0
    }
}

/// p² − p pᵀ: the inertia of a unit mass at p.
fn steiner(p: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * p.norm_squared() - p * p.transpose()
}

/// The frames of an arm's links at q = 0, and of each joint's axis, in the root link's frame.
pub(super) fn frames(arm: &Arm) -> (Vec<Pose>, Vec<Pose>) {
    let mut pose = placed(&arm.base);
    let (mut links, mut axes) = (Vec::new(), Vec::new());
    for joint in &arm.joints {
        let turn = |angle: f64, axis: usize| -> Matrix3<f64> {
            let (s, c) = angle.sin_cos();
            match axis {
                0 => Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c),
                _ => Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0),
            }
        };
        let z = Pose { rotation: turn(joint.theta.radians(), 2), origin: Vector3::z() * to_f64(&joint.d) };
        let across = Vector3::new(to_f64(&joint.a), to_f64(&joint.b), 0.0);
        let x = Pose { rotation: turn(joint.alpha.radians(), 0), origin: across };
        if arm.convention == Convention::Modified {
            pose = pose.then(&x);
        }
        axes.push(pose);
        pose = pose.then(&z);
        if arm.convention == Convention::Standard {
            pose = pose.then(&x);
        }
        links.push(pose);
    }
    (links, axes)
}

/// A placement as a pose; none is where the frame that it is in stands.
pub(super) fn placed(placement: &Option<Placement>) -> Pose {
    let Some(placement) = placement else { return Pose::identity() };
    let rpy = placement.rpy.each_ref().map(|angle| angle.radians());
    let xyz = placement.xyz.each_ref().map(to_f64);
    Pose::of(&crate::import::urdf::Origin { xyz, rpy }, 1e-12)
}

/// How far an axis of the arm is from one that a description says: distance, m, and angle, rad.
pub(super) fn apart(
    axis: &Pose,
    kind: JointKind,
    point: &Vector3<f64>,
    direction: &Vector3<f64>,
) -> (f64, f64) {
    let z = axis.rotation.column(2).into_owned();
    let way = point - axis.origin;
    let distance = match kind {
        JointKind::Revolute => (way - z * z.dot(&way)).norm(),
        JointKind::Prismatic => 0.0,
    };
    (distance, z.cross(direction).norm().atan2(z.dot(direction)))
}
