//! An imported arm moves, weighs and resists as the URDF says: against a Newton–Euler in the URDF's own
//! frames, of what the crate urdf-rs reads.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::arm::Convention;
use dyngen::exact::rational::to_f64;
use dyngen::import::{self, Options};
use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use nalgebra::{Matrix3, Matrix4, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use urdf_rs::{JointType, Robot};

/// Two ways of adding the same numbers, with lengths written to 1e-12 m.
const TOLERANCE: f64 = 1e-10;
const STATES: usize = 20;

const LWA4P: &str = include_str!("../../dyngen/tests/urdf/lwa4p.urdf");
const PUMA: &str = include_str!("../../dyngen/tests/urdf/puma.urdf");
const SLIDER: &str = include_str!("../../dyngen/tests/urdf/slider.urdf");
const ODD: &str = include_str!("../../dyngen/tests/urdf/odd.urdf");
const FIXED: &str = include_str!("../../dyngen/tests/urdf/fixed.urdf");

fn options(tip: Option<&str>, convention: Convention) -> Options {
    Options { tip: tip.map(str::to_string), convention, ..Options::default() }
}

fn pose(origin: &urdf_rs::Pose) -> Matrix4<f64> {
    let [roll, pitch, yaw] = origin.rpy.0;
    let mut pose = Rotation3::from_euler_angles(roll, pitch, yaw).to_homogeneous();
    pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from(origin.xyz.0));
    pose
}

fn rotation(pose: &Matrix4<f64>) -> Matrix3<f64> {
    pose.fixed_view::<3, 3>(0, 0).into()
}

fn origin(pose: &Matrix4<f64>) -> Vector3<f64> {
    pose.fixed_view::<3, 1>(0, 3).into()
}

/// A link on its way through the world, seen from the root link's frame.
#[derive(Clone)]
struct Moving {
    pose: Matrix4<f64>,
    omega: Vector3<f64>,
    alpha: Vector3<f64>,
    /// Acceleration of its frame's origin.
    acceleration: Vector3<f64>,
    /// The joints of the chain before it: axis, a point on it, whether it turns.
    joints: Vec<(Vector3<f64>, Vector3<f64>, bool)>,
}

/// Joint torques and the pose of a link by the laws of Newton and Euler, each link on its own: no frames but
/// the URDF's, no merging, no recursion of forces. Joints other than those of the chain, and what they carry,
/// are left out.
fn reference(
    robot: &Robot,
    chain: &[&str],
    tip: &str,
    [q, dq, ddq]: &[Vec<f64>; 3],
) -> (Vec<f64>, Matrix4<f64>) {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let root = robot.links.iter().find(|l| robot.joints.iter().all(|j| j.child.link != l.name)).unwrap();
    let zero = Vector3::zeros();
    let still = Moving {
        pose: Matrix4::identity(),
        omega: zero,
        alpha: zero,
        acceleration: zero,
        joints: Vec::new(),
    };
    let mut torques = vec![0.0; chain.len()];
    let mut tip_pose = Matrix4::identity();
    let mut open = vec![(root.name.clone(), still)];
    while let Some((name, link)) = open.pop() {
        if name == tip {
            tip_pose = link.pose;
        }
        let inertial = &robot.links.iter().find(|l| l.name == name).unwrap().inertial;
        let at = link.pose * pose(&inertial.origin);
        let (m, i) = (inertial.mass.value, &inertial.inertia);
        let tensor = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
        let tensor = rotation(&at) * tensor * rotation(&at).transpose();
        let r = origin(&at) - origin(&link.pose);
        let (w, a) = (link.omega, link.alpha);
        let force = m * (link.acceleration + a.cross(&r) + w.cross(&w.cross(&r)) - gravity);
        let moment = tensor * a + w.cross(&(tensor * w));
        for (torque, (axis, point, turns)) in torques.iter_mut().zip(&link.joints) {
            let along = if *turns { (origin(&at) - point).cross(&force) + moment } else { force };
            *torque += axis.dot(&along);
        }
        for joint in robot.joints.iter().filter(|j| j.parent.link == name) {
            let mut next = link.clone();
            let frame = link.pose * pose(&joint.origin);
            let moving = joint.joint_type != JointType::Fixed;
            let Some(k) = chain.iter().position(|c| *c == joint.name) else {
                let r = origin(&frame) - origin(&link.pose);
                next.pose = frame;
                next.acceleration += a.cross(&r) + w.cross(&w.cross(&r));
                if !moving {
                    open.push((joint.child.link.clone(), next));
                }
                continue;
            };
            let axis = rotation(&frame) * Vector3::from(joint.axis.xyz.0).normalize();
            let turns = joint.joint_type != JointType::Prismatic;
            next.joints.push((axis, origin(&frame), turns));
            let mut slide = Vector3::zeros();
            let mut turn = Matrix4::identity();
            if turns {
                turn = Rotation3::new(axis * q[k]).to_homogeneous();
                next.omega += axis * dq[k];
                next.alpha += axis * ddq[k] + w.cross(&axis) * dq[k];
            } else {
                slide = axis * q[k];
            }
            let r = origin(&frame) + slide - origin(&link.pose);
            next.acceleration += a.cross(&r) + w.cross(&w.cross(&r));
            if !turns {
                next.acceleration += axis * ddq[k] + 2.0 * w.cross(&axis) * dq[k];
            }
            next.pose = Rotation3::from_matrix_unchecked(rotation(&turn) * rotation(&frame)).to_homogeneous();
            next.pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&(origin(&frame) + slide));
            open.push((joint.child.link.clone(), next));
        }
    }
    (torques, tip_pose)
}

