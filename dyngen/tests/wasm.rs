//! Generated Rust in a browser's machine: compiled for wasm32 and run in node, it gives what the evaluator
//! gives.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::{Arm, Config, Evaluator, Function, Model, SetKind};
use rand::SeedableRng;
use std::path::Path;
use std::process::Command;
use support::{State, evaluate};

mod support;

const TARGET: &str = "wasm32-unknown-unknown";

/// What is missing to run this, if anything. `REQUIRE_NODE` makes it a must.
fn missing() -> Option<String> {
    let output = |program: &str, arguments: &[&str]| {
        let out = Command::new(program).args(arguments).output().ok()?;
        out.status.success().then(|| String::from_utf8_lossy(&out.stdout).into_owned())
    };
    let sysroot = output("rustc", &["--print", "sysroot"])?;
    let missing = if !Path::new(sysroot.trim()).join("lib/rustlib").join(TARGET).is_dir() {
        Some(format!("the target is not installed (rustup target add {TARGET})"))
    } else {
        output("node", &["--version"]).is_none().then(|| "node is not installed".to_string())
    };
    if let Some(missing) = &missing {
        assert!(std::env::var_os("REQUIRE_NODE").is_none(), "{missing}");
    }
    missing
}

/// The module's only function: a joint's torque, with values baked in.
const LIBRARY: &str = r#"//! An arm for a browser.
#[allow(missing_docs)]
mod arm { include!("arm.inc"); }
/// The torque of a joint, N·m, or NaN where there is no such joint.
#[unsafe(no_mangle)]
pub extern "C" fn torque(joint: u32, ARGUMENTS) -> f64 {
    let state = [NAMES];
    let vector = |from: usize| nalgebra::SVector::from_fn(|i, _| state[from + i]);
    let torque = arm::inverse_dynamics(&vector(0), &vector(arm::JOINTS), &vector(2 * arm::JOINTS));
    torque.get(joint as usize).copied().unwrap_or(f64::NAN)
}
"#;

/// Prints the torques of every state, one a line.
const SCRIPT: &str = r#"
const [, , file, text] = process.argv;
WebAssembly.instantiate(require("fs").readFileSync(file), {}).then(({ instance }) => {
    for (const { state, joints } of JSON.parse(text))
        for (let joint = 0; joint < joints; joint++) console.log(instance.exports.torque(joint, ...state));
});
"#;

#[test]
fn torques_in_node_are_the_evaluator_s() {
    if let Some(missing) = missing() {
        eprintln!("skipped: {missing}");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wasm");
    std::fs::create_dir_all(folder.join("src")).unwrap();
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let arm = workspace.join("powerball/arm.toml");
    let model = Model::derive(Arm::read(&arm).unwrap()).unwrap();
    let (n, names) = (model.arm().dof(), model.set(SetKind::Minimal).unwrap().names());
    let values: Vec<f64> = (0..names.len()).map(|k| (k as f64 + 1.0).sin()).collect();
    let file: serde_json::Map<String, serde_json::Value> =
        names.into_iter().zip(values.iter().map(|x| (*x).into())).collect();
    std::fs::write(folder.join("values.json"), serde_json::Value::Object(file).to_string()).unwrap();
    let config = Config::new(&arm).functions([Function::InverseDynamics]).values(folder.join("values.json"));
    config.write(&folder.join("src/arm.inc")).unwrap();
    let module = built(&folder, &workspace, 3 * n);
    let script = folder.join("run.js");
    std::fs::write(&script, SCRIPT).unwrap();
    let evaluator = Evaluator::new(&model, Function::InverseDynamics, SetKind::Minimal).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    // Beyond 10⁵ rad libm's own sine and cosine are called.
    let states: Vec<State> =
        [0.5, 3.0, 100.0, 1e7].iter().map(|size| State::draw(&mut random, n, *size)).collect();
    let text: Vec<serde_json::Value> = states
        .iter()
        .map(|s| serde_json::json!({ "state": ([&s.q[..], &s.dq, &s.ddq].concat()), "joints": n }))
        .collect();
    let text = serde_json::Value::Array(text).to_string();
    let out = Command::new("node").args([&script, &module]).arg(text).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let out = String::from_utf8_lossy(&out.stdout);
    let found: Vec<f64> = out.lines().map(|line| line.parse().unwrap()).collect();
    assert_eq!(found.len(), n * states.len());
    for (found, state) in found.chunks(n).zip(&states) {
        let expected = evaluate(&evaluator, &state.samples(&values));
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (x, y) in found.iter().zip(&expected) {
            assert!((x - y).abs() <= 1e-12 * size, "{found:?} {expected:?}");
        }
    }
}

/// The module of the crate in a folder, whose function takes `numbers` numbers.
fn built(folder: &Path, workspace: &Path, numbers: usize) -> std::path::PathBuf {
    let manifest = "[package]\nname = \"wasm\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n[lib]\n\
        crate-type = [\"cdylib\"]\n[dependencies]\n\
        nalgebra = { version = \"0.35\", default-features = false, features = [\"libm\"] }\n";
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    // The versions of this workspace, so that nothing has to be looked up.
    std::fs::copy(workspace.join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let names: Vec<String> = (0..numbers).map(|i| format!("x{i}")).collect();
    let arguments: Vec<String> = names.iter().map(|name| format!("{name}: f64")).collect();
    let library = LIBRARY.replace("ARGUMENTS", &arguments.join(", ")).replace("NAMES", &names.join(", "));
    std::fs::write(folder.join("src/lib.rs"), library).unwrap();
    // What depends on no target, tests/golden.rs builds too.
    let target = folder.join("../golden/target");
    let out = Command::new(env!("CARGO"))
        .args(["build", "--offline", "--quiet", "--target", TARGET])
        .current_dir(folder)
        .env("CARGO_TARGET_DIR", &target)
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    target.join(TARGET).join("debug/wasm.wasm")
}
