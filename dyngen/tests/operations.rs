//! Operation counts of every test arm's functions: exactly those of docs/results/performance.md, and within
//! the bounds that were set.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::graph::{Operations, Preparation};
use dyngen::{Arm, Function, Model, SetKind};
use std::fmt::Write;
use std::path::{Path, PathBuf};

const COUNTED: [Function; 5] = {
    use Function::*;
    [InverseDynamics, Regressor, MassMatrix, CoriolisMatrix, Gravity]
};
const BLESS: &str = "DYNGEN_BLESS=1 cargo test --release -p dyngen --test operations";
const BEGIN: &str = "<!-- operations -->\n";
const END: &str = "<!-- end of operations -->\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap()
}

/// A file's lines without some keys, and without its groupings.
fn without(path: &str, keys: &[&str]) -> String {
    let text = text(path);
    let table = text.split("[[grouping]]").next().unwrap();
    let kept = table.lines().filter(|line| !keys.iter().any(|key| line.starts_with(key)));
    kept.fold(String::new(), |all, line| all + line + "\n")
}

fn arms() -> Vec<(&'static str, String)> {
    let paper = "powerball/arm.toml";
    let file = |name: &str| text(&format!("tests/arms/{name}.toml"));
    vec![
        ("LWA 4P, Eq. 12, no rotors", without(paper, &["rotor_ratio"])),
        ("LWA 4P, no symmetries, no rotors", without(paper, &["rotor_ratio", "zero"])),
        ("LWA 4P, Eq. 12, rotors of ratio 1", text(paper)),
        ("Puma 560, modified frames", file("puma560")),
        ("UR5e", file("ur5e")),
        ("Panda", file("panda")),
        ("Stanford arm", file("stanford")),
        ("SCARA", file("scara")),
    ]
}

fn model(text: &str) -> Model {
    Model::derive(Arm::parse(text, "test").unwrap_or_else(|e| panic!("{e}"))).unwrap()
}

fn counts(model: &Model) -> Vec<Operations> {
    COUNTED.iter().map(|f| model.function(*f, SetKind::Minimal).unwrap().operations()).collect()
}

fn table() -> String {
    let mut table = String::from(
        "| arm | parameters | τ | Y | B | C | g | prepare |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (name, text) in arms() {
        let model = model(&text);
        let mut preparation = Preparation::default();
        for function in COUNTED {
            let built = model.function(function, SetKind::Minimal).unwrap();
            let _ = built.without_preparation(&mut preparation);
        }
        write!(table, "| {name} | {} |", model.set(SetKind::Minimal).unwrap().parameters.len()).unwrap();
        for o in counts(&model) {
            write!(table, " {} + {} ({}) |", o.mul, o.add, o.sin_cos).unwrap();
        }
        let o = preparation.operations();
        writeln!(table, " {} + {} |", o.mul, o.add).unwrap();
    }
    table
}

#[test]
fn the_counts_are_those_of_the_documentation() {
    let path = root().join("docs/results/performance.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = page.split_once(BEGIN).unwrap();
    let (written, after) = rest.split_once(END).unwrap();
    let table = table();
    if std::env::var_os("DYNGEN_BLESS").is_some() {
        std::fs::write(&path, format!("{before}{BEGIN}{table}{END}{after}")).unwrap();
        return;
    }
    for (is, was) in table.lines().zip(written.lines()) {
        assert_eq!(is, was, "docs/results/performance.md; if the change is meant, run {BLESS}");
    }
    assert_eq!(table, written);
}

/// What a guided search on one arm and the best public recursions left as goals: multiplications and
/// additions of τ, Y, B, C and g.
#[test]
fn the_counts_are_within_their_bounds() {
    let bounds: [(usize, [(usize, usize); 5]); 2] = [
        (0, [(160, 130), (190, 125), (85, 75), (320, 250), (18, 8)]),
        (1, [(235, 215), (370, 250), (125, 120), (450, 380), (44, 26)]),
    ];
    let arms = arms();
    for (arm, bounds) in bounds {
        let (name, text) = &arms[arm];
        for ((function, o), bound) in COUNTED.iter().zip(counts(&model(text))).zip(bounds) {
            assert!(o.mul <= bound.0 && o.add <= bound.1, "{name} {function}: {} + {}", o.mul, o.add);
        }
    }
    let puma = counts(&model(&arms[3].1));
    assert!(puma[0].mul <= 285 && puma[0].add <= 240, "{:?}", puma[0]);
    assert!(puma[1].mul <= 500 && puma[1].add <= 360, "{:?}", puma[1]);
}
