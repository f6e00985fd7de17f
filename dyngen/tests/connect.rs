//! Loops that a MuJoCo model closes by `<connect>`: against MuJoCo's own numbers.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::arm::Parameter;
use dyngen::export;
use dyngen::import::{self, Imported, Options, Source};
use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use rand::{RngExt, SeedableRng};

const CRANK: &str = include_str!("mjcf/crank.xml");
const LEVEL: &str = include_str!("mjcf/level.xml");
const LINKAGE: &str = include_str!("mjcf/linkage.xml");

/// From MuJoCo 4.0.0: q, q̇ and q̈ of the joints that move on their own, and their torques. The others'
/// motion is solved from the equality's Jacobian and its rate; the torques are Gᵀ times those of mj_inverse
/// for the tree without the equality, where G maps velocities.
type Known<const N: usize> = [[f64; N]; 4];
const OF_CRANK: [Known<5>; 2] = [
    [
        [0.37, 0.37, 0.02, -0.26, -0.54],
        [-0.35, -0.27, -1.36, -1.35, 1.5],
        [0.91, -1.59, -0.39, 2.85, 2.39],
        [
            33.34650562364084,
            -293.4352588271227,
            -125.91942306375678,
            -4.6239716449767485,
            -0.24952508953308986,
        ],
    ],
    [
        [0.41, -0.13, -0.01, 0.21, -0.53],
        [0.17, -0.69, 1.14, -1.31, 0.54],
        [2.22, -1.64, 2.37, 2.23, -2.89],
        [36.93213293457622, -97.8580857617091, -81.0046191115949, -3.3737401596796652, -0.1947039447715169],
    ],
];
const OF_LEVEL: [Known<3>; 2] = [
    [
        [0.37, 0.37, 0.02],
        [-0.64, -1.34, -0.35],
        [-0.55, -2.73, -2.71],
        [8.096070947333224, -73.31706838854504, -0.11473743705239571],
    ],
    [
        [0.6, 0.18, -0.32],
        [-0.2, 1.42, 1.19],
        [2.07, -0.65, -0.04],
        [9.689173137915002, -30.73928813377319, -0.06946558848968967],
    ],
];

/// Pinocchio 4.1.0's constraint dynamics, with its 3-D contact in place of the equality, gives these
/// accelerations back from these torques to 2e-10.
const OF_LINKAGE: [Known<5>; 2] = [
    [
        [0.4, 0.01, 0.43, -0.38, 0.1],
        [-0.37, 0.91, -0.98, 1.11, 0.13],
        [2.41, -0.14, -0.42, 1.73, 2.9],
        [
            43.346664553717986,
            -113.22603009673115,
            -90.27744816160646,
            -6.102573374790618,
            -0.11773861606673997,
        ],
    ],
    [
        [-0.12, 0.42, 0.39, -0.29, 0.1],
        [0.61, 1.33, 0.5, -1.1, -0.01],
        [-0.04, 0.0, 2.75, -0.9, -1.66],
        [
            15.081766181166136,
            -174.50607767447576,
            -18.60681894767255,
            4.744647167019242,
            -0.12482533803339806,
        ],
    ],
];

fn imported(text: &str, tip: &str) -> Imported {
    let options = Options { tip: Some(tip.to_string()), ..Options::default() };
    import::any(text, "arm.xml", &options).unwrap_or_else(|e| panic!("{e}"))
}

fn compare<const N: usize>(text: &str, known: &[Known<N>]) -> Imported {
    let found = imported(text, "hand");
    let model = Model::derive(found.arm.clone()).unwrap();
    let values: Vec<f64> = found.values.iter().map(|(_, value)| *value).collect();
    let torque = Evaluator::new(&model, Function::InverseDynamics, SetKind::Full).unwrap();
    for [q, dq, ddq, expected] in known {
        let mut tau = [0.0; N];
        torque.evaluate(q, dq, ddq, &values, &mut tau);
        for (found, expected) in tau.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-8 * expected.abs().max(1.0), "{tau:?} {expected}");
        }
    }
    found
}

#[test]
fn a_crank_and_its_rod_are_bars() {
    let found = compare(CRANK, &OF_CRANK);
    let names: Vec<&str> = found.arm.bars.iter().map(|bar| bar.name.as_str()).collect();
    assert_eq!((names, found.arm.dof()), (vec!["rod", "crank"], 5), "{}", found.text);
    assert!(!found.notes.iter().any(|note| note.contains("left out")), "{:?}", found.notes);
}

