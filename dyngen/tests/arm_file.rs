//! Every error of an arm file at once, each with its place and the joint; never a panic.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;

const GOOD: &str = r#"name = "two"
convention = "standard"
gravity = [0, 0, -9.81]

[[joint]]
kind = "revolute"
a = 0.5
alpha = "pi/2"
d = 0
theta = "-pi/2"
zero = ["my", "Ixy"]
rotor_ratio = 100
position = [-1.5, 1.5]
torque_constant = 2.5

[[joint]]
kind = "prismatic"
a = 0
alpha = 0
d = 0.1
theta = "0"

[[grouping]]
name = "R1"
sum = "Izz1 + 7/20*m2"
"#;

fn errors(text: &str) -> Vec<String> {
    match Arm::parse(text, "arm.toml") {
        Ok(_) => Vec::new(),
        Err(e) => e.0.iter().map(ToString::to_string).collect(),
    }
}

fn assert_error(from: &str, to: &str, place: &str, words: &[&str]) {
    assert!(GOOD.contains(from), "the test itself is wrong: {from}");
    let found = errors(&GOOD.replacen(from, to, 1));
    let hit = found
        .iter()
        .any(|e| e.starts_with(&format!("arm.toml:{place}: ")) && words.iter().all(|w| e.contains(w)));
    assert!(hit, "no error at {place} with {words:?} among {found:#?}");
}

#[test]
fn a_good_file_is_read() {
    let arm = Arm::parse(GOOD, "arm.toml").unwrap();
    assert_eq!(arm.dof(), 2);
    assert_eq!(arm.kept_parameters().len(), 22 - 2 - 1);
    assert_eq!(arm.joints[0].position, Some([-1.5, 1.5]));
}

#[test]
fn each_error_names_its_place_and_quantity() {
    assert_error("kind = \"revolute\"", "kind = \"rotary\"", "6:8", &["joint 1", "kind", "rotary"]);
    assert_error("a = 0.5", "a = \"50cm\"", "7:5", &["joint 1", "a ", "50cm"]);
    assert_error("a = 0.5", "a = nan", "7:5", &["joint 1", "a ", "nan"]);
    assert_error("a = 0.5", "a = 1e400", "7:5", &["joint 1", "exponent"]);
    assert_error("alpha = \"pi/2\"", "alpha = \"90deg\"", "8:9", &["joint 1", "alpha", "90deg", "pi/2"]);
    assert_error("alpha = \"pi/2\"", "alfa = \"pi/2\"", "8:1", &["joint 1", "unknown key 'alfa'"]);
    assert_error("alpha = \"pi/2\"\n", "", "5:1", &["joint 1", "'alpha' is missing"]);
    assert_error("[\"my\", \"Ixy\"]", "[\"my\", \"Iwy\"]", "11:15", &["joint 1", "Iwy"]);
    assert_error("[\"my\", \"Ixy\"]", "[\"my\", \"my\"]", "11:15", &["joint 1", "twice"]);
    assert_error("rotor_ratio = 100", "rotor_ratio = 0", "12:15", &["joint 1", "rotor_ratio"]);
    assert_error("[-1.5, 1.5]", "[1.5, -1.5]", "13:12", &["joint 1", "lower limit"]);
    assert_error("torque_constant = 2.5", "torque_constant = -1", "14:19", &["joint 1", "greater than zero"]);
    assert_error("convention = \"standard\"", "convention = \"khalil\"", "2:14", &["convention", "khalil"]);
    assert_error("gravity = [0, 0, -9.81]", "gravity = [0, -9.81]", "3:11", &["gravity", "three numbers"]);
    assert_error("sum = \"Izz1 + 7/20*m2\"", "sum = \"Izz1 + m3\"", "25:7", &["grouping 1", "m3", "link 3"]);
    assert_error("sum = \"Izz1 + 7/20*m2\"", "sum = \"my1\"", "25:7", &["grouping 1", "declared zero"]);
    assert_error("sum = \"Izz1 + 7/20*m2\"", "sum = \"Im2\"", "25:7", &["grouping 1", "no rotor_ratio"]);
    assert_error("name = \"two\"", "name = \"\"", "1:8", &["name"]);
    assert_error("d = 0.1", "d = ", "20:5", &["not valid TOML"]);
}

