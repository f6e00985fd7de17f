//! Generates the arm that is run, and hands the linker its memory map.

use dyngen::Config;
use std::path::PathBuf;

fn main() {
    Config::new("../tests/arms/lwa4p_rotorless.toml").build("arm.rs").unwrap_or_else(|e| e.exit());
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default());
        std::fs::copy("memory.x", out.join("memory.x")).expect("OUT_DIR can be written to");
        println!("cargo::rustc-link-search={}", out.display());
    }
    println!("cargo::rerun-if-changed=memory.x");
}
