//! What is written into a URDF is read from it again, and every other byte stays.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use dyngen::export::{self, Exported, Known};
use dyngen::import::{self, ImportError, Imported, Options};
use std::fmt::Write;

const PUMA: &str = include_str!("urdf/puma.urdf");
const FIXED: &str = include_str!("urdf/fixed.urdf");
const ODD: &str = include_str!("urdf/odd.urdf");

fn imported(text: &str, tip: Option<&str>) -> Imported {
    let options = Options { tip: tip.map(str::to_string), exact: true, ..Options::default() };
    import::urdf(text, "robot.urdf", &options).unwrap()
}

/// An arm's own values, each link's by a factor of its own.
fn scaled(imported: &Imported) -> String {
    let mut text = "{".to_string();
    for (p, value) in &imported.values {
        let comma = if text.len() > 1 { ", " } else { "" };
        let _ = write!(text, "{comma}\"{p}\": {:?}", value * (1.5 + 0.25 * p.link as f64));
    }
    text + "}"
}

fn friction(joints: usize) -> String {
    let one = |j: usize| {
        format!(
            "{{\"joint\": {}, \"gamma1\": {}, \"gamma2\": 200, \"gamma3\": 0.25, \"gamma4\": 5, \"gamma5\": \
             1.5, \"std\": [0.01, null, 0.02, null, 0.03]}}",
            j + 1,
            j as f64
        )
    };
    let list: Vec<String> = (0..joints).map(one).collect();
    format!("{{\"friction\": [{}]}}", list.join(", "))
}

fn exported(text: &str, arm: &Arm, values: &str, friction: Option<&str>) -> Result<Exported, ImportError> {
    let known = Known::read(arm, (values, "v.json"), friction.map(|text| (text, "f.json"))).unwrap();
    export::urdf(text, "robot.urdf", arm, &known, &Options::default())
}

#[test]
fn damping_that_is_not_known_stays_as_it_is() {
    let before = import::mjcf(MIXED, "arm.xml", &Options::default()).unwrap();
    // Damping 1.5 ± 0.03, but 0.02 ± 0.03 at the first joint.
    let friction = friction(4).replacen("\"gamma5\": 1.5", "\"gamma5\": 0.02", 1);
    let mut known =
        Known::read(&before.arm, (&scaled(&before), "v.json"), Some((&friction, "f.json"))).unwrap();
    let said = known.without_uncertain_damping(&before.arm);
    assert_eq!(said.len(), 1, "{said:?}\n{friction}");
    assert!(said[0].contains("is not larger than its standard error 3.000e-2"), "{said:?}");
    let new = export::mjcf(MIXED, "arm.xml", &before.arm, &known, &Options::default()).unwrap();
    assert_eq!(new.text.matches("damping=\"1.5\"").count(), 3, "{}", new.text);
}

/// The text without the elements that hold values and without comments, and without the space around them.
fn rest(text: &str) -> String {
    let mut rest = text.to_string();
    for (start, end) in
        [("<!--", "-->"), ("<inertial>", "</inertial>"), ("<dynamics", "/>"), ("<limit", "/>")]
    {
        while let Some(i) = rest.find(start) {
            let j = i + rest[i..].find(end).unwrap() + end.len();
            rest.replace_range(i..j, "");
        }
    }
    rest.chars().filter(|c| !c.is_whitespace()).collect()
}

#[test]
fn what_is_written_is_read_again_and_nothing_else_changes() {
    for (text, tip) in [(PUMA, None), (FIXED, Some("hand")), (ODD, None)] {
        let before = imported(text, tip);
        let values = scaled(&before);
        let new = exported(text, &before.arm, &values, Some(&friction(before.arm.dof()))).unwrap();
        let after = imported(&new.text, tip);
        assert_eq!(after.arm, before.arm);
        let given = |p: &dyngen::arm::Parameter, value: f64| value * (1.5 + 0.25 * p.link as f64);
        for ((p, old), (q, new)) in before.values.iter().zip(&after.values) {
            assert_eq!(p, q);
            let expected = given(p, *old);
            // Lengths of an arm file are written to 1e-12 m.
            assert!((new - expected).abs() < 1e-11 * expected.abs().max(1.0), "{p}: {new} {expected}");
        }
        assert_eq!(rest(&new.text), rest(text));
        assert!(
            new.text.contains("damping=\"1.5\"") && new.text.contains("friction=\"1.25\""),
            "{}",
            new.text
        );
        assert!(new.text.contains("standard errors: damping 3.000e-2, friction 3.000e-2"), "{}", new.text);
    }
}

