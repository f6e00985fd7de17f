//! The geometry of a serial arm in numbers, from its arm file.

use dyngen::arm::{Arm, Convention, Joint, JointKind};
use dyngen::exact::rational::to_f64;
use nalgebra::{Matrix3, Vector3};

/// One joint of a chain: its row of the Denavit–Hartenberg table as numbers.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    standard: bool,
    revolute: bool,
    a: f64,
    b: f64,
    sin_cos_alpha: (f64, f64),
    d: f64,
    theta: f64,
    ratio: f64,
}

impl Row {
    fn new(joint: &Joint, convention: Convention) -> Self {
        Row {
            standard: convention == Convention::Standard,
            revolute: joint.kind == JointKind::Revolute,
            a: to_f64(&joint.a),
            b: to_f64(&joint.b),
            sin_cos_alpha: joint.alpha.sin_cos(),
            d: to_f64(&joint.d),
            theta: joint.theta.radians(),
            ratio: joint.rotor_ratio.as_ref().map_or(0.0, to_f64),
        }
    }

    /// Whether the joint turns; else it slides.
    pub fn is_revolute(&self) -> bool {
        self.revolute
    }

    /// The gear ratio k of the joint's rotor, 0 where it has none.
    pub fn ratio(&self) -> f64 {
        self.ratio
    }

    /// The pose of frame i in frame i−1 at joint position `q`: rotation (columns are the axes of frame i) and
    /// origin in m.
    pub fn pose(&self, q: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let (theta, d) = if self.revolute { (self.theta + q, self.d) } else { (self.theta, self.d + q) };
        let (st, ct) = theta.sin_cos();
        let (sa, ca) = self.sin_cos_alpha;
        if self.standard {
            let rotation = Matrix3::new(ct, -st * ca, st * sa, st, ct * ca, -ct * sa, 0.0, sa, ca);
            (rotation, Vector3::new(self.a * ct - self.b * st, self.a * st + self.b * ct, d))
        } else {
            let rotation = Matrix3::new(ct, -st, 0.0, st * ca, ct * ca, -sa, st * sa, ct * sa, ca);
            (rotation, Vector3::new(self.a, self.b - d * sa, d * ca))
        }
    }

    /// The joint's axis in frame i−1, where it does not move: z of frame i−1 (standard) or z of frame i
    /// (modified).
    pub fn axis(&self) -> Vector3<f64> {
        let (sa, ca) = self.sin_cos_alpha;
        if self.standard { Vector3::z() } else { Vector3::new(0.0, -sa, ca) }
    }

    /// Whether the offset between the origins turns with the joint. It does where frame i sits at the far end
    /// of a turning link; otherwise it is fixed in link i−1 but for the joint's own sliding.
    pub fn offset_turns(&self) -> bool {
        self.standard && self.revolute
    }

    /// A point on the joint's axis in frame i−1, given the origin of frame i.
    pub fn point_on_axis(&self, origin: Vector3<f64>) -> Vector3<f64> {
        if self.standard { Vector3::zeros() } else { origin }
    }
}

/// A serial chain: the rows from the base outwards, and gravity.
#[derive(Clone, Debug)]
pub struct Chain {
    rows: Vec<Row>,
    /// Motor velocities = matrix · joint velocities, by rows, where a motor turns with several joints.
    motors: Option<Vec<Vec<f64>>>,
    /// Gravity in the base frame, m/s².
    pub gravity: Vector3<f64>,
}

impl Chain {
    /// The chain that an arm file describes.
    pub fn new(arm: &Arm) -> Self {
        Chain {
            rows: arm.joints.iter().map(|joint| Row::new(joint, arm.convention)).collect(),
            motors: (!arm.transmissions.is_empty()).then(|| arm.motor_velocity_matrix_f64()),
            gravity: Vector3::from_iterator(arm.gravity.iter().map(to_f64)),
        }
    }

    /// The joints from the base outwards.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The velocity, or acceleration, of a joint's motor on the joint's side of its gear, for those of all
    /// joints.
    pub fn motor_rate(&self, motor: usize, rates: &[f64]) -> f64 {
        match &self.motors {
            None => rates[motor],
            Some(matrix) => matrix[motor].iter().zip(rates).map(|(m, rate)| m * rate).sum(),
        }
    }

    /// Adds to the joints' torques what a motor's torque on the joint's side of its gear is at them.
    pub fn add_motor_torque(&self, motor: usize, torque: f64, torques: &mut [f64]) {
        match &self.motors {
            None => torques[motor] += torque,
            Some(matrix) => {
                torques.iter_mut().zip(&matrix[motor]).for_each(|(sum, factor)| *sum += factor * torque)
            }
        }
    }

    /// The number of joints.
    pub fn dof(&self) -> usize {
        self.rows.len()
    }

    /// The pose of every frame in the base frame, from frame 1 on.
    pub fn poses(&self, q: &[f64]) -> Vec<(Matrix3<f64>, Vector3<f64>)> {
        let (mut rotation, mut origin) = (Matrix3::identity(), Vector3::zeros());
        self.rows
            .iter()
            .zip(q)
            .map(|(row, q)| {
                let (r, p) = row.pose(*q);
                origin += rotation * p;
                rotation *= r;
                (rotation, origin)
            })
            .collect()
    }
}
