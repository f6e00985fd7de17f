//! Effects that were named stand in a MuJoCo model as passive motors, whose laws are those of the terms.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::export::{self, Exported, Known};
use dyngen::import::{self, Options};
use roxmltree::Document;

const ARM: &str = include_str!("mjcf/arm.xml");
const PUMA: &str = include_str!("urdf/puma.urdf");
const MODEL: &str = include_str!("mjcf/model.json");

fn exact() -> Options {
    Options { exact: true, ..Options::default() }
}

fn exported(text: &str, model: &str) -> Exported {
    let imported = import::mjcf(text, "arm.xml", &exact()).unwrap();
    let known = Known::read(&imported.arm, (&imported.values_json(), "v.json"), Some((model, "model.json")));
    export::mjcf(text, "arm.xml", &imported.arm, &known.unwrap(), &Options::default()).unwrap()
}

/// Of each passive motor the joint, the gear, and the numbers of `cogging` or `lugre`.
fn motors(text: &str) -> Vec<(String, f64, &'static str, Vec<f64>)> {
    let document = Document::parse(text).unwrap();
    let passive = document.descendants().filter(|n| n.attribute("input") == Some("none"));
    passive
        .map(|node| {
            assert_eq!(
                (node.attribute("motorconst"), node.attribute("resistance")),
                (Some("0 0"), Some("1"))
            );
            let law = if node.attribute("lugre").is_some() { "lugre" } else { "cogging" };
            let numbers = node.attribute(law).unwrap().split(' ').map(|x| x.parse().unwrap()).collect();
            let gear = node.attribute("gear").unwrap().parse().unwrap();
            (node.attribute("joint").unwrap().to_string(), gear, law, numbers)
        })
        .collect()
}

/// Cogging acts on the joint, against what the motor has to bring up.
#[test]
fn cogging_is_the_ripple_of_the_model() {
    let motors = motors(&exported(ARM, MODEL).text);
    let of = |joint: &str| -> Vec<_> {
        motors.iter().filter(|m| m.0 == joint && m.2 == "cogging").cloned().collect()
    };
    for k in 0..50 {
        let q = f64::from(k) * 0.37 - 9.0;
        let torque = |joint: &str| -> f64 {
            of(joint).iter().map(|(_, gear, _, n)| gear * n[0] * (n[1] * gear * q + n[2]).sin()).sum()
        };
        let pan = 0.5 * (32.0 * q).cos() - 0.25 * (32.0 * q).sin() + 0.125 * (2.5 * q).sin();
        assert!((torque("pan") + pan).abs() < 1e-12, "{q}: {} {pan}", torque("pan"));
        assert!((torque("stroke") + 3.0 * (100.0 * q).cos()).abs() < 1e-12);
    }
    // MuJoCo wants whole numbers of poles.
    assert!(motors.iter().filter(|m| m.2 == "cogging").all(|m| m.3[1].fract() == 0.0));
    assert_eq!(of("pan").len(), 2);
}

#[test]
fn lugre_is_dahl_where_the_levels_are_equal_and_takes_the_place_of_frictionloss_otherwise() {
    let new = exported(ARM, MODEL);
    let motors = motors(&new.text);
    let lugre: Vec<_> = motors.iter().filter(|m| m.2 == "lugre").collect();
    // Dahl: c·z with dz/dq = (1 − z)/δ is a stiffness c/δ.
    let expected = ("lift".to_string(), 1.0, "lugre", vec![1.5 / 0.02, 0.0, 1.5, 1.5, 1.0]);
    assert_eq!(*lugre[0], expected);
    // Constant friction 0.75 of the joint, and 0.4 more at low speed.
    assert_eq!(*lugre[1], ("turn".to_string(), 1.0, "lugre", vec![750.0, 0.0, 0.75, 0.75 + 0.4, 0.05]));
    assert_eq!(lugre.len(), 2);
    let document = Document::parse(&new.text).unwrap();
    let loss = |joint: &str| {
        let named =
            |n: &roxmltree::Node<'_, '_>| n.has_tag_name("joint") && n.attribute("name") == Some(joint);
        document.descendants().find(named).unwrap().attribute("frictionloss").unwrap().to_string()
    };
    assert_eq!((loss("lift"), loss("turn")), ("0.75".to_string(), "0".to_string()));
}

