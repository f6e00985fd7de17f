//! Logs in the formats of others, written by the formats' own writers (tests/logs_data/make.py): each comes
//! to the numbers of the CSV, joints by their names.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::chain::Chain;
use powerball::identification::excite::{Fourier, Harmonics};
use powerball::logs::log::{ColumnMap, Finding, LogError};
use powerball::logs::tables::{JointState, McapWriter, read_contents};
use powerball::virtual_arm::{Body, Dynamics, Plant, Sensors};
use powerball::{CompareOptions, IdentifyOptions, Log, Side, Source, compare, identify};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

const JOINTS: &str = "joints = [\"shoulder\", \"elbow\"]\n";

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs_data").join(name)
}

fn arm() -> Arm {
    let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";
    let text = format!("name = \"two\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n{joint}{joint}");
    Arm::parse(&text, "two.toml").unwrap()
}

fn read(name: &str, map: &str) -> Result<(Log, Vec<Finding>), LogError> {
    Log::read_as(data(name), &arm(), &ColumnMap::parse(map, "map").unwrap())
}

/// Largest difference of two logs' signals; times from their first.
fn differs(a: &Log, b: &Log) -> f64 {
    assert_eq!((a.t.len(), a.q.len()), (b.t.len(), b.q.len()));
    let time = |log: &Log| log.t.iter().map(|t| t - log.t[0]).collect::<Vec<f64>>();
    let all = |log: &Log| [vec![time(log)], log.q.clone(), log.torque.clone()].concat();
    let of = |(a, b): (Vec<f64>, Vec<f64>)| a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    all(a).into_iter().zip(all(b)).map(of).fold(0.0, f64::max)
}

#[test]
fn every_format_comes_to_the_same_log_whatever_the_order_of_its_joints() {
    let (csv, _) = read("log.csv", "").unwrap();
    // Seconds since 1970 have steps of 0.24 µs.
    for (name, map, within) in [
        ("bag.db3", "", 5e-7),
        ("joint_state.mcap", "", 5e-7),
        ("dynamic.mcap", "", 5e-7),
        ("json.mcap", "tau.scale = 1e-3", 5e-7),
        ("stored.npz", "", 0.0),
        ("packed.npz", "", 0.0),
        ("stored.mat", "", 0.0),
        ("packed.mat", "", 0.0),
        ("lists.parquet", "", 0.0),
    ] {
        let (log, findings) = read(name, &format!("{JOINTS}{map}")).unwrap();
        assert!(differs(&log, &csv) <= within, "{name}: {}", differs(&log, &csv));
        assert_eq!(log.pieces.len(), 1, "{name}");
        let notes: Vec<String> = findings.iter().map(ToString::to_string).collect();
        let known = ["kept out", "comment"];
        assert!(notes.iter().all(|t| known.iter().any(|known| t.contains(known))), "{name}: {notes:?}");
        assert_eq!(log.temperature.is_some(), name == "dynamic.mcap");
    }
    // The same names the other way round are another arm.
    let turned = read("bag.db3", "joints = [\"elbow\", \"shoulder\"]").unwrap().0;
    assert!(turned.q[0][0] == 1.0 && turned.q[1][0] == 0.0);
}

/// Lists by the names of their dataset's description; each episode is a piece of its own.
#[test]
fn a_dataset_of_lists_is_a_log_of_episodes() {
    let (csv, _) = read("log.csv", "").unwrap();
    let columns = "t.column = \"timestamp\"\nq = { column = \"observation.state\", unit = \"rad\" }\n\
        tau.column = \"observation.effort\"\n";
    let file = "dataset/data/chunk-000/file-000.parquet";
    let (log, _) = read(file, &format!("{JOINTS}{columns}")).unwrap();
    assert_eq!((log.t.len(), log.pieces.len()), (120, 2));
    assert_eq!((&log.q, &log.torque), (&csv.q, &csv.torque));
    // The second episode begins ten seconds after the first one has ended; its time is in single precision.
    let step = |k: usize| log.t[k + 1] - log.t[k];
    assert!((step(59) - 10.0).abs() < 1e-6 && (step(60) - 0.01).abs() < 1e-6);
    // Without its description they are numbered, and the numbers are not the arm's order: it is the file's.
    let copy = std::env::temp_dir().join(format!("powerball_lists_{}.parquet", std::process::id()));
    std::fs::copy(data(file), &copy).unwrap();
    let (plain, _) = Log::read_as(&copy, &arm(), &ColumnMap::parse(columns, "map").unwrap()).unwrap();
    std::fs::remove_file(&copy).unwrap();
    assert_eq!((&plain.q[0], &plain.q[1]), (&csv.q[1], &csv.q[0]));
}

