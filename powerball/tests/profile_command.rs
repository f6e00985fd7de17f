//! `powerball profile`: files to a table, and what it reports about files that are wrong.

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
    let committed = std::fs::read_to_string(here("bus/src/driver/lwa4p.rs")).unwrap();
    let source = committed.lines().find_map(|line| line.strip_prefix("//! Made from ")).unwrap();
    command.arg(source.trim_end_matches('.')).output().unwrap()
}

/// As little of a drive as a profile needs, of no maker.
const DRIVE: &str = "[DeviceInfo]\nBaudRate_500=1\n[1005]\nDataType=7\nAccessType=rw\n[1016sub1]\nDataType=7\n\
    AccessType=rw\n[1017]\nDataType=6\nAccessType=rw\n[6060]\nDataType=2\nAccessType=rw\n[6061]\nDataType=2\n\
    PDOMapping=1\n[6040]\nDataType=6\nPDOMapping=1\n[6041]\nDataType=6\nPDOMapping=1\n[6064]\nDataType=4\n\
    PDOMapping=1\n[606C]\nDataType=4\nPDOMapping=1\n[6077]\nDataType=3\nPDOMapping=1\n[60C1sub1]\nDataType=4\n\
    PDOMapping=1\n[6502]\nDataType=7\nDefaultValue=0x40\n";

/// A drive of another maker counts as its file says, and never as SCHUNK's does.
#[test]
fn the_scale_is_taken_from_the_drives_file() {
    let (dcf, toml, out) = (scratch("other.eds"), scratch("other.toml"), scratch("other.rs"));
    let arm = std::fs::read_to_string(here("lwa4p_bus.toml")).unwrap();
    let other = arm.replace("sync_timeout_factor", "# ").replace("counts_per_degree", "# ");
    std::fs::write(&toml, &other).unwrap();
    std::fs::write(&dcf, DRIVE).unwrap();
    let output = profile(&dcf, &toml, &out);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.code() == Some(2) && message.contains("other.toml: node 3: counts_per_degree"),
        "{message}"
    );

    let encoder = "[608Fsub1]\nDataType=7\nDefaultValue=2000\n[608Fsub2]\nDataType=7\nDefaultValue=1\n";
    std::fs::write(&dcf, format!("{DRIVE}{encoder}")).unwrap();
    let output = profile(&dcf, &toml, &out);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && message.contains("2000 counts a turn"), "{message}");
    assert!(message.contains("[mode.velocity] is left out"), "{message}");
    let made = std::fs::read_to_string(&out).unwrap();
    assert!(made.contains("counts_per_radian: 0.005555555555555556 * MILLIDEGREES_PER_RADIAN"), "{made}");

    std::fs::write(&toml, arm.replace("sync_timeout_factor", "# ")).unwrap();
    let output = profile(&dcf, &toml, &out);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success() && message.contains("360000 counts a turn, the drive's file says 2000"),
        "{message}"
    );
}

#[test]
fn what_is_wrong_is_reported_with_its_line() {
    let out = scratch("never.rs");
    let (dcf, arm) = (scratch("broken.dcf"), here("lwa4p_bus.toml"));
    std::fs::write(&dcf, "[DeviceInfo]\nBaudRate_500=1\n[6040]\nDataType=six\n").unwrap();
    let output = profile(&dcf, &arm, &out);
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("broken.dcf: line 4") && message.contains("six"), "{message}");

    std::fs::write(&dcf, "[DeviceInfo]\nBaudRate_500=1\n").unwrap();
    let message = String::from_utf8(profile(&dcf, &arm, &out).stderr).unwrap();
    assert!(message.contains("broken.dcf: no writable 0x1016:1"), "{message}");
    // What is wrong in the arm's file is not the drive's.
    let toml = scratch("wrong.toml");
    let committed = std::fs::read_to_string(&arm).unwrap().replace("sync_timeout_factor", "# ");
    std::fs::write(&toml, committed.replace("node = 4", "node = 3")).unwrap();
    std::fs::write(&dcf, DRIVE).unwrap();
    let message = String::from_utf8(profile(&dcf, &toml, &out).stderr).unwrap();
    assert!(message.contains("wrong.toml: two joints"), "{message}");
    // Where they contradict each other, both are named.
    std::fs::write(&toml, committed.replace("500_000", "800_000")).unwrap();
    let message = String::from_utf8(profile(&dcf, &toml, &out).stderr).unwrap();
    assert!(message.contains("broken.dcf and wrong.toml: the DCF does not offer 800000"), "{message}");
    let wide: Vec<u8> = "\u{feff}name".encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(&toml, wide).unwrap();
    let message = String::from_utf8(profile(&dcf, &toml, &out).stderr).unwrap();
    assert!(message.contains("wrong.toml: is UTF-16"), "{message}");

    // Of several files the one that is wrong is named.
    let overlay = scratch("overlay.dcf");
    std::fs::write(&overlay, "[1003Value]\n1=0\n").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command.arg("profile").arg("--dcf").arg(&dcf).arg("--overlay").arg(&overlay).arg("--arm").arg(&arm);
    let message = String::from_utf8(command.arg("-o").arg(&out).output().unwrap().stderr).unwrap();
    assert!(message.contains("overlay.dcf: line 2: [1003Value] lists 1"), "{message}");

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
    let committed = std::fs::read_to_string(here("bus/src/driver/lwa4p.rs")).unwrap();
    assert!(std::fs::read_to_string(&out).unwrap() == committed);
}
