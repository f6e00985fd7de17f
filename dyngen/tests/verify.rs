//! `dyngen verify` against generated files, and against files with one thing changed.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)]

use dyngen::verify::{Report, Verifier};
use dyngen::{Arm, Config, Function, Language};
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

const FUNCTIONS: [Function; 9] = {
    use Function::*;
    [
        InverseDynamics,
        Regressor,
        MassMatrix,
        CoriolisMatrix,
        Gravity,
        ForwardDynamics,
        ForwardKinematics,
        Jacobian,
        PotentialEnergy,
    ]
};

/// A file, and what verifies it.
struct Subject {
    text: String,
    verifier: Verifier,
}

impl Subject {
    fn new(arm: &str, functions: &[Function]) -> Subject {
        let path = root().join(arm);
        let text = Config::new(&path).functions(functions).source().unwrap();
        let verifier = Verifier::new(Arm::read(&path).unwrap(), Language::Rust, &text).unwrap();
        Subject { text, verifier }
    }

    fn report(&self) -> Report {
        self.verifier.verify(&self.text, None).unwrap()
    }
}

#[test]
fn everything_that_is_emitted_is_proven_as_it_is_printed() {
    for arm in ["tests/arms/twist.toml", "tests/arms/planar2r.toml", "powerball/arm.toml"] {
        let subject = Subject::new(arm, &Function::common().collect::<Vec<_>>());
        let report = subject.report();
        assert_eq!((report.difference, report.not_checked), (None, vec![]), "{arm}");
        for function in Function::common() {
            assert!(report.proven.contains(&function.to_string()), "{arm}: {function}");
            assert!(report.proven.contains(&format!("{function}_with")), "{arm}: {function}");
        }
    }
}

/// A file in C, and single changes of it that a compiler takes.
#[test]
fn a_file_in_c_is_proven_and_its_mutants_are_found() {
    for arm in ["tests/arms/twist.toml", "tests/arms/scara.toml", "powerball/arm.toml"] {
        let path = root().join(arm);
        let output = Path::new(env!("CARGO_TARGET_TMPDIR")).join("verified.c");
        let config = Config::new(&path).language(Language::C).functions(FUNCTIONS.to_vec());
        config.write(&output).unwrap();
        let text = std::fs::read_to_string(&output).unwrap();
        let verifier = Verifier::new(Arm::read(&path).unwrap(), Language::C, &text).unwrap();
        let report = verifier.verify(&text, None).unwrap();
        assert_eq!(report.difference, None, "{arm}");
        assert_eq!(report.not_checked, ["verified.h"]);
        assert_eq!(report.proven.len() % 2, 0);
        for (old, new) in [
            ("result[1] = ", "result[1] = -"),
            ("= trig->cos[0];", "= trig->sin[0];"),
            (" * c", " / c"),
            (" + ", " - "),
            ("prepared->values[1] = ", "prepared->values[1] = -"),
            ("= dq[0];", "= dq[1];"),
            ("&trig.sin[0], &trig.cos[0]", "&trig.cos[0], &trig.sin[0]"),
            ("(dq, ", "(ddq, "),
            ("near - part", "near + part"),
            ("#include <math.h>", "#include <math.h>\n#define dq1 dq2"),
            ("-1.66666666666666324348e-01", "-1.66666666666666324348e-02"),
        ] {
            // Behind the helpers, but where they are meant.
            let from = if text[..text.find("_prepare(").unwrap()].matches(old).count() == 1 {
                0
            } else {
                text.find("_prepare(").unwrap()
            };
            let Some(at) = text[from..].find(old).map(|k| k + from) else { continue };
            let changed = format!("{}{new}{}", &text[..at], &text[at + old.len()..]);
            let found = verifier.verify(&changed, None);
            assert!(found.is_err() || found.unwrap().difference.is_some(), "{arm}: {old} -> {new}");
        }
    }
}

