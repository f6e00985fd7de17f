//! `powerball bus`, `virtual-arm` and `record` as a user runs them.

#![allow(clippy::unwrap_used, clippy::panic)]

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", complaint(output)))
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_virtual_arm_is_found_read_and_written() {
    let found = json(&powerball(&["bus", "scan", "--json"]));
    let nodes: Vec<u64> =
        found["nodes"].as_array().unwrap().iter().map(|n| n["node"].as_u64().unwrap()).collect();
    assert_eq!(nodes, [3, 4, 5, 6, 7, 8]);
    assert_eq!(found["used_twice"].as_array().map(Vec::len), Some(0), "{found}");
    let read = json(&powerball(&["bus", "sdo", "read", "3", "0x1018:4", "--json"]));
    assert_eq!(read["value"], 1003);
    let written = json(&powerball(&["bus", "sdo", "write", "3", "0x200E", "0x1E", "--json"]));
    assert_eq!(
        (written["value"].as_u64(), written["name"].as_str()),
        (Some(30), Some("sync_timeout_factor"))
    );
    let state = json(&powerball(&["bus", "state", "--json"]));
    assert_eq!(state["nodes"][5]["state"], "switch on disabled");
    let tables = powerball(&["bus", "watch", "--for", "0.2", "--every", "0.1", "--json"]);
    assert_eq!(String::from_utf8_lossy(&tables.stdout).lines().count(), 2);
}

#[test]
fn exit_codes_tell_refusals_from_wrong_use() {
    for (arguments, code, why) in [
        (&["bus", "sdo", "read", "3", "0x6071"][..], 1, "0x06020000"),
        (&["bus", "sdo", "write", "3", "0x6041", "1"], 1, "read-only"),
        (&["bus", "sdo", "read", "9", "0x1000"], 1, "node 9, 0x1000:0: no SDO answer in time"),
        (&["bus", "sdo", "write", "3", "0x1017", "70000"], 2, "does not fit"),
        (&["bus", "sdo", "read", "200", "0x1000"], 2, "1 to 127"),
        (&["bus", "sdo", "read", "3", "statusword"], 2, "INDEX"),
        (&["bus", "scan", "--bus", "can0"], 2, "socketcan:can0"),
        (&["bus", "scan", "--bus", "slcan:/no/such/tty"], 2, "/no/such/tty"),
        (&["bus", "scan", "--bus", "slcan:/no/such/tty?bitrate=300000"], 2, "125000, 250000"),
        (&["bus", "move", "--joint", "7", "--to", "0"], 2, "1..=6"),
        (&["bus", "move", "--joint", "2", "--to", "2.5"], 2, "-1.920 to 1.920"),
        (&["virtual-arm", "--bus", "virtual"], 2, "udp:239.74.163.2:43113"),
        (&["virtual-arm", "--bus", "udp:239.74.163.2:43190", "--effect", "ghosts"], 2, "load_friction"),
        (&["bus", "watch", "--every", "1e300"], 2, "--every"),
        (&["record", "--trajectory", "no.csv", "--out", "x.csv"], 2, "no.csv"),
    ] {
        let run = powerball(arguments);
        assert_eq!(run.status.code(), Some(code), "{arguments:?}: {}", complaint(&run));
        assert!(complaint(&run).contains(why), "{arguments:?}: {}", complaint(&run));
    }
    for command in [
        &["bus"][..],
        &["bus", "scan"],
        &["bus", "move"],
        &["bus", "sdo", "write"],
        &["virtual-arm"],
        &["record"],
    ] {
        let help = powerball(&[command, &["--help"]].concat());
        assert!(String::from_utf8_lossy(&help.stdout).contains("Example"), "{command:?}");
    }
}

#[test]
fn a_joint_moves_where_it_is_commanded_and_the_brakes_close_after() {
    let moved =
        json(&powerball(&["bus", "move", "--joint", "3", "--by", "-0.25", "--speed", "0.3", "--json"]));
    let (from, at) = (moved["from"].as_f64().unwrap(), moved["at"].as_f64().unwrap());
    assert!((at - from + 0.25).abs() < 1e-3, "{moved}");
    let held = json(&powerball(&["bus", "enable", "--hold", "0.5", "--json"]));
    assert!(held["position"].as_array().unwrap().iter().all(|q| q.as_f64().unwrap().abs() < 2e-3), "{held}");
    assert_eq!(json(&powerball(&["bus", "stop", "--json"]))["stopped"].as_array().unwrap().len(), 6);
}

