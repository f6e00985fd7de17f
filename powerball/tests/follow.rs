//! `powerball follow` and `float` on the virtual arm as a user runs them.

#![allow(clippy::unwrap_used, clippy::panic)]

mod true_model;

use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::process::{Command, Output};
use true_model::true_model;

const ARM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/lwa4p.toml");

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn printed(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", complaint(output)))
}

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("follow").join(name)
}

/// A folder without what an earlier test left in it: a log of a run that was stopped is not replaced.
fn fresh(name: &str) -> PathBuf {
    let _ = std::fs::remove_dir_all(file(name));
    file(name)
}

fn write(name: &str, text: &str) -> String {
    std::fs::create_dir_all(file("")).unwrap();
    std::fs::write(file(name), text).unwrap();
    file(name).to_str().unwrap().to_string()
}

/// The virtual arm's true values, with a spring at joint 1 of the plant's strength.
fn model() -> Value {
    let terms = json!([
        {"effect": "spring", "joint": 1, "law": "position", "coefficient": 5.0},
        {"effect": "spring", "joint": 1, "law": "constant", "coefficient": 1.0},
    ]);
    true_model(1.0, terms)
}

const PLANT: &str = r#"{"effect": {"spring": {"joint": 0, "stiffness": 5.0, "rest": -0.2}}, "age": 0.0}"#;

/// From rest to rest in `seconds`.
fn path(name: &str, seconds: f64) -> String {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for k in 0..=(200.0 * seconds) as u32 {
        let t = 0.005 * f64::from(k);
        let q = 0.3 * (1.0 - (TAU * t / seconds).cos());
        text += &format!("{t:.6},{q},{q},{},{q},{q},{q}\n", -q);
    }
    write(name, &text)
}

#[test]
fn the_explained_model_follows_better_than_the_base_model() {
    let (model, plant) = (write("model.json", &model().to_string()), write("plant.json", PLANT));
    let (path, out) = (path("path.csv", 4.0), fresh("out"));
    let run = powerball(&[
        "follow",
        "--trajectory",
        &path,
        "--arm",
        ARM,
        "--floor",
        "none",
        "--model",
        &model,
        "--plant",
        &plant,
        "--with",
        "torque",
        "--compare",
        "base",
        "--out",
        out.to_str().unwrap(),
        "--json",
    ]);
    let result = printed(&run);
    let error = |name: &str| result["tracking_error"][name][0].as_f64().unwrap_or_else(|| panic!("{result}"));
    assert!(error("explained") < 0.5 * error("base"), "{result}");
    assert!(result["torque"]["explained"]["effects"][0].as_f64().unwrap() > 1.0, "{result}");
    assert!(result["largest_pole"].as_f64().unwrap() < 0.95);
    // Both runs in one log, which is one.
    let log = std::fs::read_to_string(out.join("log.csv")).unwrap();
    assert!(log.lines().count() > 2 * 800 && whole(&log), "{} lines", log.lines().count());
    // At 200 Hz a held torque stands for half a cycle before it is reported, less a tick of the drives.
    assert!(log.lines().skip(1).all(|line| line.ends_with(",0.002000")));
    let read = powerball(&["log", out.join("log.csv").to_str().unwrap()]);
    assert_eq!(read.status.code(), Some(0), "{}", complaint(&read));
    assert_eq!(result["plant"].as_str(), Some(plant.as_str()));
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Tracking error") && page.contains("of the error with the base model"));
}

/// A torque that is held for a cycle is reported at its end. The log says how late that is: at that time the
/// arm's own equations fit better than at the one of the report, or as much on the other side of it.
#[test]
fn a_log_of_current_mode_knows_how_late_its_torques_are() {
    let model = write("clean.json", &true_model(1.0, json!([])).to_string());
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for k in 0..=2400 {
        let t = 0.005 * f64::from(k);
        let q = [5.0, 6.0, 7.0, 8.0, 9.0, 7.0].map(|turns| 0.15 * (1.0 - (TAU * turns * t / 12.0).cos()));
        text += &format!("{t:.6},{}\n", q.map(|q| q.to_string()).join(","));
    }
    let (path, out, result) = (write("late.csv", &text), fresh("late"), fresh("late_fit"));
    let [log, out, result] = [out.join("log.csv"), out, result].map(|p| p.to_str().unwrap().to_string());
    let follow = ["follow", "--arm", ARM, "--floor", "none", "--model", &model, "--trajectory", &path];
    let run = powerball(&[&follow[..], &["--with", "torque", "--out", &out]].concat());
    assert_eq!(run.status.code(), Some(0), "{}", complaint(&run));
    let error = |map: &[&str]| -> f64 {
        let identify = ["identify", "--arm", ARM, "--log", &log, "--out", &result, "--accept", "--json"];
        let fit = printed(&powerball(&[&identify[..], map].concat()));
        let rms = fit["fit"]["rms"].as_array().unwrap_or_else(|| panic!("{fit}"));
        rms[..4].iter().map(|rms| rms.as_f64().unwrap()).sum()
    };
    let [at_its_time, as_reported, too_early] =
        [error(&[]), error(&["--map", "tau.shift = 0"]), error(&["--map", "tau.shift = -0.004"])];
    assert!(at_its_time < 0.98 * as_reported.min(too_early), "{at_its_time} {as_reported} {too_early}");
}

