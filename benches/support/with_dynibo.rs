//! The arm in the crate dynibo, a numeric Newton–Euler for trees of links that reads URDF.

use super::by_hand::Link;
use dynibo::Robot;
use std::fmt::Write;

/// Gravity in DynIbo, which no option changes, m/s².
const GRAVITY: f64 = 9.806_65;

/// An arm of six revolute joints.
#[derive(Debug)]
pub(crate) struct Arm(Robot);

impl Arm {
    /// The arm of a file with standard frames and revolute joints, with its links.
    pub(crate) fn new(arm: &dyngen::Arm, links: &[Link; 6]) -> Arm {
        let path = std::env::temp_dir().join(format!("dynamics-bench-{}.urdf", std::process::id()));
        std::fs::write(&path, urdf(arm, links)).unwrap();
        let robot = Robot::from_urdf(&path);
        std::fs::remove_file(&path).unwrap();
        Arm(robot.unwrap())
    }

    /// τ.
    #[inline(never)]
    pub(crate) fn inverse_dynamics(&mut self, q: &[f64; 6], dq: &[f64; 6], ddq: &[f64; 6]) -> [f64; 6] {
        let mut torque = [0.0; 6];
        self.0.inverse_dynamics(q, dq, ddq, &[], &mut torque).unwrap();
        torque
    }

    /// B, column by column.
    #[inline(never)]
    pub(crate) fn mass_matrix(&mut self, q: &[f64; 6]) -> [f64; 36] {
        let mut mass = [0.0; 36];
        self.0.mass_matrix(q, &mut mass).unwrap();
        mass
    }

    /// What τ lacks where gravity is another, m/s².
    pub(crate) fn more_gravity(&mut self, q: &[f64; 6], gravity: f64) -> [f64; 6] {
        let mut torque = [0.0; 6];
        self.0.gravity(q, &[], &mut torque).unwrap();
        torque.map(|torque| torque * (gravity / GRAVITY - 1.0))
    }
}

/// A link's frame in a URDF is the one that its joint turns: what follows in the Denavit–Hartenberg row
/// stands in the next joint's origin, and in the place of the inertia.
fn urdf(arm: &dyngen::Arm, links: &[Link; 6]) -> String {
    let number = dyngen::exact::rational::to_f64;
    let mut text = "<robot name='arm'><link name='l0'/>".to_string();
    let mut origin = [0.0; 4];
    for (i, (joint, link)) in arm.joints.iter().zip(links).enumerate() {
        let [m, mx, my, mz, xx, xy, xz, yy, yz, zz] = *link;
        let [x, y, z] = [mx / m, my / m, mz / m];
        let (alpha, theta, a, d) =
            (joint.alpha.radians(), joint.theta.radians(), number(&joint.a), number(&joint.d));
        let (s, c) = alpha.sin_cos();
        let place = [x + a, c * y - s * z, s * y + c * z + d];
        let [before_a, before_d, before_s, before_c] = origin;
        let [roll, pitch, yaw] = angles(f64::atan2(before_s, before_c), theta);
        let _ = write!(
            text,
            "<joint name='j{i}' type='revolute'><parent link='l{i}'/><child link='l{}'/><axis xyz='0 0 1'/>\
             <origin xyz='{before_a} 0 {before_d}' rpy='{roll} {pitch} {yaw}'/>\
             <limit lower='-9' upper='9' effort='999' velocity='9'/></joint>\
             <link name='l{}'><inertial><origin xyz='{} {} {}' rpy='{alpha} 0 0'/><mass value='{m}'/>\
             <inertia ixx='{}' ixy='{}' ixz='{}' iyy='{}' iyz='{}' izz='{}'/></inertial></link>",
            i + 1,
            i + 1,
            place[0],
            place[1],
            place[2],
            // About the centre of mass (Steiner).
            xx - m * (y * y + z * z),
            m * x * y - xy,
            m * x * z - xz,
            yy - m * (x * x + z * z),
            m * y * z - yz,
            zz - m * (x * x + y * y),
        );
        origin = [a, d, s, c];
    }
    text + "</robot>"
}

/// Roll, pitch and yaw of Rx(roll)·Rz(turn).
fn angles(roll: f64, turn: f64) -> [f64; 3] {
    let rotation = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::x_axis(), roll)
        * nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), turn);
    rotation.euler_angles().into()
}