/// A file of MATLAB's that is torn or of a version with another format says so; no byte of it stops the
/// program.
#[test]
fn a_damaged_file_of_matlabs_is_reported() {
    for name in ["stored.mat", "packed.mat"] {
        let whole = std::fs::read(data(name)).unwrap();
        let file = std::env::temp_dir().join(format!("powerball_{}_{name}", std::process::id()));
        let contents = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            read_contents(&file)
        };
        for length in [100, 127, 130, 140, 200, 300, whole.len() / 2, whole.len() - 9] {
            assert!(contents(&whole[..length]).is_err(), "{name} of {length} bytes");
        }
        // Whatever a byte is, there is an answer.
        for at in (128..whole.len().min(1200)).chain([whole.len() - 1]) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0xa5;
            let _ = contents(&damaged);
        }
        let error = contents(b"MATLAB 7.3 MAT-file, Platform: GLNXA64").unwrap_err().to_string();
        assert!(error.contains("-v7"), "{error}");
        std::fs::remove_file(&file).unwrap();
    }
}

#[test]
fn the_time_of_receipt_counts_where_it_is_asked_for() {
    let (log, _) = read("bag.db3", &format!("{JOINTS}clock = \"receipt\"")).unwrap();
    // 3 ms after the stamps, every seventh message 2 ms later.
    assert!((log.t[7] - log.t[6] - 0.012).abs() < 1e-6 && (log.t[8] - log.t[7] - 0.008).abs() < 1e-6);
}

#[test]
fn topics_are_joined_in_time_and_it_is_reported_how() {
    let (csv, _) = read("log.csv", "").unwrap();
    let (log, findings) = read("two_topics.mcap", JOINTS).unwrap();
    // The drives spoke half as often; their times are those of every second position.
    assert_eq!(log.t.len(), csv.t.len() / 2);
    for (j, k) in (0..2).flat_map(|j| (0..log.t.len()).map(move |k| (j, k))) {
        assert_eq!(log.torque[j][k], csv.torque[j][2 * k]);
        assert!((log.q[j][k] - csv.q[j][2 * k]).abs() < 1e-6);
    }
    let notes = findings.iter().map(ToString::to_string).collect::<String>();
    assert!(notes.contains("torques of /drives with positions of /encoders"), "{notes}");
}

#[test]
fn names_that_are_not_the_arms_are_an_error_that_lists_both() {
    let refused = |name: &str, map: &str| read(name, map).unwrap_err().to_string();
    let unnamed = refused("bag.db3", "");
    assert!(unnamed.contains("shoulder, elbow") && unnamed.contains("--map"), "{unnamed}");
    let others = refused("bag.db3", "joints = [\"shoulder\", \"wrist\"]");
    assert!(others.contains("the log's joints are shoulder, elbow, finger"), "{others}");
    assert!(others.contains("the arm's are shoulder, wrist; missing: position.wrist"), "{others}");
    let topic = refused("bag.db3", &format!("{JOINTS}topic = \"/states\""));
    assert!(topic.contains("/states is not there") && topic.contains("/joint_states"), "{topic}");
    let short = refused("bag.db3", "joints = [\"shoulder\"]");
    assert!(short.contains("names 1 joints, the arm has 2"), "{short}");
}

#[test]
fn torn_files_end_with_an_error_or_with_what_was_whole() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("torn_logs");
    std::fs::create_dir_all(&folder).unwrap();
    let map = ColumnMap::parse(JOINTS, "map").unwrap();
    for name in ["bag.db3", "joint_state.mcap", "dynamic.mcap", "json.mcap", "stored.npz", "packed.npz"] {
        let whole = std::fs::read(data(name)).unwrap();
        let file = folder.join(name);
        let tried = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            let _ = Log::read_as(&file, &arm(), &map);
        };
        for share in 1..40 {
            tried(&whole[..whole.len() * share / 40]);
            let mut damaged = whole.clone();
            for k in (0..damaged.len()).skip(share * 13).step_by(997) {
                damaged[k] ^= 0xff;
            }
            tried(&damaged);
        }
    }
    // An interrupted MCAP is read up to there.
    let whole = std::fs::read(data("json.mcap")).unwrap();
    let file = folder.join("interrupted.mcap");
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    let map = ColumnMap::parse("tau.scale = 1e-3", "map").unwrap();
    let (log, findings) = Log::read_as(&file, &arm(), &map).unwrap();
    assert!(log.t.len() > 20 && log.t.len() < 120);
    assert!(findings.iter().any(|f| f.message.contains("interrupted")), "{findings:?}");
}

