//! Excite, record, identify, explain, generate: the controller's torque is the report's.

use crate::generated::{controller, run};
use powerball::commands::demo::Session;
use powerball::explanation::{ExplainOptions, Explained, explain_body};
use powerball::logs::log::{Log, common_clock, read_logs};
use powerball::logs::regression::{Data, DataOptions, RigidArm};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("round_trip").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn powerball(arguments: &[&str]) -> Output {
    let done = Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap();
    assert!(done.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&done.stderr));
    done
}

/// The program of `examples/cpp-controller` with this model; none where there is no C++ compiler.
fn called_from_cpp(arm: &str, model: &str) -> Option<PathBuf> {
    let compiler = std::env::var("CXX").unwrap_or("c++".to_string());
    if Command::new(compiler).arg("--version").output().is_err() {
        println!("skipped: there is no C++ compiler");
        return None;
    }
    let check = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/cpp-controller/check");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cpp-controller");
    let done = Command::new(check)
        .args([arm, model])
        .env("POWERBALL", env!("CARGO_BIN_EXE_powerball"))
        .env("CARGO_TARGET_DIR", &target)
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    Some(target.join("cpp-controller"))
}

/// The held-out logs as the report sees them, through the controller: the largest difference by joint over
/// the joint's torque.
fn disagreement(program: &Path, data: &Data<'_>, explained: &Explained) -> Vec<f64> {
    let n = data.dof();
    let mut input = String::new();
    for recording in data.recordings.iter() {
        for k in 0..recording.len() {
            for signal in [&recording.q, &recording.v, &recording.a] {
                signal[k * n..(k + 1) * n].iter().for_each(|x| write!(input, "{x:?},").unwrap());
            }
            writeln!(input, "{:?}", recording.clock + k as f64 / recording.rate).unwrap();
        }
        input.push('\n');
    }
    let mut torques = run(program, input).into_iter();
    let signals: Vec<Vec<f64>> =
        data.recordings.iter().map(|r| torques.by_ref().take(r.len()).flatten().collect()).collect();
    let said = data.column_over_all(&signals);
    (0..n)
        .map(|j| {
            let curve = &explained.curves[j];
            let said = said.at(j).unwrap();
            assert_eq!(said.len(), curve.measured.len());
            let top = curve.measured.iter().fold(0.0f64, |m, t| m.max(t.abs()));
            let differences = said.iter().zip(&curve.measured).zip(&curve.after);
            differences.map(|((s, m), a)| (s - (m - a)).abs()).fold(0.0, f64::max) / top
        })
        .collect()
}

fn json_of(file: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap()
}

/// A number of every term that has it.
fn numbers(model: &serde_json::Value, key: &str) -> Vec<f64> {
    model["terms"].as_array().unwrap().iter().filter_map(|t| t[key].as_f64()).collect()
}

fn text(files: &[PathBuf]) -> Vec<&str> {
    files.iter().map(|f| f.to_str().unwrap()).collect()
}

#[test]
fn the_controllers_torque_is_the_reports() {
    of_the_controller_and_the_report(&[("hysteresis", 1)]);
}

#[test]
#[ignore = "at length: minutes; the one above guards it"]
fn the_controllers_torque_is_the_reports_at_length() {
    of_the_controller_and_the_report(&[("load_friction", 3), ("position_ripple", 2)]);
}

fn of_the_controller_and_the_report(cases: &[(&str, u64)]) {
    for &(effect, seed) in cases {
        let folder = scratch(effect);
        let session = Session::record(&folder, seed, &[effect]).unwrap();
        let arm = dyngen::Arm::read(&session.arm_file).unwrap();
        let body = RigidArm::new(&arm).unwrap();
        let files: Vec<&PathBuf> = session.fit.iter().chain(&session.held_out).collect();
        let mut fit: Vec<Log> = read_logs(&files, &arm).unwrap().0;
        common_clock(&mut fit);
        let held_out = fit.split_off(session.fit.len());
        let options = DataOptions::default();
        let explained = explain_body(&body, &fit, &held_out, &ExplainOptions::default()).unwrap();
        assert!(
            explained.model.additions.terms.iter().any(|t| t.effect == effect),
            "{:?}",
            explained.effects
        );

        let model = folder.join("model.json");
        std::fs::write(&model, serde_json::to_string(&explained.model).unwrap()).unwrap();
        let (arm_file, model) = (session.arm_file.to_str().unwrap(), model.to_str().unwrap());
        let source = folder.join("controller.rs");
        // With functions for C as well, so that they are held to the same lints.
        let header = folder.join("controller.h");
        let (to, header) = (source.to_str().unwrap(), header.to_str().unwrap());
        powerball(&["generate", "--arm", arm_file, "--model", model, "-o", to, "--c-header", header]);
        let program = controller(&folder);
        let data = Data::new(&body, &held_out, &options).unwrap();
        for (j, difference) in disagreement(&program, &data, &explained).into_iter().enumerate() {
            assert!(difference < 1e-9, "{effect}, joint {}: {difference:e}", j + 1);
        }
        // A law with a state, called from C++.
        if effect == "hysteresis"
            && let Some(program) = called_from_cpp(arm_file, model)
        {
            for (j, difference) in disagreement(&program, &data, &explained).into_iter().enumerate() {
                assert!(difference < 1e-9, "C++, joint {}: {difference:e}", j + 1);
            }
        }

        // The judge of models agrees with the report, and a model without the effect does worse.
        let out = folder.to_str().unwrap();
        let held = text(&session.held_out);
        let verdict = |model: &str| -> Vec<f64> {
            let rest = ["--model", model, "--out", out, "--tolerance", "10", "--json"];
            let done = powerball(&[&["verify", "--arm", arm_file, "--log"], &held[..], &rest].concat());
            let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
            json["joints"].as_array().unwrap().iter().map(|j| j["rms"].as_f64().unwrap()).collect()
        };
        let rms = verdict(model);
        for (rms, said) in rms.iter().zip(&explained.after.validate.rms) {
            assert!((rms - said).abs() < 1e-9 * said, "{effect}: {rms} {said}");
        }

        // The next identification begins with the model: as good from the start, and the effect is not found
        // again.
        let logs = text(&session.fit);
        let known = ["--model", model, "--out", out, "--json"];
        let done = powerball(
            &[&["identify", "--arm", arm_file, "--log"], &logs[..], &["--validate"], &held, &known].concat(),
        );
        let identified: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        assert_eq!(identified["terms"][0]["effect"], effect);
        for (j, said) in explained.after.validate.rms.iter().enumerate() {
            let rms = identified["validate"]["rms"][j].as_f64().unwrap();
            assert!(rms < 1.02 * said, "{effect}, joint {}: {rms} {said}", j + 1);
        }
        let identified = folder.join("identified.json");
        for (rms, said) in verdict(identified.to_str().unwrap()).iter().zip(&rms) {
            assert!(*rms < 1.02 * said, "{effect}: {rms} {said}");
        }
        let done = powerball(
            &[&["explain", "--arm", arm_file, "--log"], &logs[..], &["--validate"], &held, &known].concat(),
        );
        let again: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        // Another ripple may be found once the first one is known: its harmonic.
        let orders: Vec<f64> = numbers(&json_of(&identified), "order");
        for found in again["effects"].as_array().unwrap() {
            let other = found["parameters"]["orders"].as_array().is_some_and(|list| {
                list.iter().all(|o| orders.iter().all(|known| (o.as_f64().unwrap() - known).abs() > 1.0))
            });
            assert!(found["effect"] != effect || other, "{effect} again: {found}");
        }
    }
}