/// What MuJoCo cannot model is stated in the file, and nothing is written that is wrong.
#[test]
fn other_laws_are_left_out_and_reported() {
    let new = exported(ARM, MODEL);
    let words = "joint 'lift': load_friction: MuJoCo has no law 'load'";
    assert!(new.text.contains(&format!("<!-- dyngen: left out: {words} -->")), "{}", new.text);
    assert!(new.notes.iter().any(|note| note.contains(words)), "{:?}", new.notes);
    let negative = exported(ARM, &MODEL.replace("\"coefficient\": 1.5", "\"coefficient\": -1.5"));
    assert!(negative.notes.iter().any(|note| note.contains("a negative level")), "{:?}", negative.notes);
    assert_eq!(motors(&negative.text).len(), motors(&new.text).len() - 1);

    let puma = import::urdf(PUMA, "puma.urdf", &exact()).unwrap();
    let friction: Vec<String> = (1..=6)
        .map(|j| format!("{{\"joint\": {j}, \"gamma1\": 0.5, \"gamma3\": 0.25, \"gamma5\": 1.5}}"))
        .collect();
    let model = format!(
        "{{\"friction\": [{}], \"terms\": [{{\"effect\": \"spring\", \"joint\": 6, \"coefficient\": 1, \
         \"law\": \"position\"}}]}}",
        friction.join(", ")
    );
    let known = Known::read(&puma.arm, (&puma.values_json(), "v.json"), Some((&model, "m.json"))).unwrap();
    let new = export::urdf(PUMA, "puma.urdf", &puma.arm, &known, &Options::default()).unwrap();
    assert!(new.notes.iter().any(|note| note.contains("no place for effects: spring")), "{:?}", new.notes);
}

#[test]
fn terms_that_are_none_are_refused() {
    let arm = import::mjcf(ARM, "arm.xml", &exact()).unwrap();
    let refused = |from: &str, to: &str| {
        let model = MODEL.replace(from, to);
        assert_ne!(model, MODEL);
        Known::read(&arm.arm, (&arm.values_json(), "v.json"), Some((&model, "m.json"))).unwrap_err()
    };
    let error = refused("\"order\": 2.5", "\"order\": -2.5");
    assert_eq!(error, "m.json: term 3, position_ripple: 'order' must be positive, found -2.5");
    let error = refused("\"joint\": 3, \"coefficient\": 3", "\"joint\": 9, \"coefficient\": 3");
    assert_eq!(error, "m.json: term 4, position_ripple: 'joint' must be 1 to 4, found 9");
    let error = refused("\"distance\": 0.02", "\"distance\": null");
    assert!(error.contains("'distance' must be a number, found null"), "{error}");
    assert!(refused("\"law\": \"load\"", "\"law\": 1").contains("'law' must be a name"));
}

/// A second export takes the place of the first, and an import is that of the arm without them.
#[test]
fn an_export_into_an_export_is_one() {
    // Key frames hold MuJoCo's states; joints without a name get the one that the import gave them.
    let text = ARM.replace("<joint name=\"turn\"", "<joint");
    let text = text.replace("<motor joint=\"turn\" gear=\"50\"/>", "<intvelocity joint=\"pan\" kp=\"1\"/>");
    let text = text.replace("</mujoco>", "<keyframe><key act=\"0.5\"/><key/></keyframe></mujoco>");
    let once = exported(&text, MODEL);
    assert!(once.text.contains("<key act=\"0.5 0 0\"/><key/>"), "{}", once.text);
    assert!(motors(&once.text).iter().any(|m| m.0.starts_with("hand, joint in line ")));
    let twice = exported(&once.text, MODEL);
    assert_eq!(motors(&twice.text), motors(&once.text));
    assert!(twice.text.contains("<key act=\"0.5 0 0\"/>"));
    let section = |text: &str| text[text.find("<actuator>").unwrap()..].to_string();
    assert_eq!(section(&twice.text), section(&once.text));
    let before = import::mjcf(&text, "a.xml", &exact()).unwrap();
    assert_eq!(import::mjcf(&twice.text, "a.xml", &exact()).unwrap().arm, before.arm);

    let none = exported(
        &twice.text,
        "{\"friction\": [{\"joint\": 1, \"gamma1\": 0, \"gamma3\": 0, \"gamma5\": 0}, \
        {\"joint\": 2, \"gamma1\": 0, \"gamma3\": 0, \"gamma5\": 0}, {\"joint\": 3, \"gamma1\": 0, \
        \"gamma3\": 0, \"gamma5\": 0}, {\"joint\": 4, \"gamma1\": 0, \"gamma3\": 0, \"gamma5\": 0}]}",
    );
    assert!(motors(&none.text).is_empty() && none.text.contains("<key act=\"0.5\"/>"), "{}", none.text);

    // Wherever actuators stand.
    for (from, to) in [("<motor joint=\"turn\" gear=\"50\"/>", ""), ("motor joint", "motor name=\"m\" joint")]
    {
        assert_eq!(motors(&exported(&ARM.replace(from, to), MODEL).text).len(), 5);
    }
    let start = ARM.find("  <actuator>").unwrap();
    for section in ["", "  <actuator/>\n"] {
        let text = format!("{}{section}</mujoco>\n", &ARM[..start]);
        assert_eq!(motors(&exported(&text, MODEL).text).len(), 5, "{section}");
    }
}

