//! `dyngen verify` against generated files, and against thousands of them with one thing changed.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)]

use chacha20::ChaCha8Rng;
use dyngen::verify::{Report, Verifier};
use dyngen::{Arm, Config, Function, Language};
use rand::{RngExt, SeedableRng};
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

/// One change of a text.
struct Mutant {
    text: String,
    /// From 1.
    line: usize,
    function: String,
    what: String,
    /// Whether it only swaps the terms of a sum or the factors of a product.
    commutes: bool,
}

/// The lines of function bodies, each with its function.
fn bodies(text: &str) -> Vec<(usize, String)> {
    let mut inside: Option<(String, String)> = None;
    let mut header = None;
    let mut lines = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.trim() == "mod trigonometry {" {
            break;
        }
        let indent: String = line.chars().take_while(|c| *c == ' ').collect();
        if let Some((name, end)) = &inside {
            if line == format!("{end}}}") {
                inside = None;
            } else {
                lines.push((i, name.clone()));
            }
            continue;
        }
        if let Some(rest) = line.trim().strip_prefix("pub fn ").or(line.trim().strip_prefix("fn ")) {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            header = Some((name, indent));
        }
        if header.is_some() && line.ends_with('{') {
            inside = header.take();
        } else if header.is_some() && line.ends_with(';') {
            header = None;
        }
    }
    lines
}

/// Names, numbers and single characters.
fn tokens(line: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut open = false;
    for c in line.chars() {
        let word = c.is_alphanumeric() || c == '_' || c == '.' && open;
        match tokens.last_mut() {
            Some(last) if open && word && (c != '.' || last.starts_with(|c: char| c.is_ascii_digit())) => {
                last.push(c)
            }
            _ => tokens.push(c.to_string()),
        }
        open = word && tokens.last().is_some_and(|t| t != ".");
    }
    tokens
}

fn is_value(token: &str) -> bool {
    let digits = token.trim_start_matches(|c: char| c.is_ascii_lowercase());
    let letters = &token[..token.len() - digits.len()];
    !letters.is_empty() && digits.starts_with(|c: char| c.is_ascii_digit()) && letters != "f"
}

/// A random change of one place; none where the place has none.
fn mutant(text: &str, bodies: &[(usize, String)], rng: &mut ChaCha8Rng) -> Option<Mutant> {
    let (i, function) = &bodies[rng.random_range(0..bodies.len())];
    let lines: Vec<&str> = text.lines().collect();
    let old = tokens(lines[*i]);
    let at = rng.random_range(0..old.len());
    let mut new = old.clone();
    let mut commutes = false;
    let kind = rng.random_range(0..3);
    let what = match old[at].as_str() {
        "+" => (new[at] = "-".to_string(), "sign").1,
        "-" if at > 0 && old[at - 1] == " " && old.get(at + 1).is_some_and(|t| t == " ") => match kind {
            0 => {
                new.swap(at - 2, at + 2);
                "swapped operands"
            }
            _ => (new[at] = "+".to_string(), "sign").1,
        },
        "-" => (new[at] = String::new(), "sign").1,
        "*" if old.get(at + 2).is_some() && is_value(&old[at + 2]) && is_value(&old[at - 2]) => match kind {
            0 => {
                new.swap(at - 2, at + 2);
                commutes = true;
                "swapped operands"
            }
            1 => (new[at] = "/".to_string(), "operation").1,
            _ => (new[at] = "+".to_string(), "operation").1,
        },
        "/" => {
            new.swap(at - 2, at + 2);
            "swapped operands"
        }
        "zero" => (new[at] = "one".to_string(), "constant").1,
        token if token.ends_with("f64") && token.starts_with(|c: char| c.is_ascii_digit()) => {
            let value: f64 = token.trim_end_matches("f64").parse().unwrap();
            let changed = match kind {
                0 => value.next_up(),
                1 => -value,
                _ => value * 1.5 + 0.125,
            };
            if changed == value {
                return None;
            }
            new[at] = format!("{changed}f64");
            "constant"
        }
        token if token.parse::<usize>().is_ok() && at > 0 && old[at - 1] == "[" => {
            let index: usize = token.parse().unwrap();
            new[at] = (if index > 0 && kind == 0 { index - 1 } else { index + 1 }).to_string();
            "index"
        }
        token if is_value(token) && kind == 0 && old[0] != "l" && at > 0 && old[at - 1] == " " => {
            new[at] = format!("-{token}");
            "sign"
        }
        token if is_value(token) => {
            // Another value of this line or the lines before.
            let near: Vec<String> = lines[i.saturating_sub(30)..=*i].iter().flat_map(|l| tokens(l)).collect();
            let near: Vec<&String> = near.iter().filter(|t| is_value(t)).collect();
            let other = near[rng.random_range(0..near.len())];
            if other == token {
                return None;
            }
            new[at] = other.clone();
            "operand"
        }
        _ => return None,
    };
    let mut changed: Vec<String> = lines.iter().map(ToString::to_string).collect();
    changed[*i] = new.concat();
    Some(Mutant {
        what: format!("{what}: {} -> {}", lines[*i].trim(), changed[*i].trim()),
        text: changed.join("\n") + "\n",
        line: i + 1,
        function: function.clone(),
        commutes,
    })
}