fn assert_close(what: &str, actual: &[f64], expected: &[f64]) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1.0f64, |m, x| m.max(x.abs()));
    for (i, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= TOLERANCE * scale, "{what}: entry {i}: {a} against {e}");
    }
}

/// The pose of frame 0 that the arm file says, row by row.
fn placed(arm: &Arm) -> Vec<f64> {
    let Some(base) = &arm.base else { return Matrix4::identity().as_slice().to_vec() };
    let [roll, pitch, yaw] = base.rpy.each_ref().map(|angle| angle.radians());
    let mut pose = Rotation3::from_euler_angles(roll, pitch, yaw).to_homogeneous();
    for i in 0..3 {
        pose[(i, 3)] = to_f64(&base.xyz[i]);
    }
    pose.transpose().as_slice().to_vec()
}

/// Torques and pose of the imported arm against the reference, in both conventions.
fn check(text: &str, tip: Option<&str>, chain: &[&str], last: &str) {
    let robot = urdf_rs::read_from_string(text).unwrap();
    for convention in [Convention::Modified, Convention::Standard] {
        let what = format!("{} {convention:?}", robot.name);
        let imported = import::urdf(text, "test.urdf", &options(tip, convention)).unwrap();
        assert_eq!(Arm::parse(&imported.text, "test").unwrap(), imported.arm);
        let model = Model::derive(imported.arm.clone()).unwrap();
        let n = model.arm().dof();
        assert_eq!(n, chain.len(), "{what}");
        assert_eq!(model.arm().joint_names(), chain, "{what}");
        assert_close(&format!("{what} base"), &placed(&imported.arm), &imported.base.concat());
        let mut all = vec![0.0; model.arm().all_parameters().len()];
        imported.values.iter().for_each(|(p, value)| all[p.index()] = *value);
        let torque = Evaluator::new(&model, Function::InverseDynamics, SetKind::Minimal).unwrap();
        let parameters = model.set_values(model.set(SetKind::Minimal).unwrap(), &all);
        let kinematics = Evaluator::new(&model, Function::ForwardKinematics, SetKind::Minimal).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..STATES {
            let state: [Vec<f64>; 3] =
                std::array::from_fn(|_| (0..n).map(|_| rng.random_range(-3.0..3.0)).collect());
            let (expected, tip_pose) = reference(&robot, chain, last, &state);
            let [q, dq, ddq] = &state;
            let mut actual = vec![0.0; n];
            torque.evaluate(q, dq, ddq, &parameters, &mut actual);
            assert_close(&what, &actual, &expected);
            let mut flange = [0.0; 16];
            kinematics.evaluate(q, &[], &[], &[], &mut flange);
            let flange = Matrix4::from_row_slice(&flange);
            assert_close(&format!("{what} pose of {last}"), flange.as_slice(), tip_pose.as_slice());
        }
    }
}

#[test]
fn the_lwa_4p_of_pinocchio_is_the_same_arm() {
    check(LWA4P, None, &["j1", "j2", "j3", "j4", "j5", "j6"], "l6");
}

#[test]
fn a_puma_with_offsets_and_a_flipped_last_axis() {
    check(PUMA, None, &["waist", "shoulder", "elbow", "roll", "bend", "turn"], "flange");
}

#[test]
fn sliding_joints_among_parallel_axes() {
    check(SLIDER, None, &["lift", "shoulder", "elbow", "stroke", "spin"], "chuck");
}

#[test]
fn skew_axes_on_a_tilted_base() {
    check(ODD, None, &["one", "two", "three"], "c");
}

/// Three axes that calibration made almost parallel: their common normals are tens of metres away, the frames
/// are not, and the arm is the same.
#[test]
fn almost_parallel_axes_have_their_frames_near_the_arm() {
    let elbow = "<origin xyz=\"0.4318 0 -0.0934\"/>";
    let shoulder = "<origin xyz=\"0 0.2435 0\" rpy=\"-1.5707963267948966 0 0\"/>";
    let text = PUMA
        .replacen(elbow, "<origin xyz=\"0.4318 0.0007 -0.0934\" rpy=\"0.0007 -0.0043 0.3\"/>", 1)
        .replacen(shoulder, "<origin xyz=\"0 0.2435 0\" rpy=\"0.0021 3.1311 0.01\"/>", 1);
    assert!(PUMA.contains(elbow) && PUMA.contains(shoulder), "the test itself is wrong");
    check(&text, None, &["waist", "shoulder", "elbow", "roll", "bend", "turn"], "flange");
    for convention in [Convention::Modified, Convention::Standard] {
        let arm = import::urdf(&text, "test.urdf", &options(None, convention)).unwrap().arm;
        assert!(arm.joints.iter().any(|joint| to_f64(&joint.b) != 0.0), "{convention:?}");
        for length in arm.joints.iter().flat_map(|joint| [&joint.a, &joint.b, &joint.d]) {
            assert!(to_f64(length).abs() < 0.8, "{convention:?}: {}", to_f64(length));
        }
    }
}

#[test]
fn fixed_joints_become_part_of_what_they_are_fixed_to() {
    check(FIXED, Some("hand"), &["pan", "tilt"], "hand");
    check(FIXED, Some("left_finger"), &["pan", "tilt", "left"], "left_finger");
}
