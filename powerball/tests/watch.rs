//! `powerball watch` on a small arm: what changes in the middle of a log is one event, and what cannot be
//! watched is reported before anything is computed.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::chain::Chain;
use powerball::identification::excite::{Fourier, Harmonics};
use powerball::virtual_arm::{Body, Dynamics, Plant, PlantEffect, Sensors};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const RATE: f64 = 100.0;
/// When the change is, s.
const AT: f64 = 30.0;

const ARM: &str = "name = \"two\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n\
    [[joint]]\nkind = \"revolute\"\na = 0.4\nalpha = 0\nd = 0\ntheta = 0\n\
    [[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("watch").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("arm.toml"), ARM).unwrap();
    folder
}

fn plant() -> Plant {
    let arm = Arm::parse(ARM, "two.toml").unwrap();
    let link = |mass| Body::even_box(mass, [-0.15, 0.01, 0.0], [0.3, 0.05, 0.06], 0.0);
    let dynamics = Dynamics::new(Chain::new(&arm), vec![link(3.0), link(2.0)]).unwrap();
    let sensors = Sensors {
        rate: RATE,
        encoder_step: 1e-5,
        white: vec![0.05; 2],
        coloured: vec![0.02; 2],
        colour_time: 0.1,
    };
    let friction = TABLE_2[3..5].iter().map(|gamma| TanhFriction::new(*gamma)).collect();
    Plant::new(dynamics, friction, sensors)
}

/// A minute of a path that the seed varies.
fn log(plant: &Plant, seed: u64) -> String {
    let turn = seed as f64;
    let harmonics = |j: usize| Harmonics {
        middle: 0.2 * j as f64,
        a: vec![0.4, -0.25 + 0.1 * j as f64, 0.1 * (turn + j as f64).cos()],
        b: vec![0.1 * (turn - j as f64).sin(), 0.25, -0.15],
    };
    let path = Fourier {
        fundamental: std::f64::consts::TAU / (8.0 + 0.7 * turn),
        periods: 6,
        ramp: 1.0,
        joints: (0..2).map(harmonics).collect(),
    };
    plant.record(&path.sample(RATE), 0.0, seed).to_csv()
}

fn run(arguments: &[&str], input: Option<&str>) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_powerball"))
        .args(arguments)
        .stdin(if input.is_some() { Stdio::piped() } else { Stdio::null() })
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    if let (Some(text), Some(mut pipe)) = (input, child.stdin.take()) {
        let text = text.to_string();
        std::thread::spawn(move || drop(pipe.write_all(text.as_bytes())));
    }
    child.wait_with_output().unwrap()
}

/// identified.json of the plant.
fn model(folder: &Path) -> PathBuf {
    for seed in 1..4 {
        std::fs::write(folder.join(format!("{seed}.csv")), log(&plant(), seed)).unwrap();
    }
    let path = |name: &str| folder.join(name).display().to_string();
    let (arm, out) = (path("arm.toml"), path("model"));
    let logs = [path("1.csv"), path("2.csv"), path("3.csv")];
    let done = run(
        &["identify", "--arm", &arm, "--log", &logs[0], &logs[1], "--validate", &logs[2], "--out", &out],
        None,
    );
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    folder.join("model/identified.json")
}

fn events(output: &Output) -> Vec<Value> {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let events: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    // 1 where something changed.
    let code = i32::from(!events.is_empty());
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    events
}

