//! What a real arm's logs say; skipped where they are missing.

use crate::explain::{Explained, explain};
use crate::log::{common_clock, read_logs};
use crate::regression::{DataOptions, RigidBody};
use dyngen::Arm;
use std::path::PathBuf;

/// The folder of measured logs: `POWERBALL_DATA`, or `../shared/data` from the project's root.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("POWERBALL_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    if folder.join("ur10e/arm.toml").exists() {
        return Some(folder);
    }
    println!("skipped: no measured logs in {}", folder.display());
    None
}

fn ur10e(fit: &[&str], validate: &[&str]) -> Option<Explained> {
    let folder = data()?.join("ur10e");
    let arm = Arm::read(&folder.join("arm.toml")).unwrap();
    let files: Vec<PathBuf> =
        fit.iter().chain(validate).map(|name| folder.join(format!("fourier_{name}.csv"))).collect();
    let (mut logs, _) = read_logs(&files, &arm).unwrap();
    common_clock(&mut logs);
    let validate = logs.split_off(fit.len());
    let body = RigidBody::new(&arm).unwrap();
    Some(explain(&body, &logs, &validate, &DataOptions::default(), &|_| ()).unwrap())
}

fn joints<'e>(explained: &'e Explained, name: &str) -> &'e [usize] {
    explained.effects.iter().find(|e| e.effect == name).map_or(&[], |e| &e.joints)
}

#[test]
fn load_friction_of_the_ur10e_is_found_and_held_out_errors_fall() {
    let Some(explained) = ur10e(&["12a", "12b", "12c", "7", "8"], &["14", "5"]) else { return };
    let load = joints(&explained, "load_friction");
    assert!(load.contains(&2) && load.contains(&3), "{load:?}");
    assert!(joints(&explained, "payload").is_empty());
    let (before, after) = (&explained.before.validate.rms, &explained.after.validate.rms);
    assert!(after[1] < 0.65 * before[1] && after[2] < 0.75 * before[2], "{before:?} {after:?}");
    assert!(explained.false_positives.rate <= 0.01);
}

#[test]
fn the_load_of_the_ur10e_is_a_payload_on_either_side() {
    let sides: [(&[&str], &[&str]); 2] = [
        (&["12a", "12b", "12c", "14_load", "5", "8"], &["14", "7"]),
        (&["12a", "12b", "12c", "14", "7"], &["14_load", "5"]),
    ];
    for (fit, validate) in sides {
        let Some(explained) = ur10e(fit, validate) else { return };
        let payload = explained.effects.iter().find(|e| e.effect == "payload").unwrap();
        let mass = payload.parameters["mass"].as_f64().unwrap();
        assert!((mass - 2.8).abs() < 0.15 * 2.8, "{mass}");
        assert!(payload.logs.len() == 1 && payload.logs[0].contains("14_load"));
        assert!(joints(&explained, "load_friction").contains(&2));
    }
}