/// Three joints under gravity: a log of it, and the same as a bag whose messages name joints by the alphabet.
#[test]
fn a_bag_in_the_order_of_the_alphabet_is_identified_in_the_order_of_the_chain() {
    let joint = |alpha: &str, a: f64| {
        format!(
            "[[joint]]\nkind = \"revolute\"\na = {a}\nalpha = {alpha}\nd = 0.1\ntheta = 0\nvelocity = 2\n"
        )
    };
    let joints = [joint("\"pi/2\"", 0.0), joint("0", 0.4), joint("0", 0.3)].concat();
    let text = format!("name = \"three\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n{joints}");
    let arm = Arm::parse(&text, "three.toml").unwrap();
    let link = |mass| Body::even_box(mass, [-0.15, 0.01, 0.02], [0.3, 0.05, 0.06], 0.0);
    let dynamics = Dynamics::new(Chain::new(&arm), vec![link(3.0), link(2.0), link(1.0)]).unwrap();
    let sensors = Sensors {
        rate: 200.0,
        encoder_step: 1e-5,
        white: vec![0.05; 3],
        coloured: vec![0.02; 3],
        colour_time: 0.5,
    };
    let friction = TABLE_2[..3].iter().map(|gamma| TanhFriction::new(*gamma)).collect();
    let plant = Plant::new(dynamics, friction, sensors);
    let harmonics = |j: usize| Harmonics {
        middle: 0.1 * j as f64,
        a: vec![0.3, -0.2 + 0.1 * j as f64, 0.1],
        b: vec![0.1 * j as f64, 0.2, -0.15],
    };
    let path = Fourier {
        fundamental: std::f64::consts::TAU / 10.0,
        periods: 2,
        ramp: 1.0,
        joints: (0..3).map(harmonics).collect(),
    };
    let recording = plant.record(&path.sample(200.0), 0.0, 7);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("alphabet");
    std::fs::create_dir_all(&folder).unwrap();
    let (csv, bag) = (folder.join("log.csv"), folder.join("log.mcap"));
    std::fs::write(&csv, recording.to_csv()).unwrap();
    // The chain is shoulder, elbow, hand; the bag says elbow, hand, shoulder.
    let order = [1, 2, 0];
    let names = ["elbow", "hand", "shoulder"].map(String::from);
    let mut writer = McapWriter::new(Vec::new()).unwrap();
    let states = writer.joint_states("/joint_states").unwrap();
    for (k, t) in recording.t.iter().enumerate() {
        let of = |values: &[f64]| order.map(|j| values[3 * k + j]);
        let (position, effort) = (of(&recording.q), of(&recording.tau));
        let state = JointState { position: &position, velocity: &[], effort: &effort };
        writer.state(states, 1000.0 + t, &names, &state).unwrap();
    }
    std::fs::write(&bag, writer.finish().unwrap()).unwrap();

    let map = ColumnMap::parse("joints = [\"shoulder\", \"elbow\", \"hand\"]", "map").unwrap();
    let options = IdentifyOptions::default();
    let of_csv = identify(&arm, [Source::file(&csv)], [], &options).unwrap();
    let of_bag = identify(&arm, [Source::file(&bag).mapped(Arc::new(map))], [], &options).unwrap();
    for (a, b) in of_csv.parameters.iter().zip(&of_bag.parameters) {
        // CSV has fewer digits.
        assert!((a.value - b.value).abs() < 0.02 * a.std.unwrap(), "{}: {} and {}", a.name, a.value, b.value);
    }
    assert!(of_bag.fit.relative.iter().all(|left| *left < 0.1), "{:?}", of_bag.fit);

    // Two fits of the same arm, and the same as results in folders.
    let compared =
        compare(&Side::of("a", &of_csv), &Side::of("b", &of_bag), &CompareOptions::default()).unwrap();
    assert!(!compared.differ, "{}", compared.sentence);
    let arm_file = folder.join("arm.toml");
    std::fs::write(&arm_file, text).unwrap();
    let shown = |path: &Path| path.display().to_string();
    let (arm_file, csv, bag) = (shown(&arm_file), shown(&csv), shown(&bag));
    let [a, b, out] = ["a", "b", "compared"].map(|name| shown(&folder.join(name)));
    let chain = "joints = [\"shoulder\", \"elbow\", \"hand\"]";
    for (log, out) in [(&csv, &a), (&bag, &b)] {
        let done = powerball(&["identify", "--arm", &arm_file, "--log", log, "--map", chain, "--out", out]);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    }
    let done = json(&powerball(&["compare", &a, &b, "--out", &out, "--json"]));
    assert_eq!(done["differ"], false);
    for key in ["parameters", "friction", "torque_difference"] {
        assert!(!done[key].as_array().unwrap().is_empty(), "{key}");
    }
    assert!(done["sentence"].as_str().unwrap().starts_with("Same arm"));
    assert!(folder.join("compared/report.html").is_file());

    // What a model predicts is written next to what was measured.
    let (model, torque) = (shown(&folder.join("a/identified.json")), shown(&folder.join("torque.mcap")));
    let done = powerball(&[
        "log", &csv, "--arm", &arm_file, "--model", &model, "--to", "mcap", "--force", "-o", &torque,
    ]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let tables = read_contents(Path::new(&torque)).unwrap().tables;
    let of = |name: &str| tables[1].column(name).unwrap();
    assert_eq!((tables[0].name.as_str(), tables[1].name.as_str()), ("/joint_states", "/torque/joint1"));
    layouts_name_what_is_there(Path::new(&torque), &["measured", "predicted", "residual"]);
    for ((measured, predicted), left) in of("measured").iter().zip(of("predicted")).zip(of("residual")) {
        assert!((measured - predicted - left).abs() < 1e-9);
    }
}

/// Every line that the layouts next to an MCAP draw is a column of a topic of it, and the last parts of their
/// names are these.
fn layouts_name_what_is_there(mcap: &Path, members: &[&str]) {
    let tables = read_contents(mcap).unwrap().tables;
    let has = |topic: &str, column: &str| {
        tables.iter().any(|t| t.name == topic && t.columns.iter().any(|c| c.name.starts_with(column)))
    };
    let layout = std::fs::read_to_string(mcap.with_extension("foxglove.json")).unwrap();
    let layout: Value = serde_json::from_str(&layout).unwrap();
    let plots = layout["configById"].as_object().unwrap();
    let paths: Vec<&str> = plots
        .values()
        .flat_map(|plot| plot["paths"].as_array().unwrap().iter().map(|path| path["value"].as_str().unwrap()))
        .collect();
    let place = |path: &str| path.split(['[', ']']).nth(1).map(|k| k.parse::<usize>().unwrap());
    let states = tables.iter().find(|t| t.name == "/joint_states").unwrap().names();
    for path in &paths {
        let (topic, rest) = path.split_once('.').unwrap();
        let field = rest.split(['[', '.']).next().unwrap();
        assert!(has(topic, field), "{path}");
        let own = states.iter().filter(|name| name.starts_with(field)).count();
        assert!(place(path).is_none_or(|k| k < own), "{path}");
    }
    // Every panel is shown, and only once.
    let shown = layout["layout"].to_string();
    assert!(plots.keys().all(|id| shown.matches(&format!("\"{id}\"")).count() == 1), "{shown}");
    let text = std::fs::read_to_string(mcap.with_extension("plotjuggler.xml")).unwrap();
    let curves: Vec<&str> =
        text.split("<curve name=\"").skip(1).map(|c| c.split('"').next().unwrap()).collect();
    for curve in &curves {
        let (above, last) = curve.rsplit_once('/').unwrap();
        let joint = above.strip_prefix("/joint_states/");
        let there =
            joint.map_or_else(|| has(above, last), |joint| has("/joint_states", &format!("{last}.{joint}")));
        assert!(there, "{curve}");
    }
    for member in members {
        let of = |name: &&str| name.contains(member);
        assert!(paths.iter().any(of) && curves.iter().any(of), "{member}: {paths:?} {curves:?}");
    }
}

#[test]
fn logs_go_out_in_every_format_and_come_back() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("logs_out");
    std::fs::create_dir_all(&folder).unwrap();
    let (log, _) = read("dynamic.mcap", JOINTS).unwrap();
    for name in ["log.csv", "log.parquet", "log.mcap"] {
        let file = folder.join(name);
        log.write(&file).unwrap();
        let (back, _) = Log::read(&file, &arm()).unwrap();
        assert!(differs(&back, &log) < 5e-7, "{name}: {}", differs(&back, &log));
        // Temperatures are no joint states.
        assert_eq!(back.temperature.is_some(), name != "log.mcap");
    }
    layouts_name_what_is_there(&folder.join("log.mcap"), &["position", "effort"]);
}