#[test]
fn a_change_is_one_event_and_no_change_is_none() {
    let folder = folder("changes");
    let model = model(&folder).display().to_string();
    let arm = folder.join("arm.toml").display().to_string();
    let force = PlantEffect::ContactWrench { force: [0.0, 6.0, 0.0], start: AT, length: 1.0, every: 1e6 };
    let body = PlantEffect::Payload { mass: 0.5, centre: [0.05, 0.0, 0.0], start: AT };
    for (name, effect) in [("clean", None), ("contact_wrench", Some(force)), ("payload", Some(body))] {
        let plant = if let Some(effect) = effect { plant().with(effect) } else { plant() };
        let (csv, file) = (log(&plant, 9), folder.join(format!("{name}.csv")));
        std::fs::write(&file, &csv).unwrap();
        let base = ["watch", "--arm", &arm, "--model", &model, "--json", "--learn", "15"];
        let file = file.display().to_string();
        let output = run(&[&base[..], &["--log", &file]].concat(), None);
        let found = events(&output);
        // identified.json says nothing of what the model leaves: that is learnt, and said.
        assert!(String::from_utf8_lossy(&output.stderr).contains("15 s of motion are taken as good"));
        // The same rows from a pipe, as CSV and as objects.
        let streamed = events(&run(&[&base[..], &["-"]].concat(), Some(&csv)));
        let named = events(&run(&[&base[..], &["--log", "-"]].concat(), Some(&csv)));
        let objects = events(&run(&[&base[..], &["-"]].concat(), Some(&as_objects(&csv))));
        for other in [&streamed, &named, &objects] {
            assert_eq!(other.len(), found.len(), "{name}: {other:?}");
            for (a, b) in other.iter().zip(&found) {
                let since = |event: &Value| event["since"].as_f64().unwrap();
                assert!(a["what"] == b["what"] && since(a) == since(b) && a["time"] == b["time"], "{a} {b}");
                assert_eq!(a["value"], b["value"]);
            }
        }
        // The recipe of docs/watch.md for ROS 2, in one word.
        let expected = match name {
            "contact_wrench" => "collision\n",
            "payload" => "load\n",
            _ => "",
        };
        let words: Vec<&str> =
            base.iter().map(|word| if *word == "--json" { "--word" } else { *word }).collect();
        let output = run(&[&words[..], &["-"]].concat(), Some(&from_joint_states(&csv)));
        assert_eq!(String::from_utf8_lossy(&output.stdout), expected, "{name}");
        assert_eq!(output.status.code(), Some(i32::from(!expected.is_empty())));
        let [event] = found.as_slice() else {
            assert!(name == "clean" && found.is_empty(), "{name}: {found:?}");
            continue;
        };
        assert_eq!(event["what"], name, "{event}");
        let number = |value: &Value| value.as_f64().unwrap();
        assert!((number(&event["since"]) - AT).abs() < 0.3, "{event}");
        assert!((AT..AT + 2.0).contains(&number(&event["time"])), "{event}");
        if name == "payload" {
            assert!((number(&event["value"]["mass"]) - 0.5).abs() < 0.05, "{event}");
        } else {
            assert!((number(&event["value"]["end_time"]) - AT - 1.0).abs() < 0.3, "{event}");
        }
    }
}

/// A log as `ros2 topic echo --csv /joint_states` prints it, and back by the script of the recipe.
fn from_joint_states(csv: &str) -> String {
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let message = |line: &str| {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap_or(0.0)).collect();
        let of = |name: &str| values[names.iter().position(|own| *own == name).unwrap()];
        let nanoseconds = (1e9 * of("t")).round() as u64;
        let (seconds, rest) = (1_700_000_000 + nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        let [q1, q2, tau1, tau2] = ["q1", "q2", "tau1", "tau2"].map(of);
        format!("{seconds},{rest},base,joint1,joint2,{q1},{q2},0.0,0.0,{tau1},{tau2}\n")
    };
    let messages: String = lines.map(message).collect();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/ros2/joint_states.awk");
    let mut child = Command::new("awk")
        .arg("-f")
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    std::thread::spawn(move || drop(pipe.write_all(messages.as_bytes())));
    String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap()
}

/// Lines of a CSV as JSON objects.
fn as_objects(csv: &str) -> String {
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let object = |line: &str| {
        let pairs: Vec<String> =
            names.iter().zip(line.split(',')).map(|(name, value)| format!("\"{name}\": {value}")).collect();
        format!("{{{}}}\n", pairs.join(", "))
    };
    lines.map(object).collect()
}

#[test]
fn what_cannot_be_watched_is_said_before_anything_is_computed() {
    let folder = folder("errors");
    let model = model(&folder);
    let path = |name: &str| folder.join(name).display().to_string();
    let text = std::fs::read_to_string(&model).unwrap();
    std::fs::write(folder.join("other.json"), text.replace("\"two\"", "\"three\"")).unwrap();
    std::fs::write(folder.join("current.csv"), "t,q1,q2,i1,i2\n0,0,0,0,0\n").unwrap();
    std::fs::write(folder.join("few.csv"), "t,q1,tau1\n0,0,0\n").unwrap();
    let (arm, model, log) = (path("arm.toml"), model.display().to_string(), path("1.csv"));
    let (other, current, few) = (path("other.json"), path("current.csv"), path("few.csv"));
    for (arguments, input, reason) in [
        (vec!["--model", &other, "--log", &log], None, "is a model of the arm 'three'"),
        (vec!["--model", &model, "--log", &current], None, "no torque_constant"),
        (vec!["--model", &model, "--log", &few], None, "missing: q2"),
        (vec!["--model", &model, "-"], Some("t,q1,q2,i1,i2\n0,0,0,0,0\n"), "no torque_constant"),
        (vec!["--model", &model, "-"], Some("t,q1,q2,tau1,tau2\n0,0,0,0,0\n"), "at least 40 are needed"),
        (vec!["--model", &model, "-"], Some("{\"t\": 0,\n"), "line 1: is not a JSON object"),
        (vec!["--model", &model, "--bus", "virtual"], None, "the arm file has 2 joints"),
        (vec!["--model", &model, "--log", "-"], Some("t,q1,q2,i1,i2\n0,0,0,0,0\n"), "no torque_constant"),
        (vec!["--model", &model], None, "required"),
        (vec!["--model", &model, "--log", &log, "--friction-range", "2"], None, "give a share"),
    ] {
        let output = run(&[&["watch", "--arm", &arm][..], &arguments].concat(), input);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(reason), "{arguments:?}: {said}");
    }
}