/// Lengths of any kind: rod and crank turn as the elbow does not.
#[test]
fn a_crank_and_its_rod_may_be_of_any_length() {
    let found = compare(LINKAGE, &OF_LINKAGE);
    let bars: Vec<_> = found.arm.bars.iter().map(|bar| (bar.name.as_str(), bar.hinge.is_some())).collect();
    assert_eq!((bars, found.arm.dof()), (vec![("rod", true), ("crank", true)], 5), "{}", found.text);
    assert!(!found.notes.iter().any(|note| note.contains("left out")), "{:?}", found.notes);
    // Without limits the elbow would turn beyond a dead point.
    for (from, to, words) in [
        (" range=\"-0.5 0.5\"", "", "it closes only where q of joint 'elbow' is between"),
        ("range=\"-0.5 0.5\"", "range=\"-0.5 0.7\"", "rad: give it a range within"),
    ] {
        assert!(LINKAGE.contains(from), "{from}");
        let found = imported(&LINKAGE.replacen(from, to, 1), "hand");
        let said = |note: &String| note.contains("<connect> is left out") && note.contains(words);
        assert!(found.arm.bars.is_empty() && found.notes.iter().any(said), "{words}: {:?}", found.notes);
    }
}

#[test]
fn a_stay_that_keeps_a_plate_level_is_a_bar() {
    let found = compare(LEVEL, &OF_LEVEL);
    assert_eq!((found.arm.bars.len(), found.arm.dof(), found.arm.links()), (1, 3, 4), "{}", found.text);
    let mimic = found.arm.joints[2].mimic.as_ref().unwrap();
    assert_eq!((mimic.joint, mimic.ratio.to_string(), mimic.offset.to_string()), (1, "1".into(), "0".into()));
}

/// Angles on the way to a bar are rounded as those of the chain are.
#[test]
fn rounded_angles_of_a_bar_are_taken_as_meant() {
    let upright = "<body name=\"stay\" pos=\"0.5 0.03 0.15\">\n        <joint name=\"foot\" axis=\"0 1 0\"/>";
    let turned = "<body name=\"stay\" pos=\"0.5 0.03 0.15\" euler=\"-1.5708 0 0\">\n        <joint name=\"foot\" \
                  axis=\"0 0 1\"/>";
    let [at, turned_at] = ["pos=\"0 0 1.1\"/>", "pos=\"0 -1.1 0\"/>"];
    assert!(LEVEL.contains(upright) && LEVEL.contains(at));
    let found = imported(&LEVEL.replacen(upright, turned, 1).replacen(at, turned_at, 1), "hand");
    let meant = "taken as meant: joint 'foot': roll -1.5708 is -pi/2";
    assert!(found.notes.iter().any(|note| note.contains(meant)), "{:?}", found.notes);
    let exact = imported(LEVEL, "hand");
    assert_eq!(found.arm.bars, exact.arm.bars, "{:?}", found.notes);
}

#[test]
fn loops_that_an_arm_file_has_not_are_left_out_with_a_reason() {
    for (from, to, words) in [
        ("anchor=\"0 0 1.1\"", "anchor=\"0 0 1.0\"", "it closes only where q of joint 'elbow' is between"),
        (
            "<joint name=\"rod end\" axis=\"0 1 0\"/>",
            "<joint name=\"rod end\" axis=\"0 1 0.2\"/>",
            "not planar",
        ),
        (
            "<joint name=\"rod end\" axis=\"0 1 0\"/>",
            "<joint name=\"rod end\" type=\"slide\"/>",
            "four bars on hinges",
        ),
        ("<joint name=\"rod end\" axis=\"0 1 0\"/>", "", "four bars on hinges"),
        ("body1=\"rod\" body2=\"forearm\"", "body1=\"rod\" body2=\"hand\"", "one or two neighbouring joints"),
        ("body1=\"rod\" body2=\"forearm\"", "body1=\"turntable\"", "four bars on hinges"),
    ] {
        assert!(CRANK.contains(from), "{from}");
        let found = imported(&CRANK.replacen(from, to, 1), "hand");
        assert!(found.arm.bars.is_empty());
        let said = |note: &String| note.contains("<connect> is left out") && note.contains(words);
        assert!(found.notes.iter().any(said), "{words}: {:?}", found.notes);
        assert!(found.notes.iter().any(|note| note.contains("joint 'crank' on link")), "{:?}", found.notes);
    }
    let text = LEVEL.replacen("pos=\"0 0 1.1\"/>", "pos=\"0 0.02 1.1\"/>", 1);
    let found = imported(&text, "hand");
    let apart = "line 29: the equality <connect> is left out: its sites are 0.020000 m apart";
    assert!(found.arm.bars.is_empty() && found.notes.iter().any(|n| n.contains(apart)), "{:?}", found.notes);
    let text = CRANK.replacen("body1=\"rod\"", "body1=\"rot\"", 1);
    let error = import::any(&text, "arm.xml", &Options::default()).unwrap_err().to_string();
    assert!(error.contains("line 35: <connect>: there is no body 'rot'"), "{error}");
}

/// The values with those of each body times a factor of its own.
fn scaled(values: &[(Parameter, f64)]) -> Vec<(Parameter, f64)> {
    values.iter().map(|(p, value)| (*p, value * (1.5 + 0.25 * p.link as f64))).collect()
}

