//! Logs of real arms, where they are at hand.

use super::logs_of_arms::measured;
use crate::ExplainOptions;
use crate::explain::explain_body;
use dyngen::Arm;
use powerball_logs::log::{common_clock, read_logs};
use powerball_logs::regression::RigidArm;
use std::path::PathBuf;

/// Thirteen seconds of a Rokae xMate: an elasticity of joint 2, which no fit by hand supports, made the error
/// of joint 6 on the third part three times as large.
#[test]
fn what_one_joint_gains_others_do_not_lose() {
    let Some(folder) = measured("rokae") else { return };
    let arm = Arm::read(&folder.join("arm.toml")).unwrap();
    let files: Vec<PathBuf> = (1..=3).map(|k| folder.join(format!("part_{k}.csv"))).collect();
    let (mut logs, _) = read_logs(&files, &arm).unwrap();
    common_clock(&mut logs);
    let body = RigidArm::new(&arm).unwrap();
    let explained = explain_body(&body, &logs[..2], &logs[2..], &ExplainOptions::default()).unwrap();
    let [before, after] = [&explained.before, &explained.after].map(|errors| &errors.validate.rms);
    let ratios: Vec<f64> = after.iter().zip(before).map(|(after, before)| after / before).collect();
    assert!(ratios.iter().all(|ratio| *ratio < 1.1), "{ratios:?}");
    let names: Vec<&str> = explained.effects.iter().map(|e| e.effect.as_str()).collect();
    assert!(!names.contains(&"joint_elasticity"), "{names:?}");
}
