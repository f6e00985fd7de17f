#![allow(clippy::panic)]
//! What the tests and benches across crates share: the arms, and variants of them.

pub mod document;
pub mod generated;

use dyngen::Arm;
use std::path::{Path, PathBuf};

/// The workspace's root folder.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The arms of `tests/arms` by name, and the two arm files of powerball as `arm` and `lwa4p`.
pub fn arm_path(name: &str) -> PathBuf {
    match name {
        "arm" | "lwa4p" => root().join("powerball").join(format!("{name}.toml")),
        _ => root().join("tests/arms").join(format!("{name}.toml")),
    }
}

/// An arm's file as text.
///
/// # Panics
/// Where the file is missing: the test cannot run.
pub fn arm_text(name: &str) -> String {
    let path = arm_path(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// An arm by name.
///
/// # Panics
/// Where its file is missing or wrong: the test cannot run.
pub fn arm(name: &str) -> Arm {
    parse(&arm_text(name))
}

/// An arm from text.
///
/// # Panics
/// Where the text is wrong: the test cannot run.
pub fn parse(text: &str) -> Arm {
    Arm::parse(text, "test").unwrap_or_else(|e| panic!("{e}"))
}

/// The paper's arm with other gear ratios, one for each joint; `None` leaves the rotor out, and the grouping
/// with it.
pub fn paper_arm_with_ratios(ratios: [Option<u32>; 6]) -> Arm {
    let mut arm = arm("arm");
    for (joint, ratio) in arm.joints.iter_mut().zip(ratios) {
        joint.rotor_ratio = ratio.map(|k| dyngen::exact::rational::integer(i64::from(k)));
    }
    if ratios.contains(&None) {
        arm.groupings.clear();
    }
    arm
}