#[test]
fn torques_on_the_motors_side_are_kept_too() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("logs_motor");
    std::fs::create_dir_all(&folder).unwrap();
    let text = std::fs::read_to_string(data("log.csv")).unwrap();
    let mut lines: Vec<String> = text.lines().map(|line| format!("{line},{}", line)).collect();
    lines[0] = "t,q1,q2,dq1,dq2,tau1,tau2,time2,q.x,q.y,motor2,motor1,f1,f2".into();
    let file = folder.join("motor.csv");
    std::fs::write(&file, lines.join("\n")).unwrap();
    let (log, findings) = Log::read(&file, &arm()).unwrap();
    let motor = log.motor.unwrap();
    let dq2 = log.t.iter().map(|t| -3.0 * (3.0 * t).sin());
    assert!(motor[0].iter().zip(dq2).all(|(motor, dq2)| (motor - dq2).abs() < 1e-9));
    let notes = findings.iter().map(ToString::to_string).collect::<String>();
    assert!(notes.contains("motor: kept in addition to the torques"), "{notes}");
}

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    let complaint = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {complaint}"))
}

#[test]
fn the_command_says_what_is_in_a_file() {
    let bag = data("bag.db3").display().to_string();
    let shown = &json(&powerball(&["log", &bag, "--json"]))["files"][0];
    let (states, camera) = (&shown["tables"][0], &shown["tables"][1]);
    assert_eq!(
        (&states["name"], &states["type"]),
        (&"/joint_states".into(), &"sensor_msgs/msg/JointState".into())
    );
    assert_eq!(states["joints"], serde_json::json!(["shoulder", "elbow", "finger"]));
    assert_eq!((&states["samples"], &camera["samples"]), (&132.into(), &3.into()));
    assert_eq!(states["clock"], "header");
    assert!((states["delay"].as_f64().unwrap() - 0.003).abs() < 1e-6);
    // Sentences for people carry the same.
    let text = powerball(&["log", &bag]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("joints: shoulder, elbow, finger") && text.contains("position.elbow: q of elbow"),
        "{text}"
    );
    // Two topics in time, and what is no file of logs.
    let two = data("two_topics.mcap").display().to_string();
    let shown = json(&powerball(&["log", &two, "--json"]));
    assert!(shown["files"][0]["alignment"][0]["median"].as_f64().unwrap() < 0.01, "{shown}");
    assert_eq!(powerball(&["log", "nowhere.mcap"]).status.code(), Some(2));
}