/// Batch forms and friction of a file in Rust, and single changes of them that a compiler takes.
#[test]
fn batch_forms_and_friction_are_proven_and_their_mutants_are_found() {
    let path = root().join("tests/arms/scara.toml");
    let terms = ["viscous", "coulomb", "tanh:20"].map(|term| term.parse().unwrap());
    let config = Config::new(&path).functions(FUNCTIONS).batch(true).friction(terms);
    let text = config.source().unwrap();
    let verifier = Verifier::new(Arm::read(&path).unwrap(), Language::Rust, &text).unwrap();
    let report = verifier.verify(&text, None).unwrap();
    assert_eq!((report.difference, report.not_checked), (None, vec![]));
    for name in ["batch::gravity", "batch::jacobian", "friction_columns", "friction"] {
        assert!(report.proven.iter().any(|proven| proven == name), "{name}");
    }
    for (old, new) in [
        ("nalgebra::convert(0.06)", "nalgebra::convert(6.0)"),
        ("near & are_near(angles)", "near | are_near(angles)"),
        ("if ![q2, q4]", "if ![q2]"),
        ("out2_1[lane] = x2_1;", "out2_1[lane] = x1_1;"),
        ("cells[lane] = *value;", "cells[lane] = -*value;"),
        ("out.iter_mut().zip(result.iter())", "out.iter_mut().zip(result.iter().rev())"),
        ("trigonometry::near(q2[lane])", "trigonometry::near(q1[lane])"),
        ("super::gravity_with", "super::inverse_dynamics_with"),
        ("for lane in 0..LANES", "for lane in 1..LANES"),
        ("(20f64)", "(21f64)"),
        ("sign(dq1)", "sign(dq2)"),
        ("component_mul(coefficients)", "component_mul(&friction_columns(dq))"),
    ] {
        let changed = text.replacen(old, new, 1);
        assert_ne!(changed, text, "there is no {old}");
        let found = verifier.verify(&changed, None);
        assert!(found.is_err() || found.unwrap().difference.is_some(), "{old} -> {new}");
    }
}

/// Files with contraction in every language: what is proven, and changes that are found.
#[test]
fn a_file_with_contraction_is_proven_and_its_mutants_are_found() {
    let path = root().join("tests/arms/scara.toml");
    for language in [Language::Rust, Language::C, Language::Cuda, Language::Wgsl] {
        // A potential energy is the same with another constant.
        let config = Config::new(&path).language(language).functions(FUNCTIONS[..8].to_vec());
        let (plain, text) = (config.source().unwrap(), config.contract(true).source().unwrap());
        let name = if language == Language::Wgsl { "fma(" } else { "fused(" };
        assert!(!plain.contains(name) && text.matches(name).count() > 50, "{language}");
        let verifier = Verifier::new(Arm::read(&path).unwrap(), language, &text).unwrap();
        assert_eq!(verifier.verify(&text, None).unwrap().difference, None, "{language}");
        let call = text.rfind(&format!("= {name}")).unwrap();
        let line = &text[call..call + text[call..].find(';').unwrap()];
        let arguments = line.trim_end_matches(')').split_once('(').unwrap().1;
        let of: Vec<&str> = arguments.split(", ").collect();
        let [x, y, z] = of[..] else { panic!("{line}") };
        let mut changes = vec![
            (line.to_string(), format!("= {name}{x}, {z}, {y})")),
            (line.to_string(), format!("= {name}{x}, {y}, -{z})").replace("--", "")),
            (line.to_string(), format!("= {name}{x}, {y})")),
            (line.to_string(), format!("= other({x}, {y}, {z})")),
        ];
        changes.extend(match language {
            Language::Rust => vec![("x.simd_mul_add(y, z)".to_string(), "x.simd_mul_add(z, y)".to_string())],
            Language::Wgsl => Vec::new(),
            _ => vec![
                ("fma(x, y, z)".to_string(), "fma(x, z, y)".to_string()),
                ("#define fused(x, y, z) fmaf(x, y, z)".to_string(), String::new()),
            ],
        });
        for (old, new) in changes {
            let at = text.rfind(&old).unwrap_or_else(|| panic!("{language}: {old}"));
            let changed = format!("{}{new}{}", &text[..at], &text[at + old.len()..]);
            let found = verifier.verify(&changed, None);
            assert!(found.is_err() || found.unwrap().difference.is_some(), "{language}: {old} -> {new}");
        }
    }
}