/// How many mutants of an arm's file there were, and what became of them.
#[derive(Debug, Default)]
struct Counts {
    tried: usize,
    found: usize,
    /// Nothing that dyngen writes.
    unread: usize,
    /// Swapped terms of a sum, swapped factors.
    commute: usize,
    /// Passed, and gives what the file gives, by numbers.
    same: usize,
}

/// Mutants of an arm's file, those that pass compared in numbers with the file by a compiler.
fn mutants(arm: &str, wished: usize, seed: u64) -> Counts {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let subject = Subject::new(arm, &FUNCTIONS);
    let bodies = bodies(&subject.text);
    let (mut counts, mut passed) = (Counts::default(), Vec::new());
    while counts.tried < wished {
        let Some(mutant) = mutant(&subject.text, &bodies, &mut rng) else { continue };
        let only = Function::parse(mutant.function.trim_end_matches("_with")).map(|f| vec![f]);
        match subject.verifier.verify(&mutant.text, only.as_deref()) {
            // A compiler finds these.
            Err(_) if syn::parse_file(&mutant.text).is_err() => continue,
            Err(_) => counts.unread += 1,
            Ok(report) if report.difference.is_some() => counts.found += 1,
            Ok(_) if mutant.commutes => counts.commute += 1,
            Ok(_) => passed.push(mutant),
        }
        counts.tried += 1;
    }
    counts.same = passed.len();
    let out = compared(arm, &subject.text, &passed);
    let lines: Vec<String> = passed.iter().map(|m| format!("{arm}:{}: {}", m.line, m.what)).collect();
    assert!(
        out.is_ok(),
        "a mutant passes and gives other numbers: {}\namong\n{}",
        out.unwrap_err(),
        lines.join("\n")
    );
    counts
}