/// Torque that grows with the position is a spring of the joint, in the model's unit of angles.
#[test]
fn a_spring_is_the_joints_stiffness() {
    let new = exported(ARM, MODEL);
    let of_lift = |text: &str, key: &str| -> Option<f64> {
        let document = Document::parse(text).unwrap();
        let lift = document.descendants().find(|n| n.attribute("name") == Some("lift")).unwrap();
        lift.attribute(key).map(|x| x.parse().unwrap())
    };
    assert_eq!(of_lift(&new.text, "stiffness"), Some(20.0));
    let rest = of_lift(&new.text, "springref").unwrap();
    assert!((rest - 0.25f64.to_degrees()).abs() < 1e-12, "{rest}");
    assert!(new.text.contains("spring: the motor must supply (20.0 ± 5.000e-1) q + (-5.0 ± 2.000e-1)"));
    assert!(new.text.contains("(0.5 ± 3.000e-2) cos(32 q) + (-0.25 ± 4.000e-2) sin(32 q)"), "{}", new.text);
    assert!(new.text.contains("(1.5, standard error unknown) within 0.02"));
    let pushing = exported(ARM, &MODEL.replace("\"coefficient\": 20", "\"coefficient\": -20"));
    assert_eq!(of_lift(&pushing.text, "stiffness"), None);
    assert!(
        pushing.notes.iter().any(|n| n.contains("'lift': spring: a torque that falls")),
        "{:?}",
        pushing.notes
    );
}

/// What sits on a motor that turns with several joints sits on a tendon that is as long as the motor has
/// turned.
#[test]
fn a_motor_of_several_joints_is_a_tendon() {
    let imported = import::mjcf(ARM, "arm.xml", &exact()).unwrap();
    let coupled =
        format!("{}\n[[transmission]]\njoints = [1, 4]\nmatrix = [[1, 0], [\"-1/2\", 1]]\n", imported.text);
    let arm = dyngen::Arm::parse(&coupled, "arm.toml").unwrap();
    let known = Known::read(&arm, (&imported.values_json(), "v.json"), Some((MODEL, "model.json"))).unwrap();
    let new = export::mjcf(ARM, "arm.xml", &arm, &known, &Options::default()).unwrap();
    // Motor 1 still turns with its own joint alone.
    let notes: Vec<_> = new.notes.iter().filter(|note| note.contains("turns with several joints")).collect();
    assert!(notes.len() == 1 && notes[0].contains("joint 'turn'"), "{:?}", new.notes);
    let document = Document::parse(&new.text).unwrap();
    let tendon = document.descendants().find(|n| n.has_tag_name("fixed")).unwrap();
    let number = |key: &str| tendon.attribute(key).unwrap().parse::<f64>().unwrap();
    let joint = document.descendants().find(|n| n.attribute("name") == Some("turn")).unwrap();
    // Stribeck's friction is the actuator's, Coulomb's among it.
    assert_eq!((number("damping"), number("frictionloss")), (1.5, 0.0));
    assert_eq!((joint.attribute("damping"), joint.attribute("armature")), (Some("0"), Some("0")));
    assert!((number("armature") - 0.005).abs() < 1e-15);
    let turns: Vec<_> = tendon.children().filter(|n| n.is_element()).collect();
    let turns: Vec<_> =
        turns.iter().map(|n| (n.attribute("joint").unwrap(), n.attribute("coef").unwrap())).collect();
    assert_eq!(turns, [("pan", "-0.5"), ("turn", "1.0")]);
    let lugre = document.descendants().find(|n| n.has_tag_name("dcmotor") && n.attribute("tendon").is_some());
    assert_eq!(lugre.unwrap().attribute("tendon"), tendon.attribute("name"));
    // The next export takes its place.
    let again = export::mjcf(&new.text, "new.xml", &arm, &known, &Options::default()).unwrap();
    let tendons =
        |text: &str| text[text.find("<tendon>").unwrap()..text.find("</tendon>").unwrap()].to_string();
    assert_eq!(tendons(&again.text), tendons(&new.text));

    let puma = import::urdf(PUMA, "puma.urdf", &exact()).unwrap();
    let text = format!("{}\n[[transmission]]\njoints = [5, 6]\nmatrix = [[1, 0], [1, 1]]\n", puma.text);
    let arm = dyngen::Arm::parse(&text, "arm.toml").unwrap();
    let friction: Vec<String> = (1..=6)
        .map(|j| format!("{{\"joint\": {j}, \"gamma1\": 0.5, \"gamma3\": 0.25, \"gamma5\": 1.5}}"))
        .collect();
    let friction = format!("{{\"friction\": [{}]}}", friction.join(", "));
    let known = Known::read(&arm, (&puma.values_json(), "v.json"), Some((&friction, "f.json"))).unwrap();
    let new = export::urdf(PUMA, "puma.urdf", &arm, &known, &Options::default()).unwrap();
    assert_eq!(new.notes.iter().filter(|note| note.contains("its friction is the motor's")).count(), 1);
}