/// With and without an arm: what is in a file as a page with figures, and as JSON next to it.
#[test]
fn a_look_into_a_log_is_a_page_with_figures() {
    let folder = std::env::temp_dir().join(format!("powerball_look_{}", std::process::id()));
    let arm_file = folder.join("two.toml");
    std::fs::create_dir_all(&folder).unwrap();
    let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";
    let text = format!("name = \"two\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n{joint}{joint}");
    std::fs::write(&arm_file, text).unwrap();
    let (file, out) = (data("two_topics.mcap"), folder.join("out"));
    let (file, out_text) = (file.to_str().unwrap(), out.to_str().unwrap());
    let page = || std::fs::read_to_string(out.join("report.html")).unwrap();

    let done = powerball(&["log", file, "--out", out_text]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let plain = page();
    // A figure a topic, a curve a joint.
    assert_eq!(plain.matches("<svg").count(), 2);
    for word in ["/encoders", "/drives", "position.shoulder", "effort.elbow", "Topics in time"] {
        assert!(plain.contains(word), "{word}");
    }
    let json: Value = serde_json::from_slice(&std::fs::read(out.join("log.json")).unwrap()).unwrap();
    assert_eq!(json["files"][0]["tables"].as_array().unwrap().len(), 2);
    assert!(json["files"][0]["tables"][0].get("times").is_none());

    let map = JOINTS.trim();
    let with_arm = ["log", file, "--arm", arm_file.to_str().unwrap(), "--map", map, "--out", out_text];
    assert!(powerball(&with_arm).status.success());
    assert_eq!(page().matches("<svg").count(), 3);
    assert!(page().contains("A log of two"));
    std::fs::remove_dir_all(&folder).unwrap();
}