const HEAD: &str = "name = \"x\"\nconvention = \"standard\"\ngravity = [0, 0, 0]\n";

#[test]
fn an_arm_without_a_joint_is_one_error() {
    assert_eq!(
        errors(&format!("{HEAD}joint = []\n")),
        ["arm.toml:4:9: an arm needs at least one joint: `[[joint]]`"]
    );
    let one = "kind = \"revolute\"\na = 0\nalpha = 0\nd = 0\ntheta = 0\n";
    assert!(errors(&format!("{HEAD}[[joint]]\n{one}")).is_empty());
    assert_eq!(
        errors(&format!("{HEAD}\n[joint]\n{one}")),
        ["arm.toml:5:1: write [[joint]] with two brackets: each joint is one entry of a list"]
    );
    // TOML calls a second one a table that is given twice.
    assert_eq!(
        errors(&format!("{HEAD}\n[joint]\n{one}\n[joint]\n{one}")),
        ["arm.toml:5:1: write [[joint]] with two brackets: each joint is one entry of a list"]
    );
}

/// Letters that turn the text around them would make the generated code read otherwise than it is.
#[test]
fn names_that_cannot_be_seen_are_refused() {
    assert_error("\"two\"", "\"t\u{202e}wo\"", "1:10", &["U+202E", "remove it"]);
    assert_error("\"two\"", "\"t\\u202ewo\"", "1:8", &["name holds U+202E", "remove it"]);
    assert_error("\"two\"", "\"t\\nwo\"", "1:8", &["name holds U+000A, a control character"]);
    assert_error("[[joint]]", "# \u{2066}\n[[joint]]", "5:3", &["U+2066"]);
    assert_error("kind", "name = \"a\\u2029\"\nkind", "6:8", &["joint 1: name holds U+2029"]);
    assert_error("\"R1\"", "\"R\\u200f\"", "24:8", &["grouping 1: name holds U+200F"]);
}

#[test]
fn all_errors_of_a_file_come_at_once_in_order() {
    let text = GOOD
        .replace("a = 0.5", "a = \"x\"")
        .replace("\"prismatic\"", "\"sliding\"")
        .replace("gravity", "gravty");
    let found = errors(&text);
    assert!(found.len() >= 4, "{found:#?}");
    let lines: Vec<usize> = found.iter().map(|e| e.split(':').nth(1).unwrap().parse().unwrap()).collect();
    assert!(lines.is_sorted(), "{lines:?}");
}

#[test]
fn no_text_makes_it_panic() {
    for text in [
        "",
        "\u{feff}",
        "[[joint]]",
        "joint = 3",
        "joint = [1, 2]",
        "joint = []",
        "[joint]\na = 1",
        "name = 1\nname = 2",
        "\0",
        "[[grouping]]\n",
    ] {
        assert!(!errors(text).is_empty(), "{text:?}");
    }
    // Every prefix and every single byte knocked out of a good file.
    for cut in 0..GOOD.len() {
        if GOOD.is_char_boundary(cut) {
            let _ = errors(&GOOD[..cut]);
            let _ = errors(&format!("{}{}", &GOOD[..cut], GOOD[cut..].get(1..).unwrap_or("")));
        }
    }
    let many =
        GOOD.to_string() + &"[[joint]]\nkind = \"revolute\"\na = 0\nalpha = 0\nd = 0\ntheta = 0\n".repeat(20);
    assert!(errors(&many).iter().any(|e| e.contains("1 to 20")), "{:?}", errors(&many));
    assert!(!errors(&"a".repeat(2 << 20)).is_empty());
}

const COUPLED: &str = "\n[[transmission]]\njoints = [1, 2]\nmatrix = [[1, 0], [0.5, 1]]\n";

