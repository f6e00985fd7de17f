//! Frames that are fixed on links: the tool's functions at any of them.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use dyngen::import::{self, Imported, Options};
use dyngen::{Arm, Evaluator, Function, Model, Samples, SetKind};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rand::SeedableRng;
use support::{State, evaluate, model};

/// A turning, a sliding and a turning joint, one that follows, and one more.
const ARM: &str = r#"
name = "five"
convention = "standard"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0.1, alpha = "pi/2", d = 0.3, theta = 0, rotor_ratio = 100 },
    { kind = "prismatic", a = 0, alpha = "-pi/2", d = 0.2, theta = "pi/2" },
    { kind = "revolute", a = 0.25, alpha = 0.7, d = 0.05, theta = 0 },
    { kind = "revolute", a = 0.2, alpha = "pi/2", d = 0, theta = "pi/2", mimic = { joint = 3, ratio = -1 } },
    { kind = "revolute", a = 0, alpha = 0, d = 0.1, theta = 0 },
]
[base]
xyz = [0, 0.1, 0.4]
rpy = [0, 0, "pi/2"]
"#;

const PLACE: &str = "xyz = [0.1, -0.02, 0.3]\nrpy = [0.4, \"pi/3\", \"-pi/2\"]\n";

fn with_frames(text: &str) -> String {
    let frame = |link: usize| format!("[[frame]]\nname = \"on_{link}\"\nlink = {link}\n{PLACE}");
    text.to_string() + &(1..=5).map(frame).collect::<String>()
}

/// The arm that ends at a link, with its tool where the frame is.
fn cut(text: &str, links: usize) -> Arm {
    let mut arm = Arm::parse(&(text.to_string() + "[tool]\n" + PLACE), "cut.toml").unwrap();
    arm.joints.truncate(links);
    arm
}

fn modified(text: &str) -> String {
    text.replace("\"standard\"", "\"modified\"")
}

fn of_tool() -> Vec<Function> {
    Function::ALL.into_iter().filter(|f| f.is_kinematic()).collect()
}