/// What the command reports about a text as a generated file: its exit code, standard output and error.
fn command(name: &str, text: &str, arm: &str, more: &[&str]) -> (Option<i32>, String, String) {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&file, text).unwrap();
    let arm = root().join(arm);
    let mut command = Command::new(env!("CARGO_BIN_EXE_dyngen"));
    let out = command.arg("verify").args([&file, &arm]).args(more).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code(), text(&out.stdout), text(&out.stderr))
}

/// The line, from 1, where a text begins.
fn line_of(text: &str, part: &str) -> usize {
    text[..text.find(part).unwrap()].matches('\n').count() + 1
}

#[test]
fn the_command_names_function_entry_and_line() {
    let twist = Subject::new("tests/arms/twist.toml", &[Function::Gravity, Function::ForwardKinematics]).text;
    let of = |text: &str, more: &[&str]| command("said.rs", text, "tests/arms/twist.toml", more);
    let (code, out, _) = of(&twist, &[]);
    assert_eq!(code, Some(0), "{out}");
    assert!(
        out.contains("proven: gravity_with\n") && out.contains("proven: elbow::forward_kinematics\n"),
        "{out}"
    );
    // A wrong sign of the second torque.
    let at = twist.find("pub fn gravity_with").unwrap();
    let result = at + twist[at..].find("ArrayStorage([[").unwrap() + "ArrayStorage([[".len();
    let second = result + twist[result..].find(", ").unwrap() + 2;
    let wrong = match twist[second..].strip_prefix('-') {
        Some(rest) => format!("{}{rest}", &twist[..second]),
        None => format!("{}-{}", &twist[..second], &twist[second..]),
    };
    let (code, out, _) = of(&wrong, &["--json"]);
    let object: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(code, Some(1));
    let difference = &object["difference"];
    assert_eq!(
        (&difference["function"], &difference["entry"]),
        (&"gravity".into(), &serde_json::json!([2, 1]))
    );
    let line = difference["line"].as_u64().unwrap() as usize;
    assert!(
        line > line_of(&twist, "pub fn gravity_with") && line < line_of(&twist, "pub fn forward_kinematics<")
    );
}

