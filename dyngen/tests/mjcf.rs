//! A MuJoCo model is the same arm: against MuJoCo's own numbers.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::arm::{JointKind, Parameter};
use dyngen::import::{self, ImportError, Imported, Options};
use dyngen::{Evaluator, Function, Model, Samples, SetKind};

const ARM: &str = include_str!("mjcf/arm.xml");

/// From MuJoCo 4.0.0 with armature, damping, friction and constraints switched off: q, q̇, q̈, mj_inverse,
/// and place and rotation of the body `hand`.
type Known = ([f64; 4], [f64; 4], [f64; 4], [f64; 4], [f64; 3], [f64; 9]);
const MUJOCO: [Known; 2] = [
    (
        [0.3, -0.4, 0.1, 0.7],
        [0.5, 0.6, -0.7, 0.8],
        [1.0, -2.0, 3.0, -4.0],
        [0.6357696686606338, -1.8598990088056877, 29.387820534543494, 0.01314084992074798],
        [0.20813249634726183, -0.17433482046895704, 0.9624484693411899],
        [
            -0.9691378023252967,
            -0.23708028318331412,
            -0.06756374345618903,
            0.23137172050836627,
            -0.9693500925145263,
            0.08262883934243297,
            -0.08508258960029715,
            0.06444639220157118,
            0.9942874913620853,
        ],
    ),
    (
        [-1.2, 0.9, 0.3, -2.0],
        [1.0, -1.5, 0.5, 2.0],
        [0.5, 0.25, -1.0, 3.0],
        [4.128297172979657, -13.796488312999687, -6.903673936833764, 0.019763094525654334],
        [0.5601090937390436, -0.5624169745929478, 0.40089930694427933],
        [
            -0.12035520143371778,
            0.54923646273739,
            0.8269546139224142,
            -0.04762047896169702,
            0.8288567576947641,
            -0.5574305025805298,
            -0.9915880775157133,
            -0.1064696352179488,
            -0.07360231861326874,
        ],
    ),
];

fn imported(text: &str) -> Result<Imported, ImportError> {
    import::any(text, "arm.xml", &Options::default())
}

#[test]
fn torque_and_pose_are_those_of_mujoco() {
    let imported = imported(ARM).unwrap();
    assert_eq!(imported.arm.joint_names(), ["pan", "lift", "stroke", "turn"]);
    let model = Model::derive(imported.arm.clone()).unwrap();
    let mut all = vec![0.0; model.arm().all_parameters().len()];
    for (p, value) in imported.values.iter().filter(|(p, _)| p.kind.name() != "Im") {
        all[p.index()] = *value;
    }
    let parameters = model.set_values(model.set(SetKind::Minimal).unwrap(), &all);
    let torque = Evaluator::new(&model, Function::InverseDynamics, SetKind::Minimal).unwrap();
    let pose = Evaluator::new(&model, Function::ForwardKinematics, SetKind::Minimal).unwrap();
    for (q, dq, ddq, expected, place, rotation) in &MUJOCO {
        let samples = Samples { q, dq, ddq, parameters: &parameters, ..Samples::default() };
        let (mut tau, mut hand) = ([0.0; 4], [0.0; 16]);
        torque.run(&samples, &mut tau);
        pose.run(&samples, &mut hand);
        for (a, b) in tau.iter().zip(expected) {
            assert!((a - b).abs() < 1e-10 * 30.0, "{tau:?} {expected:?}");
        }
        for i in 0..3 {
            assert!((hand[4 * i + 3] - place[i]).abs() < 1e-10, "{hand:?} {place:?}");
            for j in 0..3 {
                assert!((hand[4 * i + j] - rotation[3 * i + j]).abs() < 1e-10, "{hand:?} {rotation:?}");
            }
        }
    }
}

