//! How commands end where a result should not be used, and what they write over: see docs/exit_codes.md.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A pendulum of 1 kg at 0.5 m, whose lengths are in a unit and gravity in another.
fn arm(a: &str, gravity: &str) -> String {
    format!(
        "name = \"pendulum\"\nconvention = \"standard\"\ngravity = [0, -{gravity}, 0]\n[[joint]]\n\
        kind = \"revolute\"\na = {a}\nalpha = 0\nd = 0\ntheta = 0\n"
    )
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("exit_codes").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A swing with 0.3 N·m of friction; `size` of the torque, and a header of two other columns.
fn log(header: &str, phase: f64) -> String {
    let mut text = format!("{header}\n");
    for k in 0..4000 {
        let t = 0.005 * f64::from(k);
        let (sin, cos) = (3.0 * t + phase).sin_cos();
        let noise = 0.01 * (f64::from(k) * 12.9898).sin();
        let torque = 0.25 * -9.0 * sin + 0.5 * 9.81 * sin.cos() + 0.3 * (90.0 * cos).tanh() + noise;
        let _ = writeln!(text, "{t},{sin},{torque}");
    }
    text
}

fn powerball(folder: &Path, arguments: &str) -> Output {
    run(env!("CARGO_BIN_EXE_powerball"), folder, arguments)
}

fn run(program: &str, folder: &Path, arguments: &str) -> Output {
    Command::new(program).current_dir(folder).args(arguments.split_whitespace()).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn an_arm_file_in_another_unit_makes_a_result_useless() {
    let folder = folder("units");
    for (name, phase) in [("a.csv", 0.0), ("b.csv", 0.4)] {
        std::fs::write(folder.join(name), log("t,q1,tau1", phase)).unwrap();
    }
    for (name, text, reason) in [
        ("sound", arm("0.5", "9.81"), None),
        ("gravity", arm("0.5", "9810"), Some("give it in m/s²")),
        ("lengths", arm("500", "9.81"), Some("give a, b and d in metres")),
    ] {
        std::fs::write(folder.join("arm.toml"), text).unwrap();
        let done = powerball(&folder, &format!("identify --arm arm.toml --log a.csv --out {name}"));
        let first = String::from_utf8_lossy(&done.stdout).lines().next().unwrap_or_default().to_string();
        // The other commands that look at logs say so as well.
        let others = [
            format!("verify --arm arm.toml --model {name}/identified.json --log b.csv --out {name}_verified"),
            format!("summarize --arm arm.toml --log a.csv --out {name}.summary"),
            format!("compare a.csv b.csv --arm arm.toml --out {name}_compared"),
        ];
        for command in others {
            let done = powerball(&folder, &command);
            let first = String::from_utf8_lossy(&done.stdout).lines().next().unwrap_or_default().to_string();
            assert_eq!(code(&done) == 3, reason.is_some(), "{command}: {first} {}", said(&done));
            assert!(reason.is_none_or(|reason| first.contains(reason)), "{command}: {first}");
            // A comparison reports which side too.
            let side = !command.starts_with("compare") || reason.is_none() || first.contains("a.csv: ");
            assert!(side, "{command}: {first}");
            assert_ne!(code(&powerball(&folder, &format!("{command} --accept"))), 3, "{command}");
        }
        let Some(reason) = reason else {
            assert_eq!(code(&done), 0, "{first} {}", said(&done));
            continue;
        };
        assert_eq!(code(&done), 3, "{name}: {first}");
        assert!(first.contains(reason), "{name}: {first}");
        let text = std::fs::read_to_string(folder.join(name).join("identified.json")).unwrap();
        let result: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!(!result["unusable"].as_array().unwrap().is_empty(), "{name}");
        let accepted =
            powerball(&folder, &format!("identify --accept --arm arm.toml --log a.csv --out {name}"));
        assert_eq!(code(&accepted), 0, "{name}: {}", said(&accepted));
    }
}

#[test]
fn files_of_others_are_not_written_over() {
    let folder = folder("force");
    std::fs::write(folder.join("arm.toml"), arm("0.5", "9.81")).unwrap();
    let log = log("t,q1,tau1", 0.0);
    std::fs::write(folder.join("a.csv"), &log).unwrap();
    let identify = "identify --arm arm.toml --log a.csv --out result";
    let kept = |file: &str, text: &str| assert_eq!(std::fs::read_to_string(folder.join(file)).unwrap(), text);

    // Its own results are replaced; a page and a file of the same name that somebody wrote are not.
    assert_eq!(code(&powerball(&folder, identify)), 0);
    assert_eq!(code(&powerball(&folder, identify)), 0);
    for (file, text) in [("report.html", "<!doctype html><p>mine</p>"), ("identified.json", "{\"mine\": 1}")]
    {
        std::fs::write(folder.join("result").join(file), text).unwrap();
        let refused = powerball(&folder, identify);
        assert_eq!(code(&refused), 2, "{file}");
        assert!(said(&refused).contains(file) && said(&refused).contains("--force"), "{}", said(&refused));
        kept(&format!("result/{file}"), text);
        assert_eq!(code(&powerball(&folder, &format!("{identify} --force"))), 0);
    }

    // A log is never its own copy, and replaces no other.
    let to = "log a.csv --arm arm.toml --to csv -o";
    let refused = powerball(&folder, &format!("{to} a.csv --force"));
    assert!(code(&refused) == 2 && said(&refused).contains("is also an input"), "{}", said(&refused));
    kept("a.csv", &log);
    std::fs::write(folder.join("b.csv"), "t,q1,tau1\n0,0,0\n").unwrap();
    assert_eq!(code(&powerball(&folder, &format!("{to} b.csv"))), 2);
    kept("b.csv", "t,q1,tau1\n0,0,0\n");
    assert_eq!(code(&powerball(&folder, &format!("{to} b.csv --force"))), 0);
    assert!(std::fs::read_to_string(folder.join("b.csv")).unwrap().lines().count() > 4000);

    // A model is no code.
    let model = std::fs::read_to_string(folder.join("result/identified.json")).unwrap();
    let over = "generate --arm arm.toml --model result/identified.json -o result/identified.json";
    assert_eq!(code(&powerball(&folder, over)), 2);
    kept("result/identified.json", &model);

    // Values that somebody gave are no result, even under all of its names.
    let values = std::fs::read_to_string(folder.join("result/consistent.json")).unwrap();
    std::fs::write(folder.join("values.json"), &values).unwrap();
    let near = "consistent --arm arm.toml --values values.json --out near.json";
    assert_eq!(code(&powerball(&folder, near)), 0);
    assert_eq!(code(&powerball(&folder, near)), 0);
    let mine = values.replace('\n', "");
    std::fs::write(folder.join("near.json"), &mine).unwrap();
    assert_eq!(code(&powerball(&folder, near)), 2);
    kept("near.json", &mine);

    // Commands that write many files look at all of them before they begin.
    for (command, file) in [
        ("demo", "arm.toml"),
        ("demo", "fit_2.csv"),
        ("warm-up", "warm_up.csv"),
        ("warm-up", "warm_up.json"),
        ("friction", "friction_3.csv"),
        ("friction", "friction.json"),
        ("log a.csv --arm arm.toml --to mcap", "a.foxglove.json"),
    ] {
        let out = folder.join("many");
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(out.join(file), "mine").unwrap();
        let target = if command.starts_with("log") { "-o many/a.mcap" } else { "--out many" };
        let refused = powerball(&folder, &format!("{command} {target}"));
        assert!(code(&refused) == 2 && said(&refused).contains(file), "{command}: {}", said(&refused));
        kept(&format!("many/{file}"), "mine");
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1, "{command}");
    }

    // Generated code is replaced, other code is not.
    let generate = "generate --arm arm.toml --model result/identified.json -o model.rs";
    assert_eq!(code(&powerball(&folder, generate)), 0);
    assert_eq!(code(&powerball(&folder, generate)), 0);
    std::fs::write(folder.join("model.rs"), "fn mine() {}\n").unwrap();
    assert_eq!(code(&powerball(&folder, generate)), 2);
    kept("model.rs", "fn mine() {}\n");
}

#[test]
fn a_watch_ends_with_what_it_found() {
    let folder = folder("watch");
    std::fs::write(folder.join("arm.toml"), arm("0.5", "9.81")).unwrap();
    for (name, phase) in [("a.csv", 0.0), ("b.csv", 0.4)] {
        std::fs::write(folder.join(name), log("t,q1,tau1", phase)).unwrap();
    }
    assert_eq!(
        code(&powerball(&folder, "identify --arm arm.toml --log a.csv --validate b.csv --out result")),
        0
    );
    // From 12 s on the torque is 1 N·m more.
    let mut changed = String::from("t,q1,tau1\n");
    for (k, line) in log("t,q1,tau1", 0.0).lines().skip(1).enumerate() {
        let (head, torque) = line.rsplit_once(',').unwrap();
        let more = if k > 2400 { 1.0 } else { 0.0 };
        let _ = writeln!(changed, "{head},{}", torque.parse::<f64>().unwrap() + more);
    }
    std::fs::write(folder.join("changed.csv"), changed).unwrap();
    let watch = "watch --arm arm.toml --model result/identified.json --learn 5 --log";
    for (log, last, ends) in [("b.csv", "holds: 20 s, joint 1", 0), ("changed.csv", "changed: ", 1)] {
        let done = powerball(&folder, &format!("{watch} {log}"));
        let text = String::from_utf8_lossy(&done.stdout).into_owned();
        assert_eq!(code(&done), ends, "{log}: {text} {}", said(&done));
        assert!(text.lines().last().unwrap().starts_with(last), "{log}: {text}");
    }
    assert_eq!(code(&powerball(&folder, &format!("{watch} changed.csv --exit-zero"))), 0);
    // With --quiet the exit code is the answer; in JSON the events are there all the same.
    for (more, log, lines, ends) in
        [("", "b.csv", 0, 0), ("", "changed.csv", 0, 1), ("--json", "changed.csv", 1, 1)]
    {
        let done = powerball(&folder, &format!("{watch} {log} --quiet {more}"));
        let text = String::from_utf8_lossy(&done.stdout).into_owned();
        assert_eq!((code(&done), text.lines().count() > 0), (ends, lines > 0), "{log} {more}: {text}");
        assert!(done.stderr.is_empty(), "{}", said(&done));
    }
    // A model that holds over a moment has not been judged.
    let all = log("t,q1,tau1", 0.0);
    let moment = all.lines().take(1 + 1000 + 60).collect::<Vec<_>>().join("\n");
    std::fs::write(folder.join("moment.csv"), moment).unwrap();
    let done = powerball(&folder, &format!("{watch} b.csv moment.csv"));
    assert_eq!(code(&done), 3, "{}", said(&done));
    assert!(said(&done).contains("moment.csv: 0."), "{}", said(&done));
    // In JSON each line on standard output is an event.
    let done = powerball(&folder, &format!("{watch} changed.csv --json"));
    assert_eq!(code(&done), 1);
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(text.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()), "{text}");
    assert!(said(&done).contains("changed: "), "{}", said(&done));
}

