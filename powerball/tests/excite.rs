//! `powerball excite`: the written files against limits, floor, links and torques, by routes of their own.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::arm::Parameter;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::chain::Chain;
use powerball::virtual_arm::{Dynamics, lwa4p};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn excite(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).arg("excite").args(arguments).output().unwrap()
}

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn hardware() -> String {
    format!("{}/lwa4p.toml", env!("CARGO_MANIFEST_DIR"))
}

fn rows(file: &Path) -> Vec<Vec<f64>> {
    let mut csv = csv::Reader::from_path(file).unwrap();
    csv.records().map(|row| row.unwrap().iter().map(|x| x.parse().unwrap()).collect()).collect()
}

/// Elbow and wrist of the LWA 4P in the base frame, by its table written out as turns and ways.
fn elbow_and_wrist(q: &[f64]) -> [Vector3<f64>; 2] {
    let turn = |axis: Vector3<f64>, angle: f64| {
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::new(axis * angle))
    };
    let (x, z, half) = (Vector3::x(), Vector3::z(), std::f64::consts::FRAC_PI_2);
    let shoulder = turn(z, q[0]) * turn(x, half);
    let elbow = shoulder * turn(z, q[1] + half) * Translation3::new(0.35, 0.0, 0.0);
    let forearm = elbow * turn(x, 2.0 * half) * turn(z, q[2] + half) * turn(x, half) * turn(z, q[3]);
    let wrist = forearm * Translation3::new(0.0, 0.0, 0.305);
    [elbow.translation.vector, wrist.translation.vector]
}

/// A model of the virtual arm as identified.json holds it.
fn model_file(name: &str) -> PathBuf {
    let arm = lwa4p::arm().unwrap();
    let links = lwa4p::links();
    let value = |p: &Parameter| links[p.link].parameters()[p.kind as usize];
    let parameters: serde_json::Map<String, Value> =
        arm.kept_parameters().iter().map(|p| (p.to_string(), json!(value(p)))).collect();
    let file = scratch(name);
    let text = json!({"consistent": {"parameters": parameters, "friction": TABLE_2}}).to_string();
    std::fs::write(&file, text).unwrap();
    file
}