#[test]
fn drives_and_ranges_are_kept() {
    let imported = imported(ARM).unwrap();
    let joints = &imported.arm.joints;
    let ratio = |j: usize| joints[j].rotor_ratio.as_ref().map(dyngen::exact::rational::to_f64);
    // The class `fast` has no armature, the actuator of `turn` a gear.
    assert_eq!([0, 1, 2, 3].map(ratio), [Some(100.0), None, Some(100.0), Some(50.0)]);
    let value =
        |name: &str| imported.values.iter().find(|(p, _)| Parameter::parse(name) == Some(*p)).unwrap().1;
    assert!((value("Im1") * 1e4 - 0.02).abs() < 1e-15 && (value("Im4") * 2500.0 - 0.005).abs() < 1e-15);
    assert_eq!(joints[2].kind, JointKind::Prismatic);
    assert_eq!(joints[2].position, Some([0.0, 0.4]));
    let degrees = |x: f64| x.to_radians();
    let range = joints[0].position.unwrap();
    assert!((range[0] - degrees(-90.0)).abs() < 1e-12 && (range[1] - degrees(100.0)).abs() < 1e-12);
    assert_eq!(joints[3].position, None);
    assert!(imported.text.contains("# damping 0.5 N·m·s/rad, frictionloss 2.0 N·m"), "{}", imported.text);
    let mesh = ARM.replace(
        "<inertial pos=\"0.02 0 0.03\" mass=\"0.8\" diaginertia=\"0.002 0.003 0.004\"/>",
        "<geom type=\"mesh\" mesh=\"hand\"/>",
    );
    assert_ne!(mesh, ARM);
    let notes = self::imported(&mesh).unwrap().notes;
    assert!(
        notes.iter().any(|n| n.contains("'hand' has no <inertial>, and its <geom> is a mesh")),
        "{notes:?}"
    );
}

/// Mass, centre, and inertia xx yy zz xy xz yz about it in the body's axes, as MuJoCo 4.0 compiles them of
/// the shapes below.
#[rustfmt::skip]
const SHAPES: [f64; 10] = [
    31.40730628757113, 0.10379043886602604, 0.058738253679611156, 0.17348647716053014, 1.8679184458164453, 1.196128181926393, 1.0930137819695247, -0.03156059859280793, -0.20321367401383497, 0.12612581150268465,
];

#[test]
fn a_body_without_inertial_has_that_of_its_shapes() {
    let text = r#"<mujoco>
  <compiler angle="radian" inertiagrouprange="0 2"/>
  <default><geom density="500"/><default class="light"><geom density="100" group="1"/></default></default>
  <worldbody><body name="link"><joint name="turn"/>
    <geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0.2" euler="0.3 0.2 0.1"/>
    <geom type="capsule" size="0.05" fromto="0 0 0 0.3 0.4 0.1"/>
    <geom class="light" type="cylinder" size="0.1 0.25" pos="0 0.3 0" quat="1 0.5 0 0"/>
    <frame pos="0.1 0.2 0.3" euler="0 0 1"><geom type="ellipsoid" size="0.1 0.2 0.15" mass="2.5" pos="0.2 0 0" euler="0.5 0 0"/></frame>
    <geom size="0.12" density="0"/><geom size="0.12" group="3"/><geom size="0.08" pos="0 0 -0.2"/>
  </body></worldbody></mujoco>"#;
    let imported = imported(text).unwrap();
    assert!(
        imported.notes.iter().any(|n| n.contains("'link' has no <inertial>: it has the")),
        "{:?}",
        imported.notes
    );
    // The joint's axis is the body's z, so frames and body agree but for a turn about it.
    let value =
        |name: &str| imported.values.iter().find(|(p, _)| Parameter::parse(name) == Some(*p)).unwrap().1;
    let [mass, x, y, z, xx, yy, zz, _, xz, yz] = SHAPES;
    let expected = [mass, mass * z, zz + mass * (x * x + y * y)];
    for (found, expected) in ["m1", "mz1", "Izz1"].map(value).iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} {expected}");
    }
    // Sums and lengths that no turn about z changes.
    let along = |name: &str, other: &str| value(name).hypot(value(other));
    let tensor = [xz - mass * x * z, yz - mass * y * z];
    for (found, expected) in [
        (along("mx1", "my1"), mass * x.hypot(y)),
        (value("Ixx1") + value("Iyy1"), xx + yy + mass * (x * x + y * y + 2.0 * z * z)),
        (along("Ixz1", "Iyz1"), tensor[0].hypot(tensor[1])),
    ] {
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} {expected}");
    }
}

/// q is what MuJoCo calls qpos: where the model is drawn it is the reference.
#[test]
fn a_reference_is_where_the_model_is_drawn() {
    let drawn = ARM
        .replace("<joint name=\"pan\"/>", "<joint name=\"pan\" ref=\"30\"/>")
        .replace("name=\"stroke\"", "name=\"stroke\" ref=\"0.1\"");
    assert_ne!(drawn, ARM);
    let pose = |text: &str, q: &[f64; 4]| {
        let model = Model::kinematic(imported(text).unwrap().arm);
        let pose = Evaluator::new(&model, Function::ForwardKinematics, SetKind::Full).unwrap();
        let mut out = [0.0; 16];
        pose.evaluate(q, &[], &[], &[], &mut out);
        out
    };
    let (plain, moved) =
        (pose(ARM, &[0.4, -0.3, 0.15, 0.8]), pose(&drawn, &[0.4 + 30f64.to_radians(), -0.3, 0.25, 0.8]));
    for (a, b) in plain.iter().zip(&moved) {
        assert!((a - b).abs() < 1e-10, "{plain:?} {moved:?}");
    }
}