/// Every command that takes a torque model says what the result of position servos is for.
#[test]
fn a_result_of_servos_is_no_torque_model() {
    let folder = folder("servos");
    std::fs::write(folder.join("arm.toml"), arm("0.5", "9.81")).unwrap();
    std::fs::write(folder.join("b.csv"), log("t,q1,tau1", 0.4)).unwrap();
    let result = r#"{"unusable": [], "arm": "pendulum", "set": "servo", "parameters": [], "friction": [{"joint": 1,
        "coulomb": 0.1, "viscous": 0.1, "load": 0.0}], "servo": []}"#;
    std::fs::write(folder.join("servos.json"), result).unwrap();
    for command in [
        "watch --arm arm.toml --model servos.json --log b.csv",
        "verify --arm arm.toml --model servos.json --log b.csv --out verified",
        "compare servos.json servos.json --out compared",
        "generate --arm arm.toml --model servos.json -o controller.rs",
        "export --for sdf servos.json --arm arm.toml -o arm.sdf",
    ] {
        let done = powerball(&folder, command);
        let why =
            "servos.json: is of position servos and has no torque model; dyngen export --to mjcf takes it";
        assert_eq!(code(&done), 2, "{command}: {}", said(&done));
        assert!(said(&done).contains(why), "{command}: {}", said(&done));
    }
}