#[test]
fn a_written_path_keeps_floor_links_and_torques() {
    let (file, page, model) = (scratch("kept.csv"), scratch("kept.html"), model_file("kept.json"));
    let run = excite(&[
        "--arm",
        &hardware(),
        "--out",
        file.to_str().unwrap(),
        "--report",
        page.to_str().unwrap(),
        "--values",
        model.to_str().unwrap(),
        "--floor",
        "-0.1",
        "--evaluations",
        "800",
        "--radius",
        "0.05",
        "--clearance",
        "0.03",
        "--from",
        "0,0,0,0,0,0",
        "--json",
    ]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let printed: Value = serde_json::from_slice(&run.stdout).unwrap();
    let rows = rows(&file);
    assert_eq!(rows.len(), printed["samples"].as_u64().unwrap() as usize);

    let arm = lwa4p::arm().unwrap();
    let dynamics = Dynamics::new(Chain::new(&arm), lwa4p::links()).unwrap();
    let (mut nearest, mut torque) = (f64::INFINITY, [0.0f64; 6]);
    // The way from where the arm stands counts too.
    let start = &rows[0];
    let way = (0..50).map(|k| start.iter().map(|q| q * f64::from(k) / 50.0).collect::<Vec<f64>>());
    for (row, moving) in way.map(|q| (q, false)).chain(rows.iter().map(|row| (row.clone(), true))) {
        let (q, dq, ddq) = (&row[1..7], &row[7..13], &row[13..19]);
        let [elbow, wrist] = elbow_and_wrist(q);
        for height in [elbow.z, wrist.z] {
            nearest = nearest.min(height + 0.1 - 0.05);
        }
        // The upper arm from the shoulder to three radii before the elbow, the forearm from three radii
        // behind it.
        for s in 0..=40 {
            let upper = elbow * (f64::from(s) / 40.0 * (0.35 - 0.15) / 0.35);
            for t in 0..=40 {
                let along = 0.15 + f64::from(t) / 40.0 * (0.305 - 0.15);
                let fore = elbow + (wrist - elbow) * (along / 0.305);
                nearest = nearest.min((upper - fore).norm() - 0.1);
            }
        }
        if moving {
            let rigid = dynamics.inverse(q, dq, ddq);
            for j in 0..6 {
                torque[j] = torque[j].max((rigid[j] + TanhFriction::new(TABLE_2[j]).torque(dq[j])).abs());
            }
        }
    }
    assert!(nearest >= 0.03 - 1e-6, "{nearest}");
    let reported_nearest = printed["nearest"]["distance"].as_f64().unwrap();
    assert!(reported_nearest <= nearest + 0.004 || nearest > 0.03, "{reported_nearest} {nearest}");
    for (j, torque) in torque.iter().enumerate() {
        let limit = arm.joints[j].torque.unwrap();
        assert!(*torque <= 0.95 * limit, "joint {}: {torque} of {limit}", j + 1);
        let reported = printed["joints"][j]["torque"].as_f64().unwrap();
        assert!((reported - torque).abs() < 1e-6 * limit, "joint {}: {reported} {torque}", j + 1);
    }
    let html = std::fs::read_to_string(&page).unwrap();
    assert_eq!(html.matches("<svg").count(), 3);
    // The same path again from the same seed is checked by the search's own tests; here, that the file is
    // what was reported.
    let velocity = printed["joints"][0]["velocity"].as_f64().unwrap();
    let largest = rows.iter().fold(0.0f64, |m, row| m.max(row[7].abs()));
    assert!((velocity - largest).abs() < 1e-8);
}

#[test]
fn a_mounting_each_has_a_file_and_its_own_floor() {
    let file = scratch("mounted.csv");
    let run = excite(&[
        "--arm",
        &hardware(),
        "--out",
        file.to_str().unwrap(),
        "--mounting",
        "filed",
        "--mounting",
        "-90,0",
        "--floor",
        "-0.3",
        "--evaluations",
        "400",
        "--objective",
        "volume",
        "--json",
    ]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let printed: Value = serde_json::from_slice(&run.stdout).unwrap();
    let paths = printed["trajectories"].as_array().unwrap();
    // Rolled by -90°, y of the base points down: gravity is along +y.
    for (path, up) in paths.iter().zip([Vector3::z(), -Vector3::y()]) {
        let rows = rows(Path::new(path["out"].as_str().unwrap()));
        for row in &rows {
            for point in elbow_and_wrist(&row[1..7]) {
                assert!(point.dot(&up) + 0.3 - 0.06 >= 0.02 - 1e-6, "{path}");
            }
        }
    }
    // Alone and upright 23 can be distinguished.
    assert!(printed["parameters"].as_u64().unwrap() > 23, "{}", printed["parameters"]);
    assert!(scratch("mounted_1.csv").exists() && scratch("mounted_2.csv").exists() && !file.exists());
}

#[test]
fn what_cannot_be_kept_is_said() {
    let file = scratch("never.csv");
    let _ = std::fs::remove_file(&file);
    let refused = |more: &[&str], code: i32, says: &str| {
        let base = ["--out", file.to_str().unwrap(), "--evaluations", "100"];
        let hardware = hardware();
        let arm: &[&str] = if more.contains(&"--arm") { &[] } else { &["--arm", &hardware] };
        let run = excite(&[arm, &base, more].concat());
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(code), "{more:?}: {said}");
        assert!(said.contains(says), "{more:?}: {said}");
        assert!(!file.exists());
    };
    refused(&["--floor", "0.9"], 1, "in every pose");
    refused(&["--floor", "0", "--from", "0,1.9,0,0,0,0"], 1, "the arm cannot stand at --from");
    refused(&["--from", "0,0,0"], 2, "--from has 3 numbers, the arm 6 joints");
    refused(&["--radius", "0"], 2, "--radius must be above 0");
    refused(&["--clearance", "-1"], 2, "--clearance");
    refused(&["--rate", "1e9"], 2, "at most");
    refused(&["--mounting", "upright"], 2, "no mounting");
    refused(&["--values", "no/such.json"], 2, "no/such.json: cannot be read");
    let model = scratch("bad.json");
    std::fs::write(&model, r#"{"m1": 1.0, "nonsense": 2}"#).unwrap();
    refused(&["--values", model.to_str().unwrap()], 2, "no value for");
    // A load that the arm cannot hold.
    let weak = scratch("weak.toml");
    let text = std::fs::read_to_string(hardware()).unwrap().replace("torque = 64.0", "torque = 2.0");
    std::fs::write(&weak, text).unwrap();
    let heavy = model_file("heavy.json");
    refused(
        &["--arm", weak.to_str().unwrap(), "--values", heavy.to_str().unwrap()],
        1,
        "no trajectory was found that keeps all constraints; in the best one",
    );
}