/// A program in which a file and its mutants give the same numbers at random states; a potential energy up to
/// a constant.
const PROGRAM: &str = r#"
#![allow(warnings)]
use nalgebra::SVector;
fn near<'a>(name: &str, a: impl IntoIterator<Item = &'a f64>, b: impl IntoIterator<Item = &'a f64>) {
    for (a, b) in a.into_iter().zip(b) {
        assert!((a - b).abs() <= 1e-7 * (1.0 + a.abs()), "{name}: {a} and {b}");
    }
}
struct Draws(u64);
impl Draws {
    fn vector<const N: usize>(&mut self) -> SVector<f64, N> {
        SVector::from_fn(|_, _| {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            0.2 + (self.0 >> 11) as f64 / (1u64 << 53) as f64
        })
    }
}
macro_rules! compare {
    ($other:ident) => {{
        let mut draws = Draws(7);
        for _ in 0..20 {
            let (q, dq, ddq, tau) = (draws.vector(), draws.vector(), draws.vector(), draws.vector());
            let (p, zero) = (draws.vector(), SVector::zeros());
            let name = stringify!($other);
            near(name, &file::inverse_dynamics(&q, &dq, &ddq, &p), &$other::inverse_dynamics(&q, &dq, &ddq, &p));
            near(name, &file::regressor(&q, &dq, &ddq), &$other::regressor(&q, &dq, &ddq));
            near(name, &file::mass_matrix(&q, &p), &$other::mass_matrix(&q, &p));
            near(name, &file::coriolis_matrix(&q, &dq, &p), &$other::coriolis_matrix(&q, &dq, &p));
            near(name, &file::gravity(&q, &p), &$other::gravity(&q, &p));
            near(name, &file::forward_dynamics(&q, &dq, &tau, &p), &$other::forward_dynamics(&q, &dq, &tau, &p));
            near(name, &file::forward_kinematics(&q), &$other::forward_kinematics(&q));
            near(name, &file::jacobian(&q), &$other::jacobian(&q));
            let rise = file::potential_energy(&q, &p) - file::potential_energy(&zero, &p);
            near(name, [&rise], [&($other::potential_energy(&q, &p) - $other::potential_energy(&zero, &p))]);
        }
    }};
}
"#;

/// Whether mutants give the numbers of the file; what the program says where not.
fn compared(arm: &str, text: &str, mutants: &[Mutant]) -> Result<(), String> {
    let name = Path::new(arm).file_stem().unwrap().to_string_lossy().into_owned();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("mutants_{}_{name}", mutants.len()));
    std::fs::create_dir_all(folder.join("src")).unwrap();
    let manifest = "[package]\nname = \"mutants\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n\
        [dependencies]\nnalgebra = { version = \"0.35\", default-features = false, features = [\"libm\"] }\n";
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    std::fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let mut program = PROGRAM.to_string();
    let texts = std::iter::once(("file".to_string(), text));
    let texts = texts.chain(mutants.iter().enumerate().map(|(k, m)| (format!("mutant{k}"), m.text.as_str())));
    for (module, text) in texts {
        std::fs::write(folder.join(format!("src/{module}.rs")), text).unwrap();
        program += &format!("mod {module};\n");
    }
    let calls: String = (0..mutants.len()).map(|k| format!("    compare!(mutant{k});\n")).collect();
    std::fs::write(folder.join("src/main.rs"), format!("{program}fn main() {{\n{calls}}}\n")).unwrap();
    let out = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--offline"])
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", folder.parent().unwrap().join("golden/target"))
        .output()
        .unwrap();
    if out.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&out.stderr).into_owned()) }
}

fn every_mutant_is_found(each: usize, seed: u64) {
    for arm in ["tests/arms/twist.toml", "powerball/arm.toml"] {
        let counts = mutants(arm, each, seed);
        println!("{arm}: {counts:?}");
        let Counts { tried, found, unread, commute, same } = counts;
        assert_eq!(found + unread + commute + same, tried);
        assert!(found * 10 > tried * 9, "{counts:?}");
    }
}

#[test]
fn every_mutant_that_changes_a_value_is_found() {
    every_mutant_is_found(150, 1);
}

/// `cargo test --release -p dyngen --test verify -- --ignored --nocapture`
#[test]
#[ignore = "two minutes"]
fn of_two_thousand_mutants_every_one_that_changes_a_value_is_found() {
    every_mutant_is_found(1000, 2026);
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
        ("Parameter set: minimal", "Parameter set: full", 1, "PARAMETERS is not what the arm says"),
        ("Arm: ", "Arm: 0", 1, "generate it again"),
        // Constants, angles, what functions are given.
        ("JOINTS: usize = 3", "JOINTS: usize = 4", 1, "JOINTS is not what the arm says"),
        ("\"mx3\"", "\"my3\"", 1, "PARAMETER_NAMES is not what the arm says"),
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
    for words in
        ["proven: forward_dynamics_with", "not checked: batch", "not checked: tests", "not checked: friction"]
    {
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