/// Whether every line of a log has as many cells as its first one, and ends.
fn whole(log: &str) -> bool {
    let cells = |line: &str| line.split(',').count();
    let all = log.lines().next().map_or(0, cells);
    log.ends_with('\n') && all == 41 && log.lines().all(|line| cells(line) == all)
}

/// Somebody leans on the wrist: the driver stops the arm, the cause names the joint, and the log is there.
#[test]
fn a_run_that_is_stopped_keeps_its_log() {
    let mut model = model();
    model["terms"] = json!([]);
    let model = write("pushed.json", &model.to_string());
    let push = r#"{"effect": {"contact_wrench": {"force": [0.0, 60.0, -60.0], "start": 0.0, "length": 1.0, "every": 2.0}}, "age": 0.0}"#;
    let (plant, path) = (write("push_plant.json", push), path("pushed.csv", 4.0));
    for with in ["torque", "impedance"] {
        let out = fresh(&format!("pushed_{with}"));
        let arguments = [
            "follow",
            "--trajectory",
            &path,
            "--arm",
            ARM,
            "--floor",
            "none",
            "--model",
            &model,
            "--plant",
            &plant,
            "--with",
            with,
            "--out",
            out.to_str().unwrap(),
        ];
        let run = powerball(&arguments);
        let complaint = complaint(&run);
        assert_eq!(run.status.code(), Some(1), "{complaint}");
        assert!(
            complaint.contains("the arm was stopped: node") && complaint.contains("joint "),
            "{complaint}"
        );
        let log = std::fs::read_to_string(out.join("log.csv")).unwrap();
        assert!(log.lines().count() > 1 && whole(&log), "{log}");
        // Its folder is its own: the next run needs no --force. A recording of the same form is another's.
        assert_eq!(powerball(&arguments).status.code(), Some(1));
        std::fs::remove_file(out.join("report.html")).unwrap();
        let refused = powerball(&arguments);
        assert_eq!(refused.status.code(), Some(2), "{}", self::complaint(&refused));
        assert_eq!(std::fs::read_to_string(out.join("log.csv")).unwrap(), log);
    }
    let refused =
        powerball(&["follow", "--trajectory", &path, "--model", &model, "--give", "0.6", "--out", "x"]);
    assert_eq!(refused.status.code(), Some(2), "{}", complaint(&refused));
}

/// As with `explain --experiment`: the plant next to the arm file moves, and it is reported which one does.
#[test]
fn the_plant_next_to_the_arm_file_moves() {
    let text = std::fs::read_to_string(ARM).unwrap();
    let model = write("plant_model.json", &model().to_string());
    for folder in ["lone", "session"] {
        std::fs::create_dir_all(file(folder)).unwrap();
    }
    let (lone, arm) = (write("lone/arm.toml", &text), write("session/arm.toml", &text));
    let plant = write("session/virtual_arm.json", PLANT);
    for (arm, expected) in [(lone, "built-in"), (arm, plant.as_str())] {
        let run = powerball(&[
            "float", "--arm", &arm, "--model", &model, "--floor", "none", "--for", "0.1", "--json",
        ]);
        assert_eq!(printed(&run)["plant"], expected);
        assert!(complaint(&run).contains(expected), "{}", complaint(&run));
    }
}

