//! What an imported arm keeps of its URDF, what is refused, and what is reported. `benches/tests/urdf.rs`
//! holds its motion and torques against a Newton–Euler in the URDF's own frames.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::arm::{Convention, JointKind, Parameter};
use dyngen::exact::rational::to_f64;
use dyngen::import::{self, ImportError, Imported, Options};
use dyngen::{Evaluator, Function, Model, Samples, SetKind};
use rand::{RngExt, SeedableRng};

const LWA4P: &str = include_str!("urdf/lwa4p.urdf");
const PUMA: &str = include_str!("urdf/puma.urdf");
const SLIDER: &str = include_str!("urdf/slider.urdf");
const ODD: &str = include_str!("urdf/odd.urdf");
const FIXED: &str = include_str!("urdf/fixed.urdf");

fn options(tip: Option<&str>, convention: Convention) -> Options {
    Options { tip: tip.map(str::to_string), convention, ..Options::default() }
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

/// A point of a link reads as in the description, in either convention: here each centre of mass, whose
/// numbers stand there.
#[test]
fn centres_of_mass_are_the_descriptions_own_in_the_frame_of_the_link() {
    let centre = |text: &str| {
        let numbers = text.split_once("<origin xyz=\"").unwrap().1.split('"').next().unwrap();
        numbers.split(' ').map(|x| x.parse().unwrap()).collect::<Vec<f64>>()
    };
    for text in [SLIDER, PUMA] {
        let given: Vec<Vec<f64>> = text.split("<inertial>").skip(1).map(centre).collect();
        for convention in [Convention::Standard, Convention::Modified] {
            let found = import::urdf(text, "robot.urdf", &options(None, convention)).unwrap();
            let value = |link: usize, kind: &str| {
                let parameter = Parameter::parse(&format!("{kind}{}", link + 1)).unwrap();
                found.values.iter().find(|(p, _)| *p == parameter).unwrap().1
            };
            // A base that stands still has a mass, and no joint.
            let given = &given[given.len() - found.arm.joints.len()..];
            for (link, (joint, given)) in found.arm.joints.iter().zip(given).enumerate() {
                let centre = ["mx", "my", "mz"].map(|kind| value(link, kind) / value(link, "m"));
                let seen = joint.link_frame.as_ref().map_or(centre, |frame| frame.see(centre));
                let off = seen.iter().zip(given).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 1e-12, "{convention:?} link {}: {seen:?} {given:?}", link + 1);
            }
        }
    }
}

/// An arm file has no letters that turn its text around, whatever the names of the description have.
#[test]
fn letters_that_turn_text_around_are_left_out_of_names_and_said() {
    let text = SLIDER
        .replace("lift &quot;scara", "lift\u{202e} &quot;scara")
        .replace("\"spin\"", "\"sp&#x2066;in\"");
    assert_eq!(
        text.matches('\u{202e}').count() + text.matches("&#x2066;").count(),
        2,
        "the test itself is wrong"
    );
    let found = imported(&text, None).unwrap();
    assert_eq!(
        (found.arm.name.as_str(), found.arm.joints[4].name.as_deref()),
        ("lift \"scara\"", Some("spin"))
    );
    for words in ["robot 'lift \"scara\"' holds U+202E", "joint 'spin' holds U+2066"] {
        assert!(found.notes.iter().any(|note| note.contains(words)), "{:?}", found.notes);
    }
    assert!(!found.text.contains(['\u{202e}', '\u{2066}']));
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
    said("turn it by at most 3.75e-3 mrad, ");
    said("over the joints' ranges");
    let whole = imported(PUMA, None).unwrap();
    assert!(!whole.notes.iter().any(|n| n.contains("rounded")), "{:?}", whole.notes);
}

/// The torque by which rounded numbers move the arm is what the two arms' own functions say.
#[test]
fn the_torque_of_rounded_numbers_is_said() {
    let rounded = PUMA.replace("1.5707963267948966", "1.5708");
    let [meant, exact] = [false, true].map(|exact| {
        let options = Options { exact, ..Options::default() };
        import::urdf(&rounded, "robot.urdf", &options).unwrap()
    });
    let note = meant.notes.iter().find(|n| n.contains("holds the arm still by at most")).unwrap();
    let said = note.split("still by at most ").nth(1).unwrap().split(' ').next().unwrap();
    let said: f64 = said.parse().unwrap();
    let mut random = chacha20::ChaCha8Rng::seed_from_u64(4);
    let q: Vec<f64> = (0..200 * meant.arm.dof()).map(|_| random.random_range(-3.0..3.0)).collect();
    let [a, b] = [&meant, &exact].map(|imported| {
        let model = Model::derive(imported.arm.clone()).unwrap();
        let values: Vec<f64> = imported.values.iter().map(|(_, value)| *value).collect();
        let gravity = Evaluator::new(&model, Function::Gravity, SetKind::Full).unwrap();
        let mut out = vec![0.0; q.len()];
        gravity.run(&Samples { q: &q, parameters: &values, ..Samples::default() }, &mut out);
        out
    });
    let most = a.iter().zip(&b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(said > 1e-8 && most < 1.3 * said && most > 0.5 * said, "{said} said, {most} found");
}

/// Reasons of a refusal; an unreadable text is none.
fn refusal(text: &str, tip: Option<&str>) -> String {
    match imported(text, tip) {
        Err(ImportError::Refused(reasons)) => reasons.join("\n"),
        other => panic!("{other:?}"),
    }
}

/// A follower on the chain is a link of the arm without a coordinate; what follows a joint that is held is
/// held where the ratio takes it.
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
        (refusal(FIXED, None), vec!["tree", "'left', 'right'", "choose the arm's tip", "hand"]),
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
fn twenty_one_joints_are_one_too_many() {
    let mut text = "<robot name=\"snake\"><link name=\"l0\"/>".to_string();
    for i in 1..=21 {
        text += &format!(
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{}\"/><child \
                link=\"l{i}\"/>\
             <origin xyz=\"0.1 0 0.2\"/></joint>",
            i - 1
        );
    }
    text += "</robot>";
    let reason = refusal(&text, None);
    assert!(reason.contains("21 joints") && reason.contains("'j1' to 'j21'"), "{reason}");
    assert_eq!(imported(&text, Some("l20")).unwrap().arm.dof(), 20);
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
/// counts; what is left out is reported in kilograms.
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
