//! Commands that are killed while they record: nothing that was recorded is lost, and the next run goes on.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use powerball::logs::log::{Log, read_log};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn powerball(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A fresh folder of this test run.
fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn hardware() -> String {
    format!("{}/lwa4p.toml", env!("CARGO_MANIFEST_DIR"))
}

fn read(file: &Path) -> Log {
    read_log(file, &Arm::read(Path::new(&hardware())).unwrap(), &mut Vec::new()).unwrap()
}

/// Runs a command and kills it (SIGKILL) as soon as a file has `bytes` bytes.
fn kill_when(arguments: &[&str], file: &Path, bytes: u64) {
    let mut child = powerball(arguments).spawn().unwrap();
    let started = Instant::now();
    while std::fs::metadata(file).map_or(0, |m| m.len()) < bytes {
        assert!(started.elapsed() < Duration::from_secs(120) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

/// A swing of all joints of `seconds` seconds, from rest to rest.
fn trajectory(file: &Path, seconds: usize) {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for k in 0..=200 * seconds {
        let t = k as f64 * 0.005;
        let q = 0.3 * (1.0 - (std::f64::consts::TAU * t / 10.0).cos());
        text.push_str(&format!("{t:.6},{q:.9},{q:.9},{q:.9},{q:.9},{q:.9},{q:.9}\n"));
    }
    std::fs::write(file, text).unwrap();
}

#[cfg(feature = "parquet")]
#[test]
fn a_killed_recording_is_there_and_becomes_parquet_next_time() {
    let folder = scratch("killed_record");
    let (long, short, log) = (folder.join("long.csv"), folder.join("short.csv"), folder.join("log.parquet"));
    // Far longer than until it is killed.
    trajectory(&long, 400);
    trajectory(&short, 10);
    let lines = folder.join("log.parquet.csv");
    let arguments = |path: &Path| -> Vec<String> {
        let text = |p: &Path| p.to_str().unwrap().to_string();
        ["record", "--trajectory", &text(path), "--out", &text(&log)].map(String::from).to_vec()
    };
    let record = arguments(&long);
    let record: Vec<&str> = record.iter().map(String::as_str).collect();
    kill_when(&record, &lines, 700_000);
    // Right after the kill: every whole line is a sample, at the rate of the arm.
    let left = read(&lines);
    let whole = std::fs::read_to_string(&lines).unwrap().matches('\n').count() - 1;
    assert_eq!(left.t.len(), whole);
    assert!(whole > 1000 && left.pieces.len() == 1 && !log.exists());

    let next = arguments(&short);
    let next: Vec<&str> = next.iter().map(String::as_str).collect();
    let output = powerball(&next).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("log.interrupted-1.parquet"), "{said}");
    let recovered = read(&folder.join("log.interrupted-1.parquet"));
    assert_eq!((recovered.t, recovered.q, recovered.torque), (left.t, left.q, left.torque));
    assert_eq!(read(&log).t.len(), 2001);
    assert!(!lines.exists());
}

#[test]
fn a_killed_warm_up_goes_on_with_what_it_saw() {
    let folder = scratch("killed_warm_up");
    let (out, csv) = (folder.to_str().unwrap().to_string(), folder.join("warm_up.csv"));
    let warm_up = |more: &[&str]| -> Vec<String> {
        // Twice the usual tolerance is reached in half the time.
        let base = ["warm-up", "--out", &out, "--json", "--tolerance", "0.02"].map(String::from).to_vec();
        base.into_iter().chain(more.iter().map(|m| m.to_string())).collect()
    };
    let run = |more: &[&str]| -> (Option<i32>, Value) {
        let arguments = warm_up(more);
        let output = powerball(&arguments.iter().map(String::as_str).collect::<Vec<_>>()).output().unwrap();
        (output.status.code(), serde_json::from_slice(&output.stdout).unwrap())
    };
    let arguments = warm_up(&[]);
    kill_when(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), &csv, 4_000_000);
    let before = std::fs::read_to_string(&csv).unwrap();
    assert!(!folder.join("warm_up.json").exists());

    // Not warm yet: the next run keeps that too and goes on.
    let (code, printed) = run(&["--most", "150"]);
    assert_eq!((code, &printed["warm"]), (Some(1), &Value::Bool(false)));
    let (code, printed) = run(&[]);
    assert_eq!((code, &printed["warm"]), (Some(0), &Value::Bool(true)));
    let after = std::fs::read_to_string(&csv).unwrap();
    let whole = before.rfind('\n').unwrap();
    assert_eq!(after[..whole], before[..whole]);
    let times: Vec<f64> =
        after.lines().skip(1).map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(times.windows(2).all(|w| w[1] > w[0]));
    // Cycles from the very beginning count, and the time constant is the plant's 120 s all the same.
    let joint = &printed["joints"][3];
    assert!(joint["cycles"][0][0].as_f64().unwrap() < 5.0);
    let found = joint["exponential"]["time_constant"].as_f64().unwrap();
    assert!((100.0..140.0).contains(&found), "{found}");

    // One that is warm is not gone on with.
    let (_, printed) = run(&["--most", "20"]);
    assert!(printed["seconds"].as_f64().unwrap() < 30.0);
}

/// Ctrl-C, twice: the arm is stopped, the log is closed and whole, and the reason is printed.
#[cfg(all(unix, feature = "parquet"))]
#[test]
fn a_signal_stops_the_arm_and_closes_the_log() {
    let folder = scratch("signalled_record");
    for signal in ["-INT", "-TERM", "-HUP"] {
        let path = |name: &str| folder.join(name).display().to_string();
        let (motion, log) = (path("motion.csv"), path(&format!("log{signal}.parquet")));
        // Far longer than until the signal comes.
        trajectory(Path::new(&motion), 600);
        let lines = PathBuf::from(format!("{log}.csv"));
        let child = powerball(&["record", "--trajectory", &motion, "--out", &log]).spawn().unwrap();
        let started = Instant::now();
        while std::fs::metadata(&lines).map_or(0, |m| m.len()) < 20_000 {
            assert!(started.elapsed() < Duration::from_secs(120));
            std::thread::sleep(Duration::from_millis(2));
        }
        for _ in 0..2 {
            let id = child.id().to_string();
            assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        }
        let ended = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(1), "{said}");
        assert!(said.contains("asked to end"), "{said}");
        assert!(!lines.exists(), "the log was not closed");
        assert!(read(Path::new(&log)).t.len() > 50);
    }
}