#[test]
fn a_trajectory_is_recorded() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (path, out) = (folder.join("short_path.csv"), folder.join("short_log.csv"));
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for k in 0..=400 {
        let t = 0.005 * f64::from(k);
        let q = 0.1 * (1.0 - (std::f64::consts::PI * t).cos());
        text += &format!("{t:.6},{q},{q},{q},{q},{q},{q}\n");
    }
    std::fs::write(&path, &text).unwrap();
    let (path, out) = (path.to_str().unwrap(), out.to_str().unwrap());
    let run = json(&powerball(&["record", "--trajectory", path, "--out", out, "--json", "--force"]));
    assert_eq!((run["record"]["samples"].as_u64(), run["record"]["missing"].as_u64()), (Some(401), Some(0)));
    let again = powerball(&["record", "--trajectory", path, "--out", out]);
    assert!(again.status.code() == Some(2) && complaint(&again).contains("--force"), "{}", complaint(&again));
    let log = std::fs::read_to_string(out).unwrap();
    assert!(log.starts_with("t,q1,q2,q3,q4,q5,q6,tau1,") && log.lines().count() == 402);
    std::fs::write(path, text.replace("0.005000", "0.007000")).unwrap();
    let uneven = powerball(&["record", "--trajectory", path, "--out", out, "--force"]);
    assert!(
        uneven.status.code() == Some(2) && complaint(&uneven).contains("evenly"),
        "{}",
        complaint(&uneven)
    );
}

/// With an arm file, the floor and the links bar trajectories, and ways to where they begin; nothing moves
/// then.
#[test]
fn what_would_touch_is_not_recorded() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let arm = concat!(env!("CARGO_MANIFEST_DIR"), "/lwa4p.toml");
    let (path, out) = (folder.join("touching_path.csv"), folder.join("touching_log.csv"));
    let _ = std::fs::remove_file(&out);
    let (path, out) = (path.to_str().unwrap(), out.to_str().unwrap());
    // Joint 2 swings from one angle to another.
    let swing = |from: f64, to: f64| {
        let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
        for k in 0..=800 {
            let t = 0.005 * f64::from(k);
            let q = from + 0.5 * (to - from) * (1.0 - (std::f64::consts::PI * t / 4.0).cos());
            text += &format!("{t:.6},0,{q},0,0,0,0\n");
        }
        std::fs::write(path, text).unwrap();
        let arguments = ["record", "--trajectory", path, "--out", out, "--arm", arm, "--json", "--force"];
        let at = |floor: &'static str| powerball(&[&arguments[..], &["--floor", floor]].concat());
        (at("0.1"), at("none"))
    };
    for (from, to, where_to) in [(0.0, 1.8, "on the trajectory"), (1.8, 1.7, "on the trajectory")] {
        let (barred, free) = swing(from, to);
        assert_eq!(barred.status.code(), Some(1), "{}", complaint(&barred));
        assert!(complaint(&barred).contains(where_to) && complaint(&barred).contains("the floor"));
        assert_eq!(json(&free)["record"]["samples"], 801, "{}", complaint(&free));
    }
}

#[test]
fn two_processes_meet_on_a_multicast_group() {
    // A port of this run's own.
    let url = format!("udp:239.74.163.2:{}", 43200 + std::process::id() % 20000);
    let mut arm = Command::new(env!("CARGO_BIN_EXE_powerball"))
        .args([
            "virtual-arm",
            "--bus",
            &url,
            "--for",
            "30",
            "--start",
            "0.1,0.2,0.3,0.4,0.5,0.6",
            "--commutated",
        ])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut tries = 0;
    let state = loop {
        let run = powerball(&["bus", "state", "--bus", &url, "--json"]);
        if run.status.success() && json(&run)["nodes"].as_array().unwrap().len() == 6 {
            break json(&run);
        }
        if complaint(&run).contains("ip route add") {
            arm.kill().unwrap();
            arm.wait().unwrap();
            println!("skipped: {}", complaint(&run));
            return;
        }
        tries += 1;
        assert!(tries < 20, "{}", complaint(&run));
    };
    let moved =
        powerball(&["bus", "move", "--joint", "6", "--by", "0.1", "--speed", "0.5", "--bus", &url, "--json"]);
    arm.kill().unwrap();
    arm.wait().unwrap();
    assert!((state["nodes"][5]["position"].as_f64().unwrap() - 0.6).abs() < 1e-4, "{state}");
    // In real time, on whatever machine this is: a driver that stopped the arm for being late has done its
    // work too.
    match moved.status.code() {
        Some(0) => assert!((json(&moved)["at"].as_f64().unwrap() - 0.7).abs() < 2e-3, "{}", json(&moved)),
        _ => assert!(complaint(&moved).contains("the arm was stopped"), "{}", complaint(&moved)),
    }
}
