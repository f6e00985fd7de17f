//! A generated controller as a program.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A crate around a generated controller: without std and with every warning an error, and a program that
/// reads states and prints torques. Built next to the other generated crates, so that nalgebra is built once.
pub(crate) fn controller(folder: &Path) -> PathBuf {
    let name = format!("controller_{}", folder.file_name().unwrap().to_str().unwrap());
    std::fs::create_dir_all(folder.join("src")).unwrap();
    let manifest = format!(
        "[package]\nname = \"{name}\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n\
         nalgebra = {{ version = \"0.35\", default-features = false, features = [\"libm\"] }}\n"
    );
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    std::fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let library = "//! A generated controller.\n#![no_std]\n#![deny(warnings, missing_docs, \
        clippy::all)]\ninclude!(\"../controller.rs\");\n";
    std::fs::write(folder.join("src/lib.rs"), library).unwrap();
    let program = format!(
        "use {name}::{{JOINTS, TorqueModel}};\nuse nalgebra::SVector;\n
         fn main() {{
             let mut model = TorqueModel::default();
             for line in std::io::stdin().lines() {{
                 let line = line.unwrap();
                 // A new recording.
                 if line.is_empty() {{ model = TorqueModel::default(); continue; }}
                 let x: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
                 let joint = |k: usize| SVector::<f64, JOINTS>::from_column_slice(&x[k * JOINTS..(k + 1) * JOINTS]);
                 let torque = model.torque(&joint(0), &joint(1), &joint(2), x[3 * JOINTS], &[]);
                 let text: Vec<String> = torque.iter().map(|t| format!(\"{{t:?}}\")).collect();
                 println!(\"{{}}\", text.join(\",\"));
             }}
         }}\n"
    );
    std::fs::write(folder.join("src/main.rs"), program).unwrap();
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden/target");
    let cargo = |arguments: &[&str]| {
        Command::new(env!("CARGO"))
            .args(arguments)
            .arg("--offline")
            .current_dir(folder)
            .env("CARGO_TARGET_DIR", &target)
            .output()
            .unwrap()
    };
    let clippy = cargo(&["clippy", "--quiet", "--lib"]);
    let complaint = String::from_utf8_lossy(&clippy.stderr);
    assert!(clippy.status.success() || complaint.contains("is not installed"), "{complaint}");
    let built = cargo(&["build", "--quiet"]);
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    target.join("debug").join(name)
}

/// What the program prints for lines of states: numbers by line.
pub(crate) fn run(program: &Path, input: String) -> Vec<Vec<f64>> {
    use std::io::Write as _;
    let mut child = Command::new(program)
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut to = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || to.write_all(input.as_bytes()).unwrap());
    let done = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let text = String::from_utf8(done.stdout).unwrap();
    text.lines().map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect()
}
