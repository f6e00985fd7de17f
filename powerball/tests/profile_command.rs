//! `powerball profile`: files to a table, and what it says of files that are wrong.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test's helpers may stop the test")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("profile_command");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

fn profile(dcf: &Path, arm: &Path, out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command.arg("profile").arg("--dcf").arg(dcf).arg("--arm").arg(arm).arg("-o").arg(out);
    command.args(["--constant", "LWA4P", "--source"]);
    let committed = std::fs::read_to_string(here("src/bus/driver/lwa4p.rs")).unwrap();
    let source = committed.lines().find_map(|line| line.strip_prefix("//! Made from ")).unwrap();
    command.arg(source.trim_end_matches('.')).output().unwrap()
}

#[test]
fn what_is_wrong_is_told_with_its_line() {
    let out = scratch("never.rs");
    let (dcf, arm) = (scratch("broken.dcf"), here("lwa4p_bus.toml"));
    std::fs::write(&dcf, "[DeviceInfo]\nBaudRate_500=1\n[6040]\nDataType=six\n").unwrap();
    let output = profile(&dcf, &arm, &out);
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.contains("broken.dcf: line 4") && told.contains("six"), "{told}");

    std::fs::write(&dcf, "[DeviceInfo]\nBaudRate_500=1\n").unwrap();
    let told = String::from_utf8(profile(&dcf, &arm, &out).stderr).unwrap();
    assert!(told.contains("0x1016:1"), "{told}");

    // Of several files the one that is wrong is named.
    let overlay = scratch("overlay.dcf");
    std::fs::write(&overlay, "[1003Value]\n1=0\n").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command.arg("profile").arg("--dcf").arg(&dcf).arg("--overlay").arg(&overlay).arg("--arm").arg(&arm);
    let told = String::from_utf8(command.arg("-o").arg(&out).output().unwrap().stderr).unwrap();
    assert!(told.contains("overlay.dcf: line 2: [1003Value] lists 1"), "{told}");

    let output = profile(Path::new("not/there.dcf"), &arm, &out);
    assert_eq!(output.status.code(), Some(2));
    assert!(!out.exists());
}

#[test]
fn the_arms_table_is_made() {
    let dcf = std::env::var_os("POWERBALL_DCF")
        .map_or_else(|| here("../../shared/hardware/Schunk_0_63_lwa4p.dcf"), PathBuf::from);
    if !dcf.exists() {
        eprintln!("skipped: {} is not there; set POWERBALL_DCF to the drive's DCF", dcf.display());
        return;
    }
    let out = scratch("lwa4p.rs");
    let output = profile(&dcf, &here("lwa4p_bus.toml"), &out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let committed = std::fs::read_to_string(here("src/bus/driver/lwa4p.rs")).unwrap();
    assert!(std::fs::read_to_string(&out).unwrap() == committed);
}