#[test]
fn a_wrong_transmission_is_reported_with_its_place() {
    let text = format!("{GOOD}{COUPLED}");
    assert!(errors(&text).is_empty());
    let base = GOOD.lines().count() + 1;
    for (from, to, (line, column), words) in [
        ("[[1, 0], [0.5, 1]]", "[[1, 2], [0.5, 1]]", (3, 10), "singular"),
        ("[[1, 0], [0.5, 1]]", "[[1, 0], [0.5]]", (3, 10), "2 lists of 2 numbers"),
        ("[[1, 0], [0.5, 1]]", "[[1, 0], [\"x\", 1]]", (3, 20), "not a number"),
        ("[[1, 0], [0.5, 1]]", "[[1, 0], [true, 1]]", (3, 20), "finite number"),
        ("joints = [1, 2]", "joints = [1, 3]", (2, 14), "no joint of this arm"),
        ("joints = [1, 2]", "joints = [1, 1]", (2, 14), "twice"),
        ("joints = [1, 2]", "joints = [1]", (2, 10), "two or more"),
        ("joints = [1, 2]", "joint = [1, 2]", (2, 1), "unknown key"),
        (
            "0.5, 1]]\n",
            "0.5, 1]]\n[[transmission]]\njoints = [2, 1]\nmatrix = [[1, 0], [1, 1]]\n",
            (4, 1),
            "already",
        ),
    ] {
        assert!(text.contains(from));
        let found = errors(&text.replace(from, to));
        let place = format!("arm.toml:{}:{column}: ", base + line);
        assert!(
            found.iter().any(|e| e.starts_with(&place) && e.contains(words)),
            "{place} {words}: {found:#?}"
        );
    }
}

#[test]
fn names_and_degrees_are_reported() {
    let named = |one: &str, two: &str| {
        let name = |text: &str, kind: &str, name: &str| {
            text.replacen(kind, &format!("name = \"{name}\"\n{kind}"), 1)
        };
        name(&name(GOOD, "kind = \"revolute\"", one), "kind = \"prismatic\"", two)
    };
    let arm = Arm::parse(&named("pan", "lift"), "arm.toml").unwrap();
    assert_eq!(arm.joint_names(), ["pan", "lift"]);
    let found = errors(&named("pan", "pan"));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].starts_with("arm.toml:18:8: ") && found[0].contains("'pan' is already that of joint 1"),
        "{found:?}"
    );
    assert_eq!(Arm::parse(GOOD, "arm.toml").unwrap().joint_names(), ["1", "2"]);

    assert_error("\"pi/2\"", "90", "8:9", &["joint 1", "alpha = 90 rad", "\"pi/2\""]);
    assert_error("\"-pi/2\"", "\"-45\"", "10:9", &["joint 1", "theta = -45 rad", "\"-pi/4\""]);
    let wide = GOOD.replace("[-1.5, 1.5]", "[-170, 170]");
    let notes = Arm::parse(&wide, "arm.toml").unwrap().notes();
    assert!(notes.iter().any(|n| n.contains("[-170, 170] is in rad") && n.contains("2.9671")), "{notes:?}");
    assert!(Arm::parse(GOOD, "arm.toml").unwrap().notes().is_empty());
}

#[test]
fn frame_0_stands_where_the_file_says() {
    use dyngen::{Evaluator, Function, Model, SetKind};
    let at = |base: &str, function| {
        let model = Model::derive(Arm::parse(&format!("{GOOD}{base}"), "arm.toml").unwrap()).unwrap();
        let evaluator = Evaluator::new(&model, function, SetKind::Minimal).unwrap();
        let mut out = vec![0.0; evaluator.outputs()];
        evaluator.evaluate(
            &[0.3, 0.4],
            &[0.5, 0.6],
            &[0.7, 0.8],
            &vec![1.0; 20][..model.set(SetKind::Minimal).unwrap().parameters.len()],
            &mut out,
        );
        out
    };
    let base = "\n[base]\nxyz = [1, 2, 3]\nrpy = [0, 0, \"pi/2\"]\n";
    let (own, moved) = (at("", Function::ForwardKinematics), at(base, Function::ForwardKinematics));
    for j in 0..4 {
        // Rz(pi/2): x' = -y, y' = x.
        let shift = if j == 3 { [1.0, 2.0, 3.0] } else { [0.0; 3] };
        let expected = [shift[0] - own[4 + j], shift[1] + own[j], shift[2] + own[8 + j]];
        for i in 0..3 {
            assert!((moved[4 * i + j] - expected[i]).abs() < 1e-12, "{moved:?} {own:?}");
        }
    }
    assert_eq!(at("", Function::InverseDynamics), at(base, Function::InverseDynamics));
    let (own, moved) = (at("", Function::Jacobian), at(base, Function::Jacobian));
    for j in 0..2 {
        assert!((moved[j] + own[2 + j]).abs() < 1e-12 && (moved[2 + j] - own[j]).abs() < 1e-12);
    }
}
