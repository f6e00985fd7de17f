//! The regressor and the mass matrix as one writes them with nalgebra: numeric, for any table, with matrices
//! of fixed size.

use super::by_hand::Link;
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Rotation3, SMatrix, Vector3};
use powerball_workspace::root;

/// Y for all ten parameters of every link.
pub(crate) type Regressor = SMatrix<f64, 6, 60>;

/// A row of the table.
#[derive(Clone, Copy, Debug)]
struct Row {
    theta: f64,
    twist: Rotation3<f64>,
    offset: Vector3<f64>,
}

/// An arm of six revolute joints.
#[derive(Clone, Debug)]
pub(crate) struct Arm {
    rows: [Row; 6],
}

/// ω × as a matrix.
fn hat(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// L with L·(Ixx, Ixy, Ixz, Iyy, Iyz, Izz) = I·v, the products with the sign of the arm file.
fn by_tensor(v: &Vector3<f64>) -> Matrix3x6<f64> {
    Matrix3x6::new(
        v.x, -v.y, -v.z, 0.0, 0.0, 0.0, //
        0.0, -v.x, 0.0, v.y, -v.z, 0.0, //
        0.0, 0.0, -v.x, 0.0, -v.y, v.z,
    )
}

impl Arm {
    /// As [`super::by_hand::Arm::new`].
    pub(crate) fn new(file: &str) -> Arm {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        let arm = dyngen::Arm::parse(&text, file).unwrap();
        let number = dyngen::exact::rational::to_f64;
        let rows = std::array::from_fn(|i| {
            let joint = &arm.joints[i];
            let twist = Rotation3::from_axis_angle(&Vector3::x_axis(), joint.alpha.radians());
            let offset = twist.inverse() * Vector3::new(0.0, 0.0, number(&joint.d));
            Row { theta: joint.theta.radians(), twist, offset: offset + Vector3::x() * number(&joint.a) }
        });
        Arm { rows }
    }

    /// From the frame before into this one's, transposed.
    fn rotation(&self, i: usize, q: f64) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), q + self.rows[i].theta) * self.rows[i].twist
    }

    /// Y.
    #[inline(never)]
    pub(crate) fn regressor(&self, q: &[f64; 6], dq: &[f64; 6], ddq: &[f64; 6]) -> Regressor {
        let mut y = Regressor::zeros();
        let (mut w, mut dw, mut a) = (Vector3::zeros(), Vector3::zeros(), Vector3::new(0.0, 0.0, 9.81));
        let mut rotations = [Rotation3::identity(); 6];
        let z = Vector3::z();
        for i in 0..6 {
            let rotation = self.rotation(i, q[i]);
            rotations[i] = rotation;
            let p = &self.rows[i].offset;
            dw = rotation.inverse() * (dw + z * ddq[i] + w.cross(&(z * dq[i])));
            w = rotation.inverse() * (w + z * dq[i]);
            a = rotation.inverse() * a + dw.cross(p) + w.cross(&w.cross(p));
            // Force and moment of link i by its own parameters.
            let mut force = SMatrix::<f64, 3, 10>::zeros();
            let mut moment = SMatrix::<f64, 3, 10>::zeros();
            force.fixed_view_mut::<3, 1>(0, 0).copy_from(&a);
            force.fixed_view_mut::<3, 3>(0, 1).copy_from(&(hat(&dw) + hat(&w) * hat(&w)));
            moment.fixed_view_mut::<3, 3>(0, 1).copy_from(&-hat(&a));
            moment.fixed_view_mut::<3, 6>(0, 4).copy_from(&(by_tensor(&dw) + hat(&w) * by_tensor(&w)));
            for j in (0..=i).rev() {
                moment += hat(&self.rows[j].offset) * force;
                moment = rotations[j] * moment;
                force = rotations[j] * force;
                y.fixed_view_mut::<1, 10>(j, 10 * i).copy_from(&moment.row(2));
            }
        }
        y
    }

    /// B by the links' Jacobians.
    #[inline(never)]
    pub(crate) fn mass_matrix(&self, q: &[f64; 6], links: &[Link; 6]) -> Matrix6<f64> {
        let mut mass = Matrix6::zeros();
        let (mut rotation, mut origin) = (Rotation3::identity(), Vector3::zeros());
        let (mut axes, mut points) = ([Vector3::zeros(); 6], [Vector3::zeros(); 6]);
        for i in 0..6 {
            axes[i] = rotation * Vector3::z();
            points[i] = origin;
            rotation *= self.rotation(i, q[i]);
            origin += rotation * self.rows[i].offset;
            let l = &links[i];
            let first = rotation * Vector3::new(l[1], l[2], l[3]);
            let tensor = Matrix3::new(l[4], -l[5], -l[6], -l[5], l[7], -l[8], -l[6], -l[8], l[9]);
            let tensor = rotation.matrix() * tensor * rotation.matrix().transpose();
            let (mut linear, mut angular) = (Matrix3x6::zeros(), Matrix3x6::zeros());
            for j in 0..=i {
                angular.set_column(j, &axes[j]);
                linear.set_column(j, &axes[j].cross(&(origin - points[j])));
            }
            let coupled = linear.transpose() * (-hat(&first)) * angular;
            mass += l[0] * linear.transpose() * linear
                + coupled
                + coupled.transpose()
                + angular.transpose() * tensor * angular;
        }
        mass
    }
}