#[test]
fn a_guided_arm_is_light_and_stays_where_it_is_left() {
    let (model, plant) = (write("float.json", &model().to_string()), write("float_plant.json", PLANT));
    let push = path("push.csv", 4.0);
    let arguments = [
        "float", "--arm", ARM, "--model", &model, "--plant", &plant, "--push", &push, "--for", "14", "--json",
    ];
    let result = printed(&powerball(&arguments));
    let list = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (hand, friction) = (list(&result["hand"]["rms"]), list(&result["hand"]["friction_rms"]));
    for j in 0..6 {
        assert!(hand[j] < 0.4 * friction[j], "joint {}: {result}", j + 1);
    }
    assert!(list(&result["drift"]).iter().all(|drift| *drift < 2e-3), "{result}");
    // Without what is taken off, the hand carries the friction.
    let result = printed(&powerball(&[&arguments[..], &["--friction", "0"]].concat()));
    assert!(result["hand"]["rms"][0].as_f64().unwrap() > 0.8 * friction[0], "{result}");
}

/// Each is refused before anything moves: nothing is written.
#[test]
fn what_cannot_work_is_refused_before_the_arm_moves() {
    let good = write("good.json", &model().to_string());
    let mut other = model();
    other["arm"] = "another".into();
    let other = write("other.json", &other.to_string());
    let mut fewer = model();
    fewer["friction"].as_array_mut().unwrap().pop();
    let fewer = write("fewer.json", &fewer.to_string());
    let mut lighter = model();
    lighter["parameters"].as_array_mut().unwrap().iter_mut().for_each(|p| p["value"] = json!(-1.0));
    let lighter = write("lighter.json", &lighter.to_string());
    let two = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/arms/planar2r.toml");
    let mut nameless = model();
    nameless["arm"] = "".into();
    let nameless = write("nameless.json", &nameless.to_string());
    let (path, fast) = (path("refused.csv", 4.0), path("fast.csv", 0.5));
    let empty = write("empty.csv", "t,q1\n0,0\n");
    for (extra, code, why) in [
        (&["--model", &other][..], 2, "is a model of the arm 'another'"),
        (&["--model", &fewer], 2, "no friction for joint 6"),
        (&["--model", "no.json"], 2, "no.json"),
        (&["--model", &lighter, "--values", &good, "--with", "torque"], 2, "not positive definite"),
        (&["--model", &good, "--with", "torque", "--bandwidth", "-3"], 2, "above 0"),
        (&["--model", &good, "--with", "torque", "--damping", "-1"], 2, "above 0"),
        (&["--model", &good, "--with", "torque", "--bandwidth", "150"], 2, "not stable at 200 Hz"),
        (&["--model", &good, "--with", "impedance", "--bandwidth", "120"], 2, "not stable at 200 Hz"),
        (&["--model", &good, "--trajectory", &fast], 2, "rad/s"),
        (&["--model", &good, "--trajectory", &empty], 2, "q1 to q6"),
        (&["--model", &good, "--compare", "base", "--compare", "base"], 2, "twice"),
        (&["--model", &good, "--compare", "no.json"], 2, "no.json"),
        (&["--model", &good, "--with", "magic"], 2, "feedforward"),
        (&["--model", &good, "--plant", "x", "--bus", "udp:239.74.163.2:43191"], 2, "--plant"),
    ] {
        let out = file("refused");
        let mut arguments = vec!["follow", "--floor", "none", "--out", out.to_str().unwrap()];
        if !extra.contains(&"--trajectory") {
            arguments.extend(["--trajectory", &path]);
        }
        arguments.extend(["--arm", ARM]);
        let run = powerball(&[&arguments[..], extra].concat());
        assert_eq!(run.status.code(), Some(code), "{extra:?}: {}", complaint(&run));
        assert!(complaint(&run).contains(why), "{extra:?}: {}", complaint(&run));
        assert!(!out.exists(), "{extra:?}");
    }
    for (extra, why) in [
        (&["--model", &good, "--friction", "1.2"][..], "0.95"),
        (&["--model", &good, "--for", "0"], "--for"),
        (&["--model", &good, "--push", &empty], "q1 to q6"),
        (&["--model", &good, "--push", &path, "--bus", "udp:239.74.163.2:43191"], "--push"),
        (&["--model", &nameless, "--arm", two], "has 2 joints, the arm on the bus 6"),
    ] {
        let arm: &[&str] = if extra.contains(&"--arm") { &[] } else { &["--arm", ARM] };
        let run = powerball(&[&["float"], arm, extra].concat());
        assert_eq!(run.status.code(), Some(2), "{extra:?}: {}", complaint(&run));
        assert!(complaint(&run).contains(why), "{extra:?}: {}", complaint(&run));
    }
    for command in ["follow", "float"] {
        let help = powerball(&[command, "--help"]);
        let help = String::from_utf8_lossy(&help.stdout).into_owned();
        assert!(help.contains("Example") && help.contains("ever run on hardware"), "{command}");
    }
}
