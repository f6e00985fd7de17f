//! Generates the code that the tests compile: the arms of `tests/arms` and the paper's arm, for each
//! parameter set.

use dyngen::{Config, Function, SetKind};
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=tests/arms");
    for name in ["puma560", "ur5e", "panda", "stanford"] {
        for set in [SetKind::Full, SetKind::Minimal, SetKind::Symbolic] {
            let config =
                Config::new(format!("tests/arms/{name}.toml")).parameters(set).batch(name == "stanford");
            config.build(&format!("{name}_{set}.rs")).unwrap_or_else(|e| e.exit());
        }
    }
    let rotorless = Config::new("tests/arms/lwa4p_rotorless.toml");
    rotorless.batch(true).build("lwa4p_rotorless_minimal.rs").unwrap_or_else(|e| e.exit());
    let full = Config::new("powerball/arm.toml").parameters(SetKind::Full);
    full.build("lwa4p_full.rs").unwrap_or_else(|e| e.exit());
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default());
    for joints in 1..=9 {
        let config =
            Config::new(chain(joints, &out)).functions([Function::InverseDynamics, Function::Regressor]);
        config.build(&format!("chain{joints}.rs")).unwrap_or_else(|e| e.exit());
    }
}

/// An arm file for `benches/growth.rs`: revolute joints with twists of ±90° in turn, a length along and
/// across every axis.
fn chain(joints: usize, folder: &Path) -> PathBuf {
    let mut text = format!("name = \"chain{joints}\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n");
    for i in 0..joints {
        let (sign, a, d) = (["", "-"][i % 2], 1 + 3 * i % 4, 1 + 2 * i % 3);
        text += &format!(
            "[[joint]]\nkind = \"revolute\"\na = 0.{a}\nalpha = \"{sign}pi/2\"\nd = 0.{d}\ntheta = \"0\"\n"
        );
    }
    let path = folder.join(format!("chain{joints}.toml"));
    std::fs::write(&path, text).expect("OUT_DIR can be written to");
    path
}