#[test]
fn standard_errors_and_limits_stand_in_the_file() {
    let before = imported(PUMA, None);
    let parameters = scaled(&before);
    let identified = format!(
        "{{\"parameters\": [{{\"name\": \"Ixx2 - Iyy2 + 49/400*m3\", \"value\": 0.125, \"std\": 0.004}}], \
         \"consistent\": {{\"parameters\": {parameters}}}}}"
    );
    let mut arm = before.arm.clone();
    arm.joints[1].position = Some([-1.0, 1.25]);
    let new = exported(PUMA, &arm, &identified, None).unwrap();
    assert!(new.text.contains("<!-- Ixx2 - Iyy2 + 49/400*m3 = 1.250000e-1 ± 4.000e-3 -->"), "{}", new.text);
    assert_eq!(imported(&new.text, None).arm.joints[1].position, Some([-1.0, 1.25]));
    assert!(!new.text.contains("standard errors"));
}

#[test]
fn what_cannot_be_written_is_refused() {
    let before = imported(PUMA, None);
    let (arm, values) = (&before.arm, scaled(&before));
    let unknown = |values: &str| Known::read(arm, (values, "v.json"), None).unwrap_err();
    assert!(unknown("{\"Ixx2 - Iyy2\": 1}").contains("Ixx2 - Iyy2 are sums"));
    assert!(unknown("{\"m1\": 1}").contains("no value for mx1"));
    assert!(unknown(&values.replace("\"Izz3\": ", "\"Izz3\": -")).contains("link 3: no body"));
    let no_friction = Known::read(arm, (&values, "v.json"), Some((&friction(5), "f.json"))).unwrap_err();
    assert!(no_friction.contains("f.json") && no_friction.contains("joint 6"), "{no_friction}");

    let refusal = |text: &str, arm: &Arm| exported(text, arm, &values, None).unwrap_err().to_string();
    let mut other = arm.clone();
    other.joints[2].name = Some("ankle".to_string());
    assert!(refusal(PUMA, &other).contains("those of the arm waist, shoulder, ankle"));
    let mut moved = arm.clone();
    moved.joints[2].a += dyngen::exact::rational::parse_rational("0.02").unwrap();
    assert!(refusal(PUMA, &moved).contains("another arm"), "{}", refusal(PUMA, &moved));
}

const MIXED: &str = include_str!("mjcf/arm.xml");

/// Bodies with two joints have none between them; ranges are in the file's degrees.
#[test]
fn a_mujoco_model_is_written_and_read_again() {
    let exact = Options { exact: true, ..Options::default() };
    let before = import::mjcf(MIXED, "arm.xml", &exact).unwrap();
    let values = scaled(&before);
    let known = Known::read(&before.arm, (&values, "v.json"), Some((&friction(4), "f.json"))).unwrap();
    let mut arm = before.arm.clone();
    arm.joints[1].position = Some([-0.5, 1.25]);
    let new = export::mjcf(MIXED, "arm.xml", &arm, &known, &Options::default()).unwrap();
    let after = import::mjcf(&new.text, "arm.xml", &exact).unwrap();
    let position = after.arm.joints[1].position.unwrap();
    assert!((position[0] + 0.5).abs() < 1e-12 && (position[1] - 1.25).abs() < 1e-12, "{position:?}");
    for ((p, old), (q, new)) in before.values.iter().zip(&after.values) {
        assert_eq!(p, q);
        let expected = old * (1.5 + 0.25 * p.link as f64);
        assert!((new - expected).abs() < 1e-11 * expected.abs().max(1.0), "{p}: {new} {expected}");
    }
    for words in ["frictionloss=\"3.25\"", "armature=\"0.011", "standard errors: damping 3.000e-2"] {
        assert!(new.text.contains(words), "{words}\n{}", new.text);
    }
    let mut between = before.values.clone();
    between.iter_mut().find(|(p, _)| p.to_string() == "m1").unwrap().1 = 1.0;
    let known =
        Known::read(&arm, (&scaled(&Imported { values: between, ..before }), "v.json"), None).unwrap();
    let refusal = export::mjcf(MIXED, "arm.xml", &arm, &known, &Options::default()).unwrap_err().to_string();
    assert!(refusal.contains("'pan'") && refusal.contains("1.5 kg"), "{refusal}");
}