/// The model with these values, and with friction at every coordinate.
fn exported(text: &str, arm: &Arm, values: Vec<(Parameter, f64)>) -> Result<String, String> {
    let names: Vec<String> = values.iter().map(|(p, value)| format!("\"{p}\": {value:?}")).collect();
    let joint = |j| format!("{{\"joint\": {j}, \"gamma1\": 2, \"gamma3\": 0.5, \"gamma5\": 1.5}}");
    let friction: Vec<String> = (1..=arm.dof()).map(joint).collect();
    let friction = format!("{{\"friction\": [{}]}}", friction.join(", "));
    let values = format!("{{{}}}", names.join(", "));
    let known = export::Known::read(arm, (&values, "v.json"), Some((&friction, "f.json")))?;
    let new = export::source(&Source::of_text(text, "arm.xml"), arm, &known, &Options::default());
    new.map(|new| new.text).map_err(|e| e.to_string())
}

/// Torques of an arm at random states.
fn torques(Imported { arm, .. }: &Imported, values: &[(Parameter, f64)]) -> Vec<f64> {
    let model = Model::derive(arm.clone()).unwrap();
    let values: Vec<f64> = values.iter().map(|(_, value)| *value).collect();
    let torque = Evaluator::new(&model, Function::InverseDynamics, SetKind::Full).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut all = Vec::new();
    for _ in 0..20 {
        let [q, dq, ddq] =
            [(); 3].map(|()| (0..arm.dof()).map(|_| rng.random_range(-2.0..2.0)).collect::<Vec<f64>>());
        let mut tau = vec![0.0; arm.dof()];
        torque.evaluate(&q, &dq, &ddq, &values, &mut tau);
        all.extend(tau);
    }
    all
}

#[test]
fn values_of_bars_are_written_and_read_again() {
    let upright = "<body name=\"stay\" pos=\"0.5 0.03 0.15\">\n        <joint name=\"foot\" axis=\"0 1 0\"/>";
    let turned = "<body name=\"stay\" pos=\"0.5 0.03 0.15\" euler=\"-1.5708 0 0\">\n        <joint name=\"foot\" \
                  axis=\"0 0 1\" damping=\"3\"/>";
    let rounded = LEVEL.replacen(upright, turned, 1).replacen("pos=\"0 0 1.1\"/>", "pos=\"0 -1.1 0\"/>", 1);
    for text in [CRANK, LEVEL, &rounded] {
        let before = imported(text, "hand");
        let values = scaled(&before.values);
        let new = exported(text, &before.arm, values.clone()).unwrap();
        let after = imported(&new, "hand");
        assert_eq!(after.arm, before.arm);
        let (given, found) = (torques(&before, &values), torques(&after, &after.values));
        for (given, found) in given.iter().zip(&found) {
            assert!((given - found).abs() < 1e-9 * given.abs().max(1.0), "{given} {found}");
        }
        // The friction of a loop is at its joint of the chain alone.
        let count = |damping: &str| new.matches(&format!("damping=\"{damping}\"")).count();
        assert_eq!([count("1.5"), count("0")], [before.arm.dof(), before.arm.bars.len()], "{new}");
    }
}

#[test]
fn bars_without_a_place_are_refused() {
    let before = imported(CRANK, "hand");
    let refusal = |text: &str| exported(text, &before.arm, before.values.clone()).unwrap_err();
    let open =
        CRANK.replacen("<connect name=\"tail\" body1=\"rod\" body2=\"forearm\" anchor=\"0 0 1.1\"/>", "", 1);
    let words = "of the bars of closed loops that the arm has ('rod', 'crank'), none are here";
    assert!(refusal(&open).contains(words), "{}", refusal(&open));
    let longer = CRANK.replacen("pos=\"-0.25 0.05 0\"", "pos=\"-0.35 0.05 0\"", 1);
    assert!(refusal(&longer).contains("bar 'rod': its pin lies 100.000 mm from"), "{}", refusal(&longer));
    let linkage = imported(LINKAGE, "hand");
    let written = |text: &str| exported(text, &linkage.arm, linkage.values.clone());
    assert_eq!(imported(&written(LINKAGE).unwrap(), "hand").arm, linkage.arm);
    // The same pins on links, another middle pin.
    let bent =
        LINKAGE.replacen("pos=\"-0.22 0.05", "pos=\"-0.2 0.05", 1).replacen("\"-0.18 0", "\"-0.2 0", 1);
    let refusal_of = written(&bent).unwrap_err();
    assert!(refusal_of.contains("its loop has other lengths"), "{refusal_of}");
    let known = export::Known::read(&before.arm, (&before.values_json(), "v.json"), None).unwrap();
    for write in [export::sdf, export::usd] {
        let refusal = write(&before.arm, &known, "a test", &[]).unwrap_err();
        assert!(refusal.contains("'rod', 'crank'") && refusal.contains("--to mjcf"), "{refusal}");
    }
}