#[test]
fn what_is_no_function_is_looked_at_too() {
    let twist = Subject::new("tests/arms/twist.toml", &[Function::Gravity, Function::ForwardKinematics]).text;
    let said = |old: &str, new: &str| {
        assert!(twist.contains(old), "{old}");
        command("around.rs", &twist.replacen(old, new, 1), "tests/arms/twist.toml", &[])
    };
    for (old, new, code, words) in [
        // The module of sines and cosines, to the last digit, and without a line.
        ("1.0562999066987428e-23", "1.0562999066987429e-23", 2, "trigonometry is not the one"),
        ("let z = r * r;", "let z = r + r;", 2, "trigonometry is not the one"),
        // What the head says.
        ("// Rounded: 0.7648421872844885 is cos(0.7)\n", "", 1, "0.7648421872844885 in line"),
        ("is sin(0.7)", "is cos(0.7)", 2, ":7: 0.644217687237691 is not cos(0.7) rounded"),
        ("0.644217687237691f64", "0.644217687237692f64", 1, "is not what the Lagrangian says"),
        ("Parameter set: minimal", "Parameter set: full", 1, "PARAMETER_NAMES is not what the arm says"),
        ("Arm: ", "Arm: 0", 1, "generate it again"),
        // Constants, angles, what functions are given.
        ("JOINTS: usize = 3", "JOINTS: usize = 4", 1, "JOINTS is not what the arm says"),
        ("\"mx3\"", "\"my3\"", 1, "has sums that do not determine the torques"),
        ("\"mx3\"", "\"mx\"", 1, "has mx, which is no sum of the arm's parameters"),
        ("(0.2f64)", "(0.3f64)", 1, "an angle that is no sum of the arm's"),
        ("*self", "Prepared(self.0)", 2, "an item that dyngen does not write"),
        ("use nalgebra::{", "use other::SMatrix;\nuse nalgebra::{", 2, "an item that dyngen does not write"),
        ("pub fn gravity<", "#[cfg(test)]\npub fn gravity<", 2, "an attribute that dyngen does not write"),
        (
            "q: &SVector<T, JOINTS>,\n    parameters",
            "q: &SVector<T, 3>,\n    parameters",
            2,
            "q has another type",
        ),
        ("let x", "let mut x", 2, "a pattern that dyngen does not write"),
        ("pub mod elbow {", "pub mod wrist {", 2, "the arm has no frame wrist"),
    ] {
        let (found, out, error) = said(old, new);
        assert_eq!(found, Some(code), "{old}: {out}{error}");
        assert!(out.contains(words) || error.contains(words), "{old}: {out}{error}");
    }
    let (code, _, error) = said("pub fn gravity<", "pub fn gravity((<");
    assert!(
        code == Some(2) && error.contains(&format!(":{}: ", line_of(&twist, "pub fn gravity<"))),
        "{error}"
    );
    let (code, _, error) = command("other.rs", &twist, "tests/arms/scara.toml", &[]);
    let hash = twist.split("// Arm: ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    assert!(code == Some(1) && error.contains(&format!("generated for the arm {hash}")), "{error}");
}

#[test]
fn values_that_are_baked_in_are_compared() {
    let (arm, values) = ("examples/new-arm/arm.toml", root().join("examples/new-arm/values.json"));
    let config = Config::new(root().join(arm)).values(&values).batch(true).tests(true);
    let text = config.friction(["viscous".parse().unwrap()]).source().unwrap();
    let given = ["--values", values.to_str().unwrap()];
    let (code, out, error) = command("baked.rs", &text, arm, &given);
    assert_eq!((code, error.as_str()), (Some(0), ""));
    for words in [
        "proven: forward_dynamics_with",
        "proven: batch::forward_dynamics",
        "proven: friction_columns",
        "proven: friction",
        "not checked: tests",
    ] {
        assert!(out.lines().any(|line| line == words), "{words}: {out}");
    }
    // The file with other values than it says.
    let list = text.find("PARAMETER_VALUES: ").unwrap();
    let first = list + text[list..].find("f64,").unwrap();
    let (code, out, _) = command("baked.rs", &format!("{}5{}", &text[..first], &text[first..]), arm, &[]);
    assert!(code == Some(1) && out.contains("is not what the Lagrangian says"), "{out}");
    // Other values than those of the file.
    let other = std::fs::read_to_string(&values).unwrap().replacen("1.2", "1.25", 1);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("other.json");
    std::fs::write(&path, other).unwrap();
    let (code, _, error) = command("baked.rs", &text, arm, &["--values", path.to_str().unwrap()]);
    assert!(code == Some(1) && error.contains("is baked into the file"), "{error}");
}

#[test]
fn a_file_of_kinematics_alone_is_proven() {
    let report = Subject::new("tests/arms/ur5e.toml", &[Function::Jacobian]).report();
    assert_eq!(
        (report.proven, report.difference),
        (["Trig::new", "jacobian", "jacobian_with"].map(String::from).into(), None)
    );
}

/// Files that are wrong where a proof of what functions print does not look.
#[test]
fn what_dyngen_does_not_print_is_refused() {
    let path = root().join("tests/arms/twist.toml");
    let functions = [Function::Gravity, Function::MassMatrix, Function::Jacobian];
    let config = Config::new(&path).functions(functions);
    let of = |language: Language, batch: bool| {
        let text = config.clone().language(language).batch(batch).source().unwrap();
        let verifier = Verifier::new(Arm::read(&path).unwrap(), language, &text).unwrap();
        assert_eq!(verifier.verify(&text, None).unwrap().difference, None, "{language}");
        (text, verifier)
    };
    let files = [
        (Language::Rust, of(Language::Rust, true)),
        (Language::C, of(Language::C, false)),
        (Language::Cuda, of(Language::Cuda, false)),
        (Language::Wgsl, of(Language::Wgsl, false)),
    ];
    let rust = &files[0].1.0;
    let block = |from: &str, until: &str| {
        let at = rust.find(from).unwrap();
        rust[at..at + rust[at..].find(until).unwrap() + until.len()].to_string()
    };
    let friction = "pub fn friction<T: SimdRealField + Copy>(dq: &SVector<T, JOINTS>) -> SVector<T, JOINTS> \
        { SVector::from_array_storage(ArrayStorage([[T::zero(), T::zero(), T::zero()]])) }";
    let other = block("fn angles_3<", "\n}\n").replace("angles_3", "angles_9");
    let negative = block("fn angles_1<", "\n}\n").replace("[q1]\n", "[-q1]\n");
    assert!(negative.contains("-q1"));
    let cases = [
        // Comments, lines and numbers that a compiler takes in another way.
        (Language::C, "p4 * x12;", "p4 * x12 //* */ (real)1.0\n;"),
        (Language::C, "const real x13", "/* *\\\n/ 1 /* */ const real x13"),
        (Language::C, "const real x13", "/* *??/\n/ 1 /* */ const real x13"),
        (Language::C, "(real)1.0;\n    const real x4", "(real)1;\n    const real x4"),
        (Language::C, ".h\"\n", ".h\"\\\n"),
        (Language::Cuda, "p4 * x12;", "p4 * x12 //* */ (real)1.0\n;"),
        // What nothing calls, and the structure of what is not there.
        (Language::Rust, "pub mod elbow {\n", &format!("pub mod elbow {{\n{friction}\n")),
        (Language::Rust, "fn angles_3<", &format!("{other}\nfn angles_3<")),
        (
            Language::Rust,
            "pub const PARAMETER_NAMES",
            "pub const TWIST_NONZERO: [(usize, usize); 1] = [(0, 0)];\npub const PARAMETER_NAMES",
        ),
        (
            Language::Rust,
            "pub fn mass_matrix<T: SimdRealField + Copy, const",
            "pub fn coriolis_matrix<T: SimdRealField + Copy, const",
        ),
        // Another function of the name in the module of a frame.
        (Language::Rust, "pub mod elbow {\n", &format!("pub mod elbow {{\n{negative}\n")),
        (Language::Rust, "= super::gravity_with(&trig", "= gravity_with(&trig"),
        // Attributes, also within.
        (Language::Rust, "let z = r * r;", "#[cfg(any())]\nlet z = r * r;"),
        (Language::Rust, "use nalgebra::{Array", "#![feature(x)]\nuse nalgebra::{Array"),
        (
            Language::Rust,
            "derive(Clone, Copy, Debug, PartialEq)",
            "derive(Clone, Copy, Debug, PartialEq, Other)",
        ),
        (
            Language::Rust,
            "let trig = Trig {\n",
            "let trig = Trig {\nsin: [T::zero(), T::zero(), T::zero()],\n",
        ),
        // Arrays over samples.
        (Language::Rust, "let [q1, q2, q3] = q;", "let [q1, q2, q3] = dq;"),
        (Language::Rust, "let [q1, q2, q3] = q;", "let [q1, q2, q3] = q; let [q1, q2, q3] = q;"),
        (Language::Rust, "for lane in 0..LANES {\n", "for lane in 0..LANES {\nlet q3 = q1;\n"),
        (
            Language::Rust,
            "for lane in 0..LANES {\n",
            "for lane in 0..LANES {\nlet far = trigonometry::near(q1[lane]);\n",
        ),
        (Language::Rust, "= x1_1;", "= x1_1[lane];"),
        // Numbers that are zero modulo the prime.
        (Language::Rust, "0.2f64", "2305843009213693951.2f64"),
        // Lists and places.
        (Language::C, "\"m2 + m3\",", "\"m2 + m3\""),
        (Language::C, "\"m2 + m3\",", "\"m2 + m3\";"),
        (Language::C, "twist_parameter_names[TWIST_PARAMETERS] = {", "twist_parameter_names[1] = {"),
        (Language::C, "_parameter_names[TWIST_PARAMETERS] = {", "_parameter_names[TWIST_PARAMETERS] = 1 + {"),
        (Language::C, "&prepared, result);", "result, &prepared);"),
        (Language::C, "&prepared, result);", "prepared, result);"),
        (Language::C, "&trig.sin[2]", "&trig.sin[99999999999]"),
        (Language::Wgsl, "@binding(13)", "@binding(14)"),
        (Language::Wgsl, "@binding(12)", "@binding(11)"),
        // Sums.
        (Language::C, "\"m2 + m3\"", "\"m2^2 + m3\""),
        (Language::C, "\"m2 + m3\"", "\"m2 + m1844674407370955162\""),
    ];
    let mut passed = Vec::new();
    for (language, old, new) in cases {
        let (text, verifier) = &files.iter().find(|(of, _)| *of == language).unwrap().1;
        let changed = text.replacen(old, new, 1);
        let found = verifier.verify(&changed, None);
        if changed == *text || found.is_ok_and(|report| report.difference.is_none()) {
            passed.push(format!("{language}: {old} -> {new}"));
        }
    }
    assert!(passed.is_empty(), "passed, or there is no such text:\n{}", passed.join("\n"));
}

#[test]
fn arms_with_loops_transmissions_and_followers_are_proven() {
    let mimic = r#"
name = "follower"
convention = "modified"
gravity = [0, 0.5, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = 0, d = 0.5, theta = 0.3, rotor_ratio = 100 },
    { kind = "revolute", a = 0.3, alpha = "-pi/2", d = 0, theta = 0, rotor_ratio = 80 },
    { kind = "revolute", a = 0.4, alpha = 0, d = 0.1, theta = 0.4, mimic = { joint = 2, ratio = "-3/2", offset = 0.2 } },
    { kind = "prismatic", a = 0.1, alpha = "pi/2", d = 0, theta = 0 },
]
"#;
    let transmission = mimic.replace(", mimic = { joint = 2, ratio = \"-3/2\", offset = 0.2 }", "")
        + "\n[[transmission]]\njoints = [1, 2]\nmatrix = [[1, 0], [\"1/2\", 1]]\n";
    for (name, arm) in [
        ("mimic", mimic),
        ("transmission", &transmission),
        ("loop", include_str!("loops/crank.toml")),
        ("linkage", include_str!("loops/rocker.toml")),
        ("linkages", include_str!("loops/double.toml")),
    ] {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}_verified.toml"));
        std::fs::write(&path, arm).unwrap();
        for language in [Language::Rust, Language::C, Language::Cuda] {
            let config = Config::new(&path).language(language).functions(FUNCTIONS);
            let config = config.friction(["viscous".parse().unwrap()]).batch(language == Language::Rust);
            let text = config.source().unwrap();
            let verifier = Verifier::new(Arm::read(&path).unwrap(), language, &text).unwrap();
            let report = verifier.verify(&text, None).unwrap();
            assert_eq!(report.difference, None, "{name}, {language}");
            assert!(report.proven.iter().any(|proven| proven == "friction"), "{name}, {language}");
        }
    }
}

/// √(25·S)/5 is −√S for the root that is a square modulo the prime: only roots of S itself are read.
#[test]
fn a_root_of_another_number_is_refused() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("root_verified.toml");
    std::fs::write(&path, include_str!("loops/rocker.toml")).unwrap();
    let config = Config::new(&path).language(Language::C).functions([Function::InverseDynamics]);
    let text = config.source().unwrap();
    let start = text.find("= root(").unwrap() + 2;
    let end = start + text[start..].find(';').unwrap();
    let inner = &text[start + 5..end - 1];
    let verifier = Verifier::new(Arm::read(&path).unwrap(), Language::C, &text).unwrap();
    for root in [format!("-(root({inner} * (real)25.0) / (real)5.0)"), format!("-root({inner})")] {
        let other = format!("{}{root}{}", &text[..start], &text[end..]);
        assert!(verifier.verify(&other, None).unwrap().difference.is_some(), "{root}");
    }
}