/// What comes behind a frame's link does not move it: the functions are those of an arm that ends there.
#[test]
fn a_frame_moves_as_the_tool_of_an_arm_that_ends_at_its_link() {
    let mut random = chacha20::ChaCha8Rng::seed_from_u64(71);
    for text in [ARM.to_string(), modified(ARM)] {
        let whole = Model::kinematic(Arm::parse(&with_frames(&text), "arm.toml").unwrap());
        let state = State::draw(&mut random, whole.arm().dof(), 1.2);
        for links in 1..=5 {
            let at = whole.at_frame(&format!("on_{links}")).unwrap();
            let alone = Model::kinematic(cut(&text, links));
            let n = alone.arm().dof();
            let mut of_cut = state.clone();
            [&mut of_cut.q, &mut of_cut.dq, &mut of_cut.ddq].into_iter().for_each(|x| x.truncate(n));
            for function in of_tool() {
                let result = |model: &Model, state: &State| {
                    let evaluator = Evaluator::new(model, function, SetKind::Full).unwrap();
                    (evaluator.shape(), evaluate(&evaluator, &state.samples(&[])))
                };
                let ((rows, columns), found) = result(&at, &state);
                let ((fewer_rows, fewer), expected) = result(&alone, &of_cut);
                for i in 0..rows {
                    for j in 0..columns {
                        let there = i < fewer_rows && j < fewer;
                        let expected = if there { expected[i * fewer + j] } else { 0.0 };
                        let miss = (found[i * columns + j] - expected).abs();
                        assert!(miss < 1e-12, "{function} of link {links}, row {i}, column {j}: {miss:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn dynamics_do_not_change_and_the_tool_s_inertia_is_asked_at_a_frame() {
    // With angles that are no multiples of pi sets take long.
    let text = ARM.replace("0.7", "\"pi/4\"");
    let (plain, framed) = (model(&text), model(&with_frames(&text)));
    let names = |model: &Model| model.set(SetKind::Minimal).unwrap().names();
    assert_eq!(names(&plain), names(&framed));
    let at = framed.at_frame("on_3").unwrap();
    assert!(Evaluator::new(&at, Function::TaskInertiaInverse, SetKind::Minimal).is_ok());
    assert!(framed.at_frame("hand").is_none());
}

/// A turn by a URDF's roll, pitch and yaw, and a shift.
fn placed(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
    Isometry3::from_parts(Translation3::from(xyz), turn)
}

/// The pose of a frame of an imported arm, and of its tool.
fn pose(imported: &Imported, frame: Option<&str>, q: &[f64]) -> Vec<f64> {
    let model = Model::kinematic(imported.arm.clone());
    let model = frame.map_or(model.clone(), |name| model.at_frame(name).unwrap());
    let evaluator = Evaluator::new(&model, Function::ForwardKinematics, SetKind::Full).unwrap();
    evaluate(&evaluator, &Samples { q, ..Samples::default() })
}

fn close(found: &[f64], expected: &Isometry3<f64>) {
    let expected = expected.to_homogeneous().transpose();
    let miss = found.iter().zip(expected.iter()).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(miss < 1e-12, "{found:?} is not {expected}");
}

/// A camera that is fixed to a bracket on the first link, and a flange behind the second joint.
const URDF: &str = r#"<robot name="r">
<link name="base"/><link name="upper"/><link name="bracket"/><link name="Camera-1"/><link name="lower"/>
<link name="flange"/><link name="gauge"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0.1 0.3" rpy="0.2 0 0"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="b" type="fixed"><parent link="upper"/><child link="bracket"/><origin xyz="0.1 0.2 0.3"/></joint>
<joint name="c" type="fixed"><parent link="bracket"/><child link="Camera-1"/><origin xyz="0 0 0.05" rpy="0.3 -0.4 0.5"/></joint>
<joint name="j2" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0" rpy="0 0.7 0"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="f" type="fixed"><parent link="lower"/><child link="flange"/><origin xyz="0 0 0.1"/></joint>
<joint name="g" type="fixed"><parent link="lower"/><child link="gauge"/><origin xyz="0.02 0 0" rpy="0 0 1.1"/></joint>
</robot>"#;

#[test]
fn fixed_links_of_a_urdf_are_frames() {
    let options = Options { tip: Some("flange".into()), ..Options::default() };
    let imported = import::urdf(URDF, "r.urdf", &options).unwrap();
    let names: Vec<&str> = imported.arm.frames.iter().map(|frame| frame.name.as_str()).collect();
    // The tip is the tool.
    assert_eq!(names, ["bracket", "camera_1", "gauge"]);
    let q = [0.8, -0.3];
    let upper = placed([0.0, 0.1, 0.3], [0.2, 0.0, 0.0]) * placed([0.0; 3], [0.0, 0.0, q[0]]);
    let bracket = upper * placed([0.1, 0.2, 0.3], [0.0; 3]);
    close(&pose(&imported, Some("bracket"), &q), &bracket);
    let camera = bracket * placed([0.0, 0.0, 0.05], [0.3, -0.4, 0.5]);
    close(&pose(&imported, Some("camera_1"), &q), &camera);
    let lower = upper * placed([0.4, 0.0, 0.0], [0.0, 0.7, 0.0]) * placed([0.0, 0.0, q[1]], [0.0; 3]);
    close(&pose(&imported, Some("gauge"), &q), &(lower * placed([0.02, 0.0, 0.0], [0.0, 0.0, 1.1])));
    close(&pose(&imported, None, &q), &(lower * placed([0.0, 0.0, 0.1], [0.0; 3])));
}

#[test]
fn sites_of_a_mujoco_model_are_frames() {
    let text = r#"<mujoco model="m"><compiler angle="radian"/><worldbody><site name="world"/><body name="a" pos="0 0 0.5">
<joint name="j1" axis="0 1 0"/><geom type="sphere" size="0.1" mass="1"/><site name="Wrist Cam" pos="0.1 0 0.2"/><site/>
<frame pos="0 0.3 0"><site name="move" euler="0 0 0.4"/></frame>
<body name="b" pos="0.3 0 0"><joint name="j2" axis="0 0 1"/><geom type="sphere" size="0.1" mass="1"/>
<site name="wrist_cam" pos="0 0 0.1"/></body></body></worldbody></mujoco>"#;
    let imported = import::mjcf(text, "m.xml", &Options::default()).unwrap();
    let names: Vec<&str> = imported.arm.frames.iter().map(|frame| frame.name.as_str()).collect();
    // Neither a word of Rust nor another frame's name.
    assert_eq!(names, ["wrist_cam", "frame_move", "wrist_cam_2"]);
    let q = [0.6, -1.2];
    let a = placed([0.0, 0.0, 0.5], [0.0, q[0], 0.0]);
    close(&pose(&imported, Some("wrist_cam"), &q), &(a * placed([0.1, 0.0, 0.2], [0.0; 3])));
    close(&pose(&imported, Some("frame_move"), &q), &(a * placed([0.0, 0.3, 0.0], [0.0, 0.0, 0.4])));
    let b = a * placed([0.3, 0.0, 0.0], [0.0, 0.0, q[1]]);
    close(&pose(&imported, Some("wrist_cam_2"), &q), &(b * placed([0.0, 0.0, 0.1], [0.0; 3])));
}

#[test]
fn frames_that_cannot_be_are_refused_with_their_line() {
    let error = |frame: &str| Arm::parse(&(ARM.to_string() + frame), "arm.toml").unwrap_err().to_string();
    for (frame, words) in [
        ("[[frame]]\nname = \"a\"\nlink = 6\n", "link must be one of the links 1 to 5"),
        ("[[frame]]\nname = \"a\"\nlink = 0\n", "link must be one of the links 1 to 5"),
        ("[[frame]]\nname = \"a\"\n", "the key 'link' is missing"),
        ("[[frame]]\nlink = 1\n", "the key 'name' is missing"),
        ("[[frame]]\nname = \"type\"\nlink = 1\n", "no word of Rust"),
        ("[[frame]]\nname = \"Left hand\"\nlink = 1\n", "lowercase letters, digits and _"),
        (
            "[[frame]]\nname = \"a\"\nlink = 1\n[[frame]]\nname = \"a\"\nlink = 2\n",
            "the name of another frame",
        ),
        ("[[frame]]\nname = \"a\"\nlink = 1\nmass = 2\n", "unknown key 'mass'"),
        ("[[frame]]\nname = \"a\"\nlink = 1\nxyz = [1]\n", "xyz must be three numbers"),
    ] {
        let message = error(frame);
        assert!(message.contains(words) && message.contains("arm.toml:1"), "{frame}: {message}");
    }
}

/// A model of a robot has a frame for each sensor, at angles of its own: none of them is of the dynamics.
#[test]
fn frames_at_many_angles_leave_the_dynamics_as_they_are() {
    let frame = |k: usize| {
        let rpy = [1, 2, 3].map(|i| f64::from(i) * 0.01 + 0.1 * k as f64);
        format!("[[frame]]\nname = \"sensor_{k}\"\nlink = 3\nxyz = [0, 0, 0.1]\nrpy = {rpy:?}\n")
    };
    let arm = ARM.replace("alpha = 0.7", "alpha = 0");
    let with = model(&(arm.clone() + &(0..40).map(frame).collect::<String>()));
    let without = model(&arm);
    let torque =
        |model: &Model| model.function(Function::InverseDynamics, SetKind::Minimal).unwrap().operations();
    assert_eq!(torque(&with), torque(&without));
    let at = with.at_frame("sensor_39").unwrap();
    Evaluator::new(&at, Function::Jacobian, SetKind::Minimal).unwrap();
}