/// A joint follows another one by a straight line through both references; what an arm file cannot hold is
/// reported.
#[test]
fn equalities_are_followed_or_reported() {
    let with =
        |equality: &str| ARM.replace("</mujoco>", &format!("<equality>{equality}</equality></mujoco>"));
    let text = with("<joint joint1=\"turn\" joint2=\"pan\" polycoef=\"0.2 -1.5 0 0 0\"/>")
        .replace("<joint name=\"pan\"/>", "<joint name=\"pan\" ref=\"180\"/>");
    let arm = imported(&text).unwrap().arm;
    let mimic = arm.joints[3].mimic.as_ref().unwrap();
    let offset = dyngen::exact::rational::to_f64(&mimic.offset);
    assert_eq!((mimic.joint, &mimic.ratio.to_string()[..], arm.dof()), (0, "-3/2", 3));
    assert!((offset - (0.2 + 1.5 * std::f64::consts::PI)).abs() < 1e-12, "{offset}");
    for (equality, words) in [
        ("<joint joint1=\"turn\" joint2=\"pan\" polycoef=\"0 1 2 0 0\"/>", "by a curve"),
        ("<joint joint1=\"turn\" polycoef=\"0.3\"/>", "--lock turn=0.3"),
        ("<weld body1=\"hand\" body2=\"world\"/>", "<weld> is left out"),
    ] {
        let imported = imported(&with(equality)).unwrap();
        assert_eq!(imported.arm.dof(), 4);
        assert!(imported.notes.iter().any(|n| n.contains(words)), "{words}: {:?}", imported.notes);
    }
    let off = imported(&with("<joint joint1=\"turn\" joint2=\"pan\" active=\"false\"/>")).unwrap();
    assert_eq!(off.arm.dof(), 4);
}

#[test]
fn what_is_not_read_is_reported_with_its_line() {
    let error = |from: &str, to: &str| {
        assert!(ARM.contains(from), "{from}");
        imported(&ARM.replacen(from, to, 1)).unwrap_err().to_string()
    };
    for (from, to, words) in [
        ("<light pos=\"0 0 3\"/>", "<include file=\"x.xml\"/>", "line 16: <include> is not followed"),
        ("angle=\"degree\"", "angle=\"grad\"", "line 4: compiler: angle"),
        ("eulerseq=\"zyx\"", "eulerseq=\"zy\"", "line 4: compiler: eulerseq 'zy'"),
        ("euler=\"10 0 20\"", "euler=\"10 0\"", "euler of <body> must be 3 numbers"),
        ("axisangle=\"1 1 0 30\"", "axisangle=\"0 0 0 30\"", "axisangle has no direction"),
        ("<joint name=\"pan\"/>", "<joint name=\"pan\" type=\"ball\"/>", "joint 'pan' is ball"),
        ("<joint name=\"pan\"/>", "<freejoint name=\"pan\"/>", "joint 'pan' is floating"),
        (
            "<joint name=\"pan\"/>",
            "<joint name=\"pan\" axis=\"1 x 0\"/>",
            "joint 'pan': axis must be 3 numbers",
        ),
        ("mass=\"0.8\"", "mass=\"heavy\"", "mass of <inertial> must be 1 numbers"),
        ("</mujoco>", "", "as a MuJoCo model: line"),
    ] {
        let message = error(from, to);
        assert!(message.contains(words) && message.starts_with("arm.xml: "), "{words}: {message}");
    }
}

/// A ball of 0.1 m and one of 0.2 m are together to have 3 kg.
#[test]
fn masses_are_those_that_the_compiler_asks_for() {
    let text = r#"<mujoco><compiler inertiafromgeom="true" settotalmass="3"/><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
<inertial pos="0 0 0" mass="50" diaginertia="1 1 1"/><geom type="sphere" size="0.1" pos="0.2 0 0"/>
<body name="b" pos="0.3 0 0"><joint name="k" axis="0 1 0"/><geom type="sphere" size="0.2"/></body></body></worldbody></mujoco>"#;
    let imported = imported(text).unwrap();
    let value = |name: &str| imported.values.iter().find(|(p, _)| p.to_string() == name).unwrap().1;
    // One to eight by volume.
    assert!((value("m1") - 1.0 / 3.0).abs() < 1e-12 && (value("m2") - 8.0 / 3.0).abs() < 1e-12);
    assert!((value("Izz2") - 0.4 * 8.0 / 3.0 * 0.04).abs() < 1e-12);
    assert!(imported.notes.iter().any(|note| note.starts_with("settotalmass")));
}
