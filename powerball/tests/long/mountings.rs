//! `summarize`, `identify` and `verify` on logs of an arm whose base was mounted in two ways, as a user runs
//! them.

use powerball::identification::excite::{Fourier, Harmonics};
use powerball::identification::mounting::Mounting;
use powerball::virtual_arm::lwa4p;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn powerball(arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments.split_whitespace()).output().unwrap()
}

fn json(output: &Output) -> Value {
    let complaint = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {complaint}"))
}

/// A log of the virtual arm with its base mounted so, on a path of its own.
fn record(folder: &Path, mounting: &str, path: u64) -> String {
    let arm = lwa4p::arm().unwrap();
    let plant = lwa4p::mounted(mounting.parse::<Mounting>().unwrap().gravity(&arm)).unwrap();
    let series = |j: u64, k: u64| 0.25 * (1.7 * (13 * path + 5 * j + k) as f64).sin();
    let joint = |j: u64| Harmonics {
        middle: 0.0,
        a: (1..6).map(|k| series(j, k)).collect(),
        b: (1..6).map(|k| series(j + 7, k)).collect(),
    };
    let path_of = Fourier {
        fundamental: std::f64::consts::TAU / 10.0,
        periods: 3,
        ramp: 1.0,
        joints: (0..6).map(joint).collect(),
    };
    let file = folder.join(format!("{}_{path}.csv", mounting.replace(',', "_")));
    plant.record(&path_of.sample(plant.sensors().rate), 0.0, path).write(&file).unwrap();
    file.display().to_string()
}

fn numbers(values: &Value) -> Vec<f64> {
    values.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn logs_of_two_mountings_come_to_one_model() {
    let folder: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mountings");
    std::fs::create_dir_all(&folder).unwrap();
    let place = |name: &str| folder.join(name).display().to_string();
    let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("lwa4p.toml").display().to_string();
    let [up, side, up_2, side_2] =
        [("filed", 1), ("90,0", 2), ("filed", 3), ("90,0", 4)].map(|(m, path)| record(&folder, m, path));
    let (out, summary) = (place("out"), place("side.summary"));

    // A log and a summary that knows its mounting, judged by logs of both.
    let done =
        powerball(&format!("summarize --arm {arm} --log {side} --mounting 90,0 --out {summary} --json"));
    assert!(json(&done)["mounting"].as_str().unwrap().contains("rolled by 90°"));
    let judged = format!("--validate {up_2} --mounting 90,0 --validate {side_2} --out {out} --json");
    let found = json(&powerball(&format!("identify --arm {arm} --log {up} {summary} {judged}")));
    let again = format!("identify --arm {arm} --log {up} --validate {up_2} --mounting 90,0 --log {side}");
    let direct = json(&powerball(&format!("{again} --validate {side_2} --out {out} --json")));
    for key in ["parameters", "friction", "fit", "validate"] {
        assert_eq!(found[key], direct[key], "{key}");
    }
    assert_eq!(found["parameters"].as_array().unwrap().len(), 24);
    let mountings = direct["mountings"].as_array().unwrap();
    assert_eq!((mountings.len(), &mountings[1]["logs"][0]), (2, &Value::from(side.as_str())));
    assert_eq!(numbers(&mountings[1]["gravity"]), [0.0, -9.81, 0.0]);
    // Pooled errors are those of both logs together, and about as large as the fit's.
    for (fit, held_out) in numbers(&direct["fit"]["rms"]).iter().zip(numbers(&direct["validate"]["rms"])) {
        assert!(held_out < 1.3 * fit && held_out > 0.7 * fit, "{held_out} {fit}");
    }

    // The values are those of the filed set, exactly the sums that they stand for, and of a real arm's.
    let model = dyngen::Model::derive(dyngen::Arm::read(Path::new(&arm)).unwrap()).unwrap();
    let set = model.set(dyngen::SetKind::Minimal).unwrap();
    let of = |name: &str| dyngen::Values::read(&folder.join("out").join(name)).unwrap();
    let baked = of("identified.json").of_set(&model, set).unwrap();
    let value = |name: &str| {
        let all = direct["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == name).unwrap()["value"].as_f64().unwrap()
    };
    let at = set.names().iter().position(|n| n == "Ixz2 + 7/20*mz2 + 7/20*my3").unwrap();
    approx::assert_relative_eq!(baked[at], value("Ixz2") + 0.35 * value("mz2 + my3"), max_relative = 1e-12);
    let full = of("consistent.json").of_set(&model, model.set(dyngen::SetKind::Full).unwrap()).unwrap();
    assert!(dyngen::consistency::check(&model, dyngen::SetKind::Full, &full).unwrap().possible);

    // Verified in the other mounting as it was judged there; with the wrong one stated, not.
    let verify = |log: &str, mounting: &str| {
        powerball(&format!(
            "verify --arm {arm} --model {out}/identified.json --log {log} {mounting} --out {out} --tolerance \
                0.5"
        ))
    };
    assert!(verify(&side_2, "--mounting 90,0").status.success());
    assert!(verify(&up_2, "").status.success());
    assert_eq!(verify(&side_2, "").status.code(), Some(1));

    // What the filed mounting alone determines is not enough for the other one.
    powerball(&format!("identify --arm {arm} --log {up} --out {out}"));
    let unseen = verify(&side_2, "--mounting 90,0");
    assert_eq!(unseen.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unseen.stderr).contains("in mountings that do not determine it"));

    // A mounting that is stated wrongly is doubted; what cannot be is refused.
    let wrong = json(&powerball(&format!(
        "identify --arm {arm} --log {up} --mounting 0,90 --log {side} --out {out} --json"
    )));
    let warnings: Vec<&str> =
        wrong["warnings"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(
        warnings.iter().any(|w| w.contains("is the mounting of each log stated correctly")),
        "{warnings:?}"
    );
    for (rest, reason) in [
        (
            format!("identify --log {up} --mounting 0,90 --log {summary}"),
            "was recorded with the base with gravity",
        ),
        (format!("identify --log {up} {summary} --estimator robust"), "looks at single samples"),
        (format!("identify --log {up} --mounting 90,0 --log {side} --estimator robust"), "one mounting"),
        (format!("summarize --log {up} {summary}"), "of several mountings"),
        (format!("summarize --log {up} --mounting sideways"), "is no mounting"),
    ] {
        let done = powerball(&format!("{rest} --arm {arm} --out {out}/refused"));
        let complaint = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.code() == Some(2) && complaint.contains(reason), "{rest}: {complaint}");
    }
}
