//! What the command reports about a format that it was built without. With the feature `formats` it reads
//! them: tests/logs.rs.

#![cfg(not(feature = "formats"))]
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::Path;
use std::process::{Command, Output};

fn data(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs_data").join(name).display().to_string()
}

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

#[test]
fn a_format_that_is_left_out_is_named_with_the_feature_that_reads_it() {
    for name in [
        "types.parquet",
        "lerobot_v30",
        "lerobot_v21/meta/info.json",
        "stored.mat",
        "v73.mat",
        "ros1_lz4.bag",
    ] {
        let (file, run) = (data(name), powerball(&["log", &data(name)]));
        let complaint = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{name}: {complaint}");
        assert!(
            complaint.contains(&file) && complaint.contains("`--features formats`"),
            "{name}: {complaint}"
        );
    }
}

#[test]
fn an_address_is_refused_with_the_feature_that_reads_it() {
    for address in ["s3://logs/day/log.csv", "http://127.0.0.1:9/log.mcap"] {
        let run = powerball(&["log", address]);
        let complaint = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{complaint}");
        assert!(complaint.contains(address) && complaint.contains("`--features formats`"), "{complaint}");
    }
}

/// What else is in the file is read.
#[test]
fn messages_in_protobuf_are_counted_and_named() {
    let run = powerball(&["log", &data("protobuf.mcap")]);
    let text = String::from_utf8_lossy(&run.stdout).into_owned() + &String::from_utf8_lossy(&run.stderr);
    assert!(text.contains("messages could not be read") && text.contains("`--features formats`"), "{text}");
}

/// Nothing is recorded into a file that could not be written at the end.
#[test]
fn a_recording_in_a_format_that_is_left_out_does_not_begin() {
    let folder = std::env::temp_dir().join(format!("powerball_left_out_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let motion = folder.join("motion.csv");
    std::fs::write(&motion, "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n0.005,0,0,0,0,0,0\n").unwrap();
    let out = folder.join("log.parquet");
    let run = powerball(&[
        "record",
        "--trajectory",
        motion.to_str().unwrap(),
        "--bus",
        "virtual",
        "--out",
        out.to_str().unwrap(),
    ]);
    let complaint = String::from_utf8_lossy(&run.stderr).into_owned();
    assert_eq!(run.status.code(), Some(2), "{complaint}");
    assert!(complaint.contains("`--features formats`"), "{complaint}");
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}