/// A disk that is full, or a limit of file sizes: the arm is stopped, and the reason is printed.
#[cfg(unix)]
#[test]
fn a_log_that_cannot_grow_stops_the_arm() {
    let folder = scratch("full_disk");
    let motion = folder.join("motion.csv");
    trajectory(&motion, 60);
    let script = format!(
        "ulimit -f 64; exec {} record --trajectory {} --out {}",
        env!("CARGO_BIN_EXE_powerball"),
        motion.display(),
        folder.join("log.csv").display()
    );
    let ended = Command::new("bash").args(["-c", &script]).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot be written"), "{said}");
    let log = std::fs::read_to_string(folder.join("log.csv")).unwrap();
    assert!(log.lines().count() > 100 && log.ends_with('\n'), "{} bytes", log.len());

    // A command that moves no arm says so too, and leaves nothing behind that it has half written.
    let script = format!(
        "ulimit -f 1; exec {} log {} --arm {} --to mcap --out {}",
        env!("CARGO_BIN_EXE_powerball"),
        folder.join("log.csv").display(),
        hardware(),
        folder.join("log.mcap").display()
    );
    let ended = Command::new("bash").args(["-c", &script]).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(2), "{said}");
    assert!(said.contains("log.mcap: cannot be written"), "{said}");
    let names =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let names: Vec<String> = names.filter(|name| name.contains("part") || name.contains("mcap")).collect();
    assert!(names.is_empty(), "{names:?}");
}
