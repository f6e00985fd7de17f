//! The import against the drive's own file, where it is there, and against small ones that are wrong.

use super::*;
use std::path::{Path, PathBuf};

const TOML: &str = include_str!("../../../../lwa4p_bus.toml");
const SOURCE: &str =
    "Schunk_0_63.dcf (D. Osswald, SCHUNK, 2013; ipa320/schunk_robots) and powerball/lwa4p_bus.toml";

/// The DCF is not ours to copy; its place can be given by the environment.
fn dcf() -> Option<Vec<u8>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/hardware/Schunk_0_63_lwa4p.dcf");
    let path = std::env::var_os("POWERBALL_DCF").map_or(file, PathBuf::from);
    let read = std::fs::read(&path).ok();
    if read.is_none() {
        eprintln!("skipped: {} is not there; set POWERBALL_DCF to the drive's DCF", path.display());
    }
    read
}

/// With `POWERBALL_BLESS` set, the committed table is written anew.
#[test]
fn the_committed_table_is_what_the_sources_give() {
    let Some(dcf) = dcf() else { return };
    let made = rust_source(&dcf, &[], TOML, "LWA4P", SOURCE).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/driver/lwa4p.rs");
    if std::env::var_os("POWERBALL_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap();
    assert!(made == committed, "{} is stale; run this test with POWERBALL_BLESS=1", path.display());
}

#[test]
fn the_drives_file_is_read_whole() {
    let Some(bytes) = dcf() else { return };
    let dcf = Dcf::parse(&bytes).unwrap();
    // 3 mandatory, 60 optional and 29 objects of the vendor's.
    let mut indices: Vec<u16> = dcf.variables.keys().map(|object| object.index).collect();
    indices.dedup();
    assert_eq!(indices.len(), 92);
    let value = |index, sub, node| dcf.value(crate::canopen::Object::new(index, sub), node);
    assert_eq!(value(0x1014, 0, 5), Some(0x85));
    assert_eq!(value(0x1200, 1, 8), Some(0x608));
    // ParameterValue beats DefaultValue, and both know $NODEID in their spellings.
    assert_eq!(value(0x1400, 1, 3), Some(0x203));
    assert_eq!(value(0x1600, 2, 3), Some(0x6042_0010));
    assert_eq!(value(0x60C2, 2, 3), Some(-3));
    assert_eq!(value(0x6502, 0, 3), Some(0x43));
    assert_eq!(value(0x6071, 0, 3), None);
    assert_eq!(dcf.info["vendorname"], "SCHUNK GmbH & Co. KG");
}

const DRIVE: &str = "[DeviceInfo]\nBaudRate_500=1\n[1005]\nDataType=7\nAccessType=rw\n[1016sub1]\nDataType=7\n\
    AccessType=rw\n[1017]\nDataType=6\nAccessType=rw\n[200E]\nDataType=5\nAccessType=rw\n[6060]\nDataType=2\n\
    AccessType=rw\n[6040]\nDataType=6\nAccessType=rww\nPDOMapping=1\n\
    [6041]\nDataType=6\nAccessType=ro\nPDOMapping=0\n";

/// What the modes of the arm's file map next to it, and types that SCHUNK's drive has not.
const TARGETS: &str = "[607A]\nDataType=4\nPDOMapping=1\n[6042]\nDataType=3\nPDOMapping=1\n[60C1sub1]\nDataType=4\n\
    PDOMapping=1\n[6077]\nDataType=3\nPDOMapping=1\n[6064]\nDataType=4\nPDOMapping=1\n[606C]\nDataType=4\n\
    PDOMapping=1\n[6061]\nDataType=2\nPDOMapping=1\n[6041]\nDataType=6\nPDOMapping=1\n[2100]\nDataType=0x1B\n\
    DefaultValue=0xFFFFFFFFFFFFFFFF\n[2101]\nDataType=0x11\nDefaultValue=1.5\n[1021]\nObjectType=2\n";

fn refused(toml: &str) -> String {
    rust_source(DRIVE.as_bytes(), &[], toml, "ARM", "a test").unwrap_err().to_string()
}

#[test]
fn contradictions_are_reported() {
    assert!(refused(&TOML.replace("bitrate = 500_000", "bitrate = 800_000")).contains("800000"));
    assert!(refused(&TOML.replace("node = 4", "node = 3")).contains("same node id"));
    assert!(refused(&TOML.replace("rate = 200 ", "rate = 300 ")).contains("divisor"));
    assert!(refused(&TOML.replace("\"60C1:1\"", "\"60C1:x\"")).contains("60C1:x"));
    // Line and column come from the TOML parser.
    assert!(refused(&TOML.replace("master = 1", "master = \"one\"")).contains("line"));
    assert!(refused(TOML).contains("0x607A:0"), "an object that the drive lacks");
    let made = |drive: &str, toml: &str| rust_source(drive.as_bytes(), &[], toml, "ARM", "a test");
    let elsewhere = format!("{DRIVE}[DeviceCommissioning]\nBaudrate=125\n");
    assert!(made(&elsewhere, TOML).unwrap_err().to_string().contains("125000 bit/s"));
    let overlay = rust_source(DRIVE.as_bytes(), &[vec![], b"[1000\n".to_vec()], TOML, "ARM", "a test");
    assert!(matches!(overlay, Err(ImportError::Overlay(1, DcfError { line: 1, .. }))), "{overlay:?}");
}

/// What the drive lacks is not asked for: a mode that 0x6502 does not offer, and its scale.
#[test]
fn modes_that_the_drive_lacks_are_left_out() {
    let other = DRIVE.replace("[200E]", "[2FFF]") + &TARGETS.replace("[6042]", "[2042]");
    let toml = TOML.replace("sync_timeout_factor", "# sync_timeout_factor");
    let made = |drive: &str, toml: &str| rust_source(drive.as_bytes(), &[], toml, "ARM", "a test");
    assert!(made(&other, &toml).unwrap_err().to_string().contains("0x6042:0"));
    let modes = |offered: &str| format!("{other}[6502]\nDataType=7\nDefaultValue={offered}\n");
    let without = made(&modes("0x41"), &toml).unwrap();
    assert!(without.contains("    velocity: None,\n"), "{without}");
    assert!(without.contains("    profile_position: Some(ModeProfile {\n"));
    // Offered and not there is a contradiction.
    assert!(made(&modes("0x43"), &toml).unwrap_err().to_string().contains("0x6042:0"));

    // The TOML need not speak of it either, nor of its scale.
    let (before, after) = toml.split_once("[mode.velocity]").unwrap();
    let (_, rest) = after.split_once("[mode.interpolated_position]").unwrap();
    let (rest, joints) = rest.split_once("[velocity_scale]").unwrap();
    let (_, joints) = joints.split_once("[[joint]]").unwrap();
    let lean = format!("{before}[mode.interpolated_position]{rest}[[joint]]{joints}");
    let without = made(&modes("0x41"), &lean).unwrap();
    assert!(without.contains("    velocity: None,\n") && without.contains("denominator: 1,\n"), "{without}");
    let unknown = made(&other, &lean.replace("interpolated", "spline")).unwrap_err().to_string();
    assert!(unknown.contains("[mode.spline_position] is not a mode"), "{unknown}");
    let (before, _) = toml.split_once("[mode.profile_position]").unwrap();
    let none = format!("{before}[mode]\n[[joint]]{joints}");
    assert!(made(&other, &none).unwrap_err().to_string().contains("no mode"));
    let unscaled = format!("{before}[mode.velocity]{}[[joint]]{joints}", velocity_mode(&toml));
    assert!(
        made(&modes("0x43").replace("[2042]", "[6042]"), &unscaled)
            .unwrap_err()
            .to_string()
            .contains("[velocity_scale]")
    );
}

/// The TOML's lines of the velocity mode.
fn velocity_mode(toml: &str) -> &str {
    let (_, after) = toml.split_once("[mode.velocity]").unwrap();
    after.split_once("[mode.interpolated_position]").unwrap().0
}

/// The maker's number in the drive's file is expected of the drives; the TOML's goes over it.
#[test]
fn the_vendor_of_the_drives_file_is_expected() {
    let other = DRIVE.replace("[DeviceInfo]", "[DeviceInfo]\nVendorNumber=0x9A") + TARGETS;
    let made = |toml: &str| rust_source(other.as_bytes(), &[], toml, "ARM", "a test").unwrap();
    assert!(made(&TOML.replace("vendor = 0x15E\n", "")).contains("vendor: Some(0x0000009A)"));
    assert!(made(TOML).contains("vendor: Some(0x0000015E)"));
}

/// 0x200E is SCHUNK's: of a drive of another maker neither the DCF nor the driver is asked for it.
#[test]
fn drives_of_other_makers_need_no_object_of_schunks() {
    let without = TOML.replace("sync_timeout_factor", "# sync_timeout_factor");
    let other = DRIVE.replace("[200E]", "[2FFF]") + TARGETS;
    let made = |drive: &str, toml: &str| rust_source(drive.as_bytes(), &[], toml, "ARM", "a test");
    assert!(made(&other, &without).unwrap().contains("    sync_timeout_factor: None,\n"));
    assert!(made(&other, TOML).unwrap_err().to_string().contains("0x200E:0"));
    let schunk = other.replace("[DeviceInfo]", "[DeviceInfo]\nVendorName=SCHUNK GmbH");
    assert!(made(&schunk, &without).unwrap_err().to_string().contains("sync_timeout_factor"));
}