/// What `powerball identify` writes for position servos: kp·gain·torque and so on, in MuJoCo's terms.
#[test]
fn a_position_servo_is_written_as_mujocos() {
    let one = |j: usize, more: &str| {
        format!(
            "{{\"joint\": {j}, \"absolute\": true, \"parameters\": [{{\"name\": \"torque\", \"value\": 3.0, \
             \"std\": 0.1}}, {{\"name\": \"gain\", \"value\": 0.5, \"std\": 0.01}}, {{\"name\": \"kp\", \
             \"value\": 16.0, \"std\": null, \"known\": true}}, {{\"name\": \"kd\", \"value\": 0.25, \
             \"std\": null}}, {{\"name\": \"armature\", \"value\": 0.03125, \"std\": 0.001}}, {{\"name\": \
             \"viscous\", \"value\": 0.25, \"std\": 0.01}}, {{\"name\": \"back_emf\", \"value\": 0.5, \
             \"std\": 0.02}}, {{\"name\": \"coulomb\", \"value\": 0.0625, \"std\": 0.001}}{more}]}}"
        )
    };
    let load = ", {\"name\": \"load\", \"value\": 0.375, \"std\": 0.01}";
    let all: Vec<String> = (1..5).map(|j| one(j, if j == 2 { load } else { "" })).collect();
    let servos = format!("{{\"servo\": [{}]}}", all.join(", "));
    let before = import::mjcf(MIXED, "arm.xml", &Options::default()).unwrap();
    let values = scaled(&before);
    let read = |servos: &str| Known::read(&before.arm, (&values, "v.json"), Some((servos, "s.json")));
    let write = |text: &str, servos: &str| {
        export::mjcf(text, "arm.xml", &before.arm, &read(servos).unwrap(), &Options::default()).unwrap()
    };
    let new = write(MIXED, &servos);
    let position = "kp=\"24.0\" kv=\"0.375\" forcerange=\"-3.0 3.0\"";
    assert_eq!(new.text.matches(position).count(), 4, "{}", new.text);
    for words in ["armature=\"0.03125\"", "damping=\"0.75\"", "frictionloss=\"0.0625\""] {
        assert_eq!(new.text.matches(words).count(), 4, "{words}\n{}", new.text);
    }
    assert!(new.notes.iter().any(|note| note.contains("load 0.375: friction for each")), "{:?}", new.notes);
    // A second export takes the place of the first; a servo of the model itself is changed.
    let section = |text: &str| text[text.find("<actuator>").unwrap()..].to_string();
    assert_eq!(section(&write(&new.text, &servos).text), section(&new.text));
    let name = "name=\"dyngen servo lift\"";
    let own = new.text.replace(name, "name=\"lift\" dampratio=\"1\"").replace(position, "kp=\"5\"");
    let changed = write(&own, &servos).text;
    assert!(changed.contains("name=\"lift\"") && !changed.contains("dampratio") && !changed.contains(name));
    assert_eq!(changed.matches("kp=\"24.0\"").count(), 4, "{changed}");
    // A torque that no log reaches is no limit, unless the arm file has it.
    let torque = |std: &str| servos.replace("3.0, \"std\": 0.1", &format!("3.0, \"std\": {std}"));
    for std in ["null", "0.95", "695"] {
        let hidden = write(MIXED, &torque(std));
        assert!(!hidden.text.contains("forcerange="), "{std}: {}", hidden.text);
        assert!(hidden.notes.iter().any(|n| n.contains("no log reaches")), "{:?}", hidden.notes);
    }
    for std in ["0.85", "null, \"known\": true"] {
        assert_eq!(write(MIXED, &torque(std)).text.matches(position).count(), 4, "{std}");
    }
    let shares = read(&servos.replace("\"absolute\": true", "\"absolute\": false")).unwrap_err();
    assert!(shares.contains("s.json: the torques of joint 1 are shares"), "{shares}");
    assert!(
        read(&servos.replace("\"joint\": 3", "\"joint\": 7")).unwrap_err().contains("no servo for joint 3")
    );
}
