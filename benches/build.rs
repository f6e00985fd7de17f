//! Generates arms of one to nine joints, for `growth.rs`, and two arms with and without contraction, for
//! `contract.rs`.

use dyngen::{Config, Function};
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default());
    for joints in 1..=9 {
        let config =
            Config::new(chain(joints, &out)).functions([Function::InverseDynamics, Function::Regressor]);
        config.build(&format!("chain{joints}.rs")).unwrap_or_else(|e| e.exit());
    }
    // `contract.rs` runs them where the processor has fused multiply-adds.
    println!("cargo::rustc-cfg=dyngen_fma");
    for arm in ["ur5e", "panda"] {
        for (contract, name) in [(false, "plain"), (true, "contracted")] {
            let config = Config::new(format!("../tests/arms/{arm}.toml")).contract(contract).batch(true);
            let config = config.functions([Function::InverseDynamics]);
            config.build(&format!("{arm}_{name}.rs")).unwrap_or_else(|e| e.exit());
        }
    }
}

/// An arm file: revolute joints with twists of ±90° in turn, a length along and across every axis.
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
