//! The generated code of small arms: the committed bytes of three, and that all compile under the strictest
//! lints.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::{Config, FrictionTerm, Function};
use std::path::{Path, PathBuf};
use std::process::Command;

const ARMS: [&str; 4] = ["pendulum", "planar2r", "scara", "twist"];
/// Arms whose code can be read.
const REVIEWED: [&str; 3] = ["pendulum", "planar2r", "scara"];
/// Enough to review; every function is compiled.
const FUNCTIONS: [Function; 7] = {
    use Function::*;
    [InverseDynamics, Regressor, MassMatrix, CoriolisMatrix, Gravity, ForwardDynamics, ForwardKinematics]
};
const BLESS: &str = "DYNGEN_BLESS=1 cargo test -p dyngen --test golden";

fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests")
}

fn generated(arm: &str, functions: &[Function]) -> String {
    let config = Config::new(tests().join(format!("arms/{arm}.toml"))).functions(functions);
    config.source().unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn generated_code_is_what_was_reviewed() {
    let bless = std::env::var_os("DYNGEN_BLESS").is_some();
    let mut stale = Vec::new();
    for arm in REVIEWED {
        let path = tests().join(format!("golden/{arm}.rs"));
        let mut source = generated(arm, &FUNCTIONS);
        // What every file ends with is in the first one.
        if arm != REVIEWED[0] {
            source.truncate(source.find("mod trigonometry {").unwrap());
        }
        let golden = std::fs::read_to_string(&path).unwrap_or_default();
        if bless {
            std::fs::write(&path, source).unwrap();
        } else if golden != source {
            let same = golden.lines().zip(source.lines()).take_while(|(a, b)| a == b).count();
            let line = |text: &str| text.lines().nth(same).unwrap_or("(the end)").to_string();
            stale.push(format!(
                "tests/golden/{arm}.rs:{}:\n- {}\n+ {}",
                same + 1,
                line(&golden),
                line(&source)
            ));
        }
    }
    assert!(
        stale.is_empty(),
        "{}\nIf the change is meant, run {BLESS} and look at the diff.",
        stale.join("\n")
    );
}

/// A crate of its own without std, in which every warning is an error, clippy's too, and whose emitted tests
/// are run.
#[test]
fn generated_code_compiles_without_a_warning_and_passes_its_own_tests() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    std::fs::create_dir_all(folder.join("src")).unwrap();
    let manifest = "[package]\nname = \"golden\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n\
                    nalgebra = { version = \"0.35\", default-features = false, features = [\"libm\"] }\n";
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    // The versions of this workspace, so that nothing has to be looked up.
    std::fs::copy(tests().join("../Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let mut library =
        "//! Generated arms.\n#![no_std]\n#![deny(warnings, missing_docs, clippy::all)]\n".to_string();
    let friction = ["viscous", "coulomb", "tanh:200"].map(|term| term.parse::<FrictionTerm>().unwrap());
    for arm in ARMS {
        let config = Config::new(tests().join(format!("arms/{arm}.toml")))
            .friction(friction.clone())
            .batch(true)
            .tests(true);
        config.write(&folder.join(format!("src/{arm}.inc"))).unwrap();
        library += &format!("pub mod {arm} {{\n    //! An arm.\n    include!(\"{arm}.inc\");\n}}\n");
    }
    std::fs::write(folder.join("src/lib.rs"), library).unwrap();
    let cargo = |arguments: &[&str]| {
        Command::new(env!("CARGO"))
            .args(arguments)
            .arg("--offline")
            .current_dir(&folder)
            .env("CARGO_TARGET_DIR", folder.join("target"))
            .output()
            .unwrap()
    };
    let clippy = cargo(&["clippy", "--quiet", "--all-targets"]);
    // Where the toolchain came without clippy, the compiler's own lints have to do.
    let missing = String::from_utf8_lossy(&clippy.stderr).contains("is not installed");
    let out = if missing { cargo(&["check", "--quiet"]) } else { clippy };
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let out = cargo(&["test"]);
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success(), "{text}{}", String::from_utf8_lossy(&out.stderr));
    // Six tests an arm.
    assert!(text.contains("24 passed"), "{text}");
}

/// A wrong sum of the parts is what an emitted test must notice.
#[test]
fn an_emitted_test_can_fail() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("broken");
    std::fs::create_dir_all(folder.join("src")).unwrap();
    let manifest = "[package]\nname = \"broken\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n\
                    nalgebra = { version = \"0.35\", default-features = false, features = [\"libm\"] }\n";
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    std::fs::copy(tests().join("../Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let source = Config::new(tests().join("arms/pendulum.toml")).tests(true).source().unwrap();
    let gravity = source.find("pub fn gravity_with").unwrap();
    let sign = gravity + source[gravity..].find(" * ").unwrap();
    std::fs::write(folder.join("src/lib.rs"), format!("{} + {}", &source[..sign], &source[sign + 3..]))
        .unwrap();
    let out = Command::new(env!("CARGO"))
        .args(["test", "--offline"])
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", folder.parent().unwrap().join("golden/target"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(!out.status.success());
    assert!(text.contains("the_torque_is_the_sum_of_its_parts ... FAILED"), "{text}");
}
