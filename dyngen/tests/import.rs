//! An imported arm moves, weighs and resists as the URDF says: against a Newton–Euler in the URDF's own
//! frames.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::arm::{Convention, JointKind, Parameter};
use dyngen::exact::rational::to_f64;
use dyngen::import::{self, ImportError, Imported, Options};
use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use nalgebra::{Matrix3, Matrix4, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use urdf_rs::{JointType, Robot};

/// Two ways of adding the same numbers, with lengths written to 1e-12 m.
const TOLERANCE: f64 = 1e-10;
const STATES: usize = 20;

const LWA4P: &str = include_str!("urdf/lwa4p.urdf");
const PUMA: &str = include_str!("urdf/puma.urdf");
const SLIDER: &str = include_str!("urdf/slider.urdf");
const ODD: &str = include_str!("urdf/odd.urdf");
const FIXED: &str = include_str!("urdf/fixed.urdf");

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

/// Three axes that calibration made almost parallel: their common normals are tens of metres away, the frames are
/// not, and the arm is the same.
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

fn imported(text: &str, tip: Option<&str>) -> Result<Imported, ImportError> {
    import::urdf(text, "robot.urdf", &options(tip, Convention::Modified))
}

#[test]
fn limits_and_names_are_kept_and_what_is_left_out_is_said() {
    let arm = imported(SLIDER, None).unwrap().arm;
    assert_eq!(arm.name, "lift \"scara\"");
    assert_eq!(arm.joints[0].kind, JointKind::Prismatic);
    assert_eq!(arm.joints[0].position, Some([0.0, 0.8]));
    assert_eq!((arm.joints[0].velocity, arm.joints[0].torque), (Some(0.5), Some(900.0)));
    let spin = &arm.joints[4];
    assert_eq!((spin.position, spin.velocity, spin.torque), (None, None, None));
    // A continuous joint has no limits, whatever its <limit> says.
    assert_eq!(imported(PUMA, None).unwrap().arm.joints[3].position, None);

    let with_gripper = imported(FIXED, Some("hand")).unwrap();
    assert!(with_gripper.notes.iter().any(|n| n.contains("'right'") && n.contains("'hand'")));
    assert!(with_gripper.text.contains("'turret', 'counterweight', 'bracket'"), "{}", with_gripper.text);
    let m1 = with_gripper.values.iter().find(|(p, _)| *p == Parameter::parse("m1").unwrap()).unwrap().1;
    assert_eq!(m1, 3.0 + 1.5);
}

#[test]
fn right_angles_and_lengths_come_out_exact() {
    let text = imported(LWA4P, None).unwrap().text;
    for line in ["a = 0.35", "alpha = \"pi\"", "d = 0.305", "theta = \"pi/2\"", "gravity = [0, 0, -9.81]"] {
        assert!(text.contains(&format!("{line}\n")), "{line} in\n{text}");
    }
    assert!(!text.contains("1.57"), "{text}");
}

#[test]
fn rounded_right_angles_need_a_word() {
    // The last axis is the one before it, to the digits that were written: 3.7e-6 rad apart.
    let rounded = PUMA.replace(
        "<origin rpy=\"1.5707963267948966 0 0\"/><axis xyz=\"0 0 -2\"/>",
        "<origin xyz=\"0 0.1 0\" rpy=\"1.5708 0 0\"/><axis xyz=\"0 -1 0\"/>",
    );
    assert_ne!(rounded, PUMA);
    let exact = Options { exact: true, ..Options::default() };
    // To the letter: frames near the arm, though the common normal is 27 km away.
    let letter = import::urdf(&rounded, "robot.urdf", &exact).unwrap().arm;
    assert!(letter.joints[5].alpha.quarter_turns().is_none(), "{letter:?}");
    let lengths = letter.joints.iter().flat_map(|j| [&j.a, &j.b, &j.d]);
    assert!(lengths.map(to_f64).all(|x| x.abs() < 1.0), "{letter:?}");
    let loose = Options { angle_tolerance: 1e-4, exact: true, ..Options::default() };
    let arm = import::urdf(&rounded, "robot.urdf", &loose).unwrap().arm;
    assert!(arm.joints.iter().all(|j| j.alpha.quarter_turns().is_some()), "{arm:?}");
}

/// The last joint sits 0.1 m off the axes that the rounding tilts by pi/2 − 1.5708 = 3.67e-6 rad, and a
/// length is a residue.
#[test]
fn rounded_numbers_are_taken_as_meant_and_said() {
    let place = "<origin rpy=\"1.5707963267948966 0 0\"/><axis xyz=\"0 0 -2\"/>";
    let rounded = "<origin xyz=\"3e-8 0.1 0\" rpy=\"1.5708 0 0\"/><axis xyz=\"0 -1 -4e-8\"/>";
    let rounded = PUMA.replace(place, rounded);
    let found = imported(&rounded, None).unwrap();
    let turn = found.arm.joints.last().unwrap();
    assert_eq!(turn.alpha.quarter_turns(), Some(2));
    let said =
        |words: &str| assert!(found.notes.iter().any(|n| n.contains(words)), "{words}: {:#?}", found.notes);
    said("joint 'turn': roll 1.5708 is pi/2, 0.00000003 of its origin is 0, -0.00000004 of its axis is 0");
    // 1.5708 − pi/2 is 3.67e-6 rad; an axis that is off by 4e-8 rad puts half a turn off by twice that.
    said("mm and 3.75e-3 mrad over the joints' ranges");
    let whole = imported(PUMA, None).unwrap();
    assert!(!whole.notes.iter().any(|n| n.contains("rounded")), "{:?}", whole.notes);
}

/// Reasons of a refusal; an unreadable text is none.
fn refusal(text: &str, tip: Option<&str>) -> String {
    match imported(text, tip) {
        Err(ImportError::Refused(reasons)) => reasons.join("\n"),
        other => panic!("{other:?}"),
    }
}

/// A follower on the chain is a link of the arm without a coordinate; what follows a joint that is held is held
/// where the ratio takes it.
#[test]
fn a_joint_that_follows_another_is_coupled_or_held_with_it() {
    let text = ODD.replacen(
        "<joint name=\"three\" type=\"prismatic\">",
        "<joint name=\"three\" type=\"prismatic\"><mimic joint=\"two\" multiplier=\"-1.5\" offset=\"0.1\"/>",
        1,
    );
    assert_ne!(text, ODD, "the test itself is wrong");
    let plain = imported(ODD, None).unwrap();
    let coupled = imported(&text, None).unwrap();
    assert_eq!((plain.arm.dof(), coupled.arm.dof(), coupled.arm.links()), (3, 2, 3));
    let mimic = coupled.arm.joints[2].mimic.as_ref().unwrap();
    assert_eq!(
        (mimic.joint, &mimic.ratio.to_string()[..], &mimic.offset.to_string()[..]),
        (1, "-3/2", "1/10")
    );
    assert_eq!(coupled.arm.joint_names(), ["one", "two"]);
    assert!(coupled.notes.iter().any(|n| n.contains("q(three) = -1.5·q(two) + 0.1")), "{:?}", coupled.notes);
    let held = |text: &str, lock: &[(&str, f64)]| {
        let lock = lock.iter().map(|(name, value)| (name.to_string(), *value)).collect();
        let options = Options { lock, ..Options::default() };
        dyngen::import::urdf(text, "arm.urdf", &options).unwrap().values
    };
    let (leader, both) =
        (held(&text, &[("two", 0.2)]), held(ODD, &[("two", 0.2), ("three", -1.5 * 0.2 + 0.1)]));
    assert_eq!(leader, both);
}

#[test]
fn what_is_no_serial_arm_is_refused_by_name() {
    let odd = |from: &str, to: &str| {
        assert!(ODD.contains(from), "the test itself is wrong: {from}");
        refusal(&ODD.replacen(from, to, 1), None)
    };
    let cases = [
        (refusal(FIXED, None), vec!["tree", "'left', 'right'", "--tip", "hand"]),
        (refusal(FIXED, Some("paw")), vec!["no link 'paw'"]),
        (refusal(FIXED, Some("right_finger")), vec!["'right'", "mimics joint 'left'"]),
        (refusal(FIXED, Some("table")), vec!["no joint moves", "'world'", "'table'"]),
        (odd("name=\"two\" type=\"revolute\"", "name=\"two\" type=\"floating\""), vec!["'two'", "floating"]),
        (odd("name=\"two\" type=\"revolute\"", "name=\"two\" type=\"planar\""), vec!["'two'", "planar"]),
        (odd("xyz=\"1 2 3\"", "xyz=\"0 0 0\""), vec!["'one'", "axis"]),
        (odd("xyz=\"1 2 3\"", "xyz=\"NaN 2 3\""), vec!["'one'", "axis"]),
        (odd("rpy=\"-0.3 0.9 1.3\"", "rpy=\"nan 0.9 1.3\""), vec!["'two'", "origin", "not finite"]),
        (odd("mass value=\"1.7\"", "mass value=\"-1.7\""), vec!["link 'b'", "mass", "negative"]),
        (odd("mass value=\"1.7\"", "mass value=\"inf\""), vec!["link 'b'", "not finite"]),
        (odd("parent link=\"b\"", "parent link=\"x\""), vec!["'three'", "'x'"]),
        (odd("parent link=\"a\"", "parent link=\"c\""), vec!["loop"]),
        (odd("child link=\"c\"", "child link=\"a\""), vec!["link 'a'", "'one' and 'three'"]),
        (
            odd("<link name=\"wall\"/>", "<link name=\"wall\"/><link name=\"stray\"/>"),
            vec!["'wall', 'stray'", "base"],
        ),
        (
            odd("<link name=\"wall\"/>", "<link name=\"wall\"/><link name=\"wall\"/>"),
            vec!["two links", "'wall'"],
        ),
        (refusal("<robot name=\"none\"/>", None), vec!["no links"]),
    ];
    for (reason, words) in cases {
        assert!(words.iter().all(|w| reason.contains(w)), "{words:?} in {reason}");
        assert!(reason.lines().all(|line| line.starts_with("robot.urdf: ")), "{reason}");
    }
    let both = ODD.replace("xyz=\"1 2 3\"", "xyz=\"0 0 0\"").replace("value=\"1.1\"", "value=\"-1.1\"");
    assert_eq!(refusal(&both, None).lines().count(), 2, "all reasons at once");
}

#[test]
fn seventeen_joints_are_one_too_many() {
    let mut text = "<robot name=\"snake\"><link name=\"l0\"/>".to_string();
    for i in 1..=17 {
        text += &format!(
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{}\"/><child \
                link=\"l{i}\"/>\
             <origin xyz=\"0.1 0 0.2\"/></joint>",
            i - 1
        );
    }
    text += "</robot>";
    let reason = refusal(&text, None);
    assert!(reason.contains("17 joints") && reason.contains("'j1' to 'j17'"), "{reason}");
    assert_eq!(imported(&text, Some("l16")).unwrap().arm.dof(), 16);
}

#[test]
fn what_is_no_urdf_is_unreadable() {
    let deep = "<a>".repeat(100_000);
    for text in ["", "robot", "<robot", "<robot name=\"x\"><link/></robot>", "<?xml?>", "\0", &deep] {
        assert!(
            matches!(imported(text, None), Err(ImportError::Unreadable(_))),
            "{}",
            &text[..text.len().min(40)]
        );
    }
}

#[test]
fn limits_that_are_no_range_are_left_out_and_said() {
    let turned = ODD.replacen("lower=\"-2\" upper=\"1.5\"", "lower=\"2\" upper=\"1.5\"", 1);
    let odd = imported(&turned, None).unwrap();
    assert_eq!(odd.arm.joints[0].position, None);
    let said = odd.notes.iter().any(|n| n.starts_with("line ") && n.contains("'one': its limits 2 … 1.5"));
    assert!(said, "{:?}", odd.notes);
}

/// What ROS tools put up with changes nothing of the arm.
#[test]
fn what_stands_beside_the_arm_is_put_up_with() {
    let clutter = "<material/><material name=\"m\"/><material name=\"m\"><texture/></material>\
                   <drake:joint><drake:deep link=\"x\"/></drake:joint><gazebo><joint/></gazebo>\
                   <transmission name=\"t\"><joint name=\"one\"/></transmission>";
    let crowded = ODD.replacen("<link name=\"wall\"/>", &format!("{clutter}<link name=\"wall\"/>"), 1);
    assert_ne!(crowded, ODD);
    assert_eq!(imported(&crowded, None).unwrap().arm, imported(ODD, None).unwrap().arm);
    assert_eq!(imported(&format!("\u{feff}\n{ODD}"), None).unwrap().arm, imported(ODD, None).unwrap().arm);
}

#[test]
fn other_kinds_of_file_are_recognised() {
    let xacro = "<robot name=\"x\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:macro/></robot>";
    let cases = [
        (xacro, "xacro FILE.xacro -o robot.urdf"),
        ("<sdf version=\"1.7\"><model name=\"m\"/></sdf>", "SDF"),
        ("<!DOCTYPE html><html><body><br></body></html>", "HTML"),
        ("<mujoco model=\"m\"/>", "MJCF"),
        (
            "<robot name=\"x\">\n<joint name=\"j\" type=\"fixed\"/></robot>",
            "line 2: joint 'j' has no <parent",
        ),
        (
            "<robot name=\"x\">\n<link name=\"l\"><inertial><mass value=\"1kg\"/></inertial></link></robot>",
            "'1kg'",
        ),
    ];
    for (text, words) in cases {
        match imported(text, None) {
            Err(ImportError::Unreadable(reason)) => assert!(reason.contains(words), "{words} in {reason}"),
            other => panic!("{other:?}"),
        }
    }
}

/// The importer's own values make every set of the arm it wrote, also where a set has no sums.
#[test]
fn imported_values_fit_every_set_of_their_arm() {
    let one = ODD.replacen("name=\"two\" type=\"revolute\"", "name=\"two\" type=\"fixed\"", 1);
    let one = one.replacen("name=\"three\" type=\"prismatic\"", "name=\"three\" type=\"fixed\"", 1);
    let slide = one.replacen("name=\"one\" type=\"revolute\"", "name=\"one\" type=\"prismatic\"", 1);
    for text in [LWA4P, PUMA, SLIDER, ODD, &one, &slide] {
        let imported = imported(text, None).unwrap();
        let values = dyngen::Values::parse(&imported.values_json(), "arm.values.json").unwrap();
        let model = Model::derive(imported.arm.clone()).unwrap();
        let mut all = vec![0.0; model.arm().all_parameters().len()];
        imported.values.iter().for_each(|(p, value)| all[p.index()] = *value);
        for kind in [SetKind::Full, SetKind::Minimal, SetKind::Symbolic] {
            let set = model.set(kind).unwrap();
            assert_eq!(values.of_set(&model, set).unwrap(), model.set_values(set, &all), "{kind}");
        }
    }
}

/// A joint that is held at a position is a fixed joint with that position in its origin, and what hangs on it
/// counts; what is left out is said in kilograms.
#[test]
fn held_joints_keep_their_mass_and_a_base_starts_the_chain() {
    let hand = |lock: &[(&str, f64)]| {
        let lock = lock.iter().map(|(name, value)| (name.to_string(), *value)).collect();
        let options = Options { tip: Some("hand".into()), lock, ..Options::default() };
        import::urdf(FIXED, "robot.urdf", &options)
    };
    let mass = |imported: &Imported| {
        imported
            .values
            .iter()
            .map(|(p, v)| (p.kind as usize == 0, v))
            .filter(|(m, _)| *m)
            .map(|(_, v)| *v)
            .sum::<f64>()
    };
    let (open, held) = (hand(&[]).unwrap(), hand(&[("left", 0.01), ("right", 0.02)]).unwrap());
    assert!(open.notes.iter().any(|n| n.contains("'left'") && n.contains(" kg")), "{:?}", open.notes);
    assert!(held.notes.iter().all(|n| !n.contains("left out")), "{:?}", held.notes);
    assert!(mass(&held) > mass(&open), "{} {}", mass(&held), mass(&open));
    let Err(ImportError::Refused(reasons)) = hand(&[("thumb", 0.0)]) else { panic!("accepted") };
    assert!(reasons[0].contains("no joint 'thumb'"), "{reasons:?}");

    let from = |base: &str, tip: &str| {
        let options = Options { base: Some(base.into()), tip: Some(tip.into()), ..Options::default() };
        import::urdf(ODD, "robot.urdf", &options)
    };
    let arm = from("a", "c").unwrap().arm;
    assert_eq!((arm.dof(), arm.joints[1].kind), (2, JointKind::Prismatic));
    let Err(ImportError::Refused(reasons)) = from("b", "a") else { panic!("accepted") };
    assert!(reasons[0].contains("not behind"), "{reasons:?}");
}
