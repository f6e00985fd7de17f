//! `powerball demo` and `powerball excite` as a user runs them.

#![allow(clippy::unwrap_used, clippy::panic)]

use powerball::commands::demo::{self, Session};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    let complaint = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {complaint}"))
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A place of this test run.
fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn arm(name: &str) -> String {
    format!("{}/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The demo of README.md, for the tests of this file: what it says, and its folder.
fn demo() -> (&'static Value, PathBuf) {
    static SAID: OnceLock<Value> = OnceLock::new();
    let folder = scratch("demo");
    let said = SAID.get_or_init(|| {
        let _ = std::fs::remove_dir_all(&folder);
        let run = powerball(&["demo", "--out", folder.to_str().unwrap(), "--json"]);
        assert!(run.status.success(), "{}", complaint(&run));
        json(&run)
    });
    (said, folder)
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn the_readme_shows_what_the_demo_prints() {
    let (result, _) = demo();
    let readme = std::fs::read_to_string(arm("../README.md")).unwrap();
    let (_, shown) = readme.split_once("joint   base model").unwrap();
    let (shown, moved) = shown.split_once("Tracking error").unwrap();
    let explained = &result["explained"];
    let [before, after] = ["before", "after"].map(|when| numbers(&explained[when]["validate"]["rms"]));
    let floor = numbers(&explained["noise_floor"]);
    let rows: Vec<Vec<&str>> = (shown.lines())
        .map(|line| line.split_whitespace().collect::<Vec<_>>())
        .filter(|cells| cells.first().is_some_and(|first| first.parse::<usize>().is_ok()))
        .collect();
    assert_eq!(rows.len(), 2);
    for cells in rows {
        let joint = cells[0].parse::<usize>().unwrap() - 1;
        for (cell, value) in [(1, before[joint]), (2, after[joint]), (5, floor[joint])] {
            // Another machine's rounding may be another one.
            assert!((cells[cell].parse::<f64>().unwrap() - value).abs() < 2e-4, "{cells:?}: {value}");
        }
    }
    let errors = &result["followed"]["tracking_error"];
    let (base, explained) = (numbers(&errors["base"]), numbers(&errors["explained"]));
    let (moved, _) = moved.split_once("```").unwrap();
    for joint in [1, 2] {
        let row =
            format!("{joint:>5}   {:>10.3}   {:>15.3}", 1e3 * base[joint - 1], 1e3 * explained[joint - 1]);
        assert!(moved.contains(&row), "{row} is not in {moved}");
    }
    let truth = result["verdict"]["truth"].as_str().unwrap();
    let joint = &result["verdict"]["joints"][0];
    assert!(shown.contains(&format!("named:         {truth} on joint {joint}\n")), "{}", result["verdict"]);
    assert!(shown.contains(result["verdict"]["figures"].as_str().unwrap()), "{}", result["verdict"]);
}

/// Other effects are taken from the demo's session to a controller in `round_trip.rs`.
#[test]
fn the_demo_finds_what_it_hid_and_writes_what_it_promises() {
    let (result, folder) = demo();
    let effect = result["verdict"]["truth"].as_str().unwrap();
    assert_eq!(result["verdict"]["judgement"], "right", "{}", result["verdict"]);
    let rms = |when: &str| numbers(&result["explained"][when]["validate"]["rms"]);
    let joint = result["verdict"]["joints"][0].as_u64().unwrap() as usize - 1;
    assert!(rms("after")[joint] < 0.5 * rms("before")[joint]);

    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    // The same arm off its path by less than half, with no joint worse than by 5 %.
    let errors = &result["followed"]["tracking_error"];
    let (base, explained) = (numbers(&errors["base"]), numbers(&errors["explained"]));
    let norm = |e: &[f64]| e.iter().map(|x| x * x).sum::<f64>();
    assert!(norm(&explained) < 0.25 * norm(&base) && norm(&base) > 0.0, "{errors}");
    assert!(explained.iter().zip(&base).all(|(explained, base)| *explained < 1.05 * base), "{errors}");

    // One figure a joint, the bars, what shows the effect, and one a joint of the arm that moves.
    assert_eq!(page.matches("<svg").count(), 14);
    assert!(page.contains(&format!("{effect} on joint {}", joint + 1)));
    assert!(page.len() < 2_000_000 && page.contains("The name is right."));
    for file in
        ["arm.toml", "base.json", "model.json", "path.csv", "explained.json", "fit_5.csv", "held_out_3.csv"]
    {
        assert!(folder.join(file).is_file(), "{file}");
    }
}

/// From logs that leave two names open to a decision, on the arm that the logs were made on and with nothing
/// but its files.
#[test]
fn an_experiment_decides_what_logs_leave_open() {
    let (folder, again) = (scratch("demo_experiment"), scratch("demo_experiment_again"));
    [&folder, &again].into_iter().for_each(|old| drop(std::fs::remove_dir_all(old)));
    let demo = folder.to_str().unwrap();
    let run = powerball(&["demo", "--effect", "asymmetry", "--seed", "3", "--out", demo, "--json"]);
    assert!(run.status.success(), "{}", complaint(&run));
    let first = json(&run);
    let next = &first["explained"]["next_experiment"];
    assert_eq!(next["to_tell_apart"], serde_json::json!(["asymmetry", "spring"]), "{next}");
    assert!(folder.join("virtual_arm.json").is_file());

    let file = |name: String| folder.join(name).to_str().unwrap().to_string();
    let logs: Vec<String> = (1..=5).map(|k| file(format!("fit_{k}.csv"))).collect();
    let held_out: Vec<String> = (1..=3).map(|k| file(format!("held_out_{k}.csv"))).collect();
    let arm = file("arm.toml".to_string());
    let mut arguments =
        vec!["explain", "--arm", &arm, "--experiment", "--out", again.to_str().unwrap(), "--log"];
    arguments.extend(logs.iter().map(String::as_str));
    arguments.push("--validate");
    arguments.extend(held_out.iter().map(String::as_str));
    let run = powerball(&arguments);
    assert!(run.status.success(), "{}", complaint(&run));
    let said = String::from_utf8(run.stdout).unwrap();
    assert!(said.lines().count() <= 25, "{said}");
    for what in [
        "joint        before ",
        "\nasymmetry on joint 1: ",
        " N·m constant; right in ",
        "decides for asymmetry",
        "\nreport: ",
    ] {
        assert!(said.contains(what), "'{what}' not in {said}");
    }
    let result: Value =
        serde_json::from_str(&std::fs::read_to_string(again.join("explained.json")).unwrap()).unwrap();
    assert_eq!(result["experiment"]["decided"], "asymmetry", "{}", result["experiment"]);
    assert_eq!(result["effects"][0]["effect"], "asymmetry");
    assert!(result["effects"][0]["margin"].as_f64().unwrap() > 1.1);
    // The trajectory is one that `record` takes, and its log is there.
    let lines = |name: &str| std::fs::read_to_string(again.join(name)).unwrap().lines().count();
    assert_eq!(lines("next_experiment.csv"), lines("experiment.csv"));
    let page = std::fs::read_to_string(again.join("report.html")).unwrap();
    assert!(page.contains("The experiment decides for asymmetry"));

    let refusal = powerball(&[
        "explain",
        "--arm",
        &arm,
        "--log",
        &logs[0],
        "--validate",
        &logs[1],
        "--out",
        demo,
        "--bus",
        "virtual",
    ]);
    assert_eq!(refusal.status.code(), Some(2));
    assert!(complaint(&refusal).contains("--experiment"));
}

#[test]
fn the_same_seed_gives_the_same_logs_and_another_one_others() {
    let log = |seed: u64, name: &str| {
        let folder = scratch(name);
        std::fs::create_dir_all(&folder).unwrap();
        let session = Session::record(&folder, seed, &demo::names()).unwrap();
        (session.effect, std::fs::read(&session.held_out[1]).unwrap())
    };
    let first = log(5, "session_a");
    assert!(first == log(5, "session_b"));
    // The demo's seed is another one.
    let (_, folder) = demo();
    assert!(first.1 != std::fs::read(folder.join("held_out_2.csv")).unwrap());
}

#[test]
fn an_effect_that_does_not_exist_is_wrong_use() {
    let folder = scratch("ghosts");
    let _ = std::fs::remove_dir_all(&folder);
    let run = powerball(&["demo", "--effect", "ghosts", "--out", folder.to_str().unwrap()]);
    assert_eq!(run.status.code(), Some(2));
    assert!(complaint(&run).contains("load_friction"), "{}", complaint(&run));
}

#[test]
fn an_exciting_path_keeps_the_limits_from_rest_to_rest() {
    let file = scratch("path.csv");
    let hardware = arm("lwa4p.toml");
    let run = powerball(&[
        "excite",
        "--arm",
        &hardware,
        "--out",
        file.to_str().unwrap(),
        "--evaluations",
        "200",
        "--json",
    ]);
    let result = json(&run);
    let condition = result["figures"]["condition"].as_f64().unwrap();
    assert!(condition < 0.7 * result["random_start"]["condition"].as_f64().unwrap());

    let mut csv = csv::Reader::from_path(&file).unwrap();
    let header: Vec<String> = csv.headers().unwrap().iter().map(String::from).collect();
    assert_eq!(header.len(), 19);
    assert_eq!((header[0].as_str(), header[1].as_str(), header[18].as_str()), ("t", "q1", "ddq6"));
    let rows: Vec<Vec<f64>> =
        csv.records().map(|row| row.unwrap().iter().map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), result["samples"].as_u64().unwrap() as usize);
    for row in [&rows[0], rows.last().unwrap()] {
        assert!(row[7..].iter().all(|x| x.abs() < 1e-9), "{row:?}");
    }
    for row in &rows {
        assert!(row[7..13].iter().all(|v| v.abs() < 1.257) && row[2].abs() < 1.92 && row[5].abs() < 2.443);
    }
}

/// A URDF gives torque limits and no accelerations: these follow from the masses that the import has written.
#[test]
fn an_imported_arm_is_excited_as_it_is() {
    let folder = scratch("imported");
    std::fs::create_dir_all(&folder).unwrap();
    let text = include_str!("../../dyngen/tests/urdf/lwa4p.urdf");
    let imported = dyngen::import::urdf(text, "lwa4p.urdf", &dyngen::import::Options::default()).unwrap();
    let file = folder.join("robot.toml");
    std::fs::write(&file, &imported.text).unwrap();
    std::fs::write(file.with_extension("values.json"), imported.values_json()).unwrap();
    let path = folder.join("path.csv");
    let run = |to: &std::path::Path| {
        powerball(&[
            "excite",
            "--arm",
            to.to_str().unwrap(),
            "--out",
            path.to_str().unwrap(),
            "--evaluations",
            "40",
            "--no-collision",
        ])
    };
    let done = run(&file);
    assert!(done.status.success(), "{}", complaint(&done));
    assert!(
        complaint(&done).contains("robot.values.json: the masses are taken from it"),
        "{}",
        complaint(&done)
    );
    std::fs::remove_file(file.with_extension("values.json")).unwrap();
    let without = run(&file);
    assert_eq!(without.status.code(), Some(1));
    assert!(complaint(&without).contains("`acceleration`"), "{}", complaint(&without));
}

#[test]
fn excite_says_what_is_missing() {
    let file = scratch("none.csv");
    let out = file.to_str().unwrap();
    let paper = powerball(&["excite", "--arm", &arm("arm.toml"), "--out", out]);
    assert_eq!(paper.status.code(), Some(1));
    assert!(
        complaint(&paper).contains("joint 1: `position`, `velocity`, `acceleration`"),
        "{}",
        complaint(&paper)
    );
    let nothing = powerball(&["excite", "--arm", &arm("lwa4p.toml"), "--out", out, "--harmonics", "0"]);
    assert_eq!(nothing.status.code(), Some(2));
    let nowhere = powerball(&["excite", "--arm", "no/such/arm.toml", "--out", out]);
    assert_eq!(nowhere.status.code(), Some(2));
    assert!(!file.exists());
}
