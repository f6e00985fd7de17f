//! The event log of a program that moves an arm, and what shells and `man` know of the programs.

#![allow(clippy::unwrap_used, clippy::panic)]

use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Output};

fn powerball(arguments: &[&str], log_level: Option<&str>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command.args(arguments).env_remove("RUST_LOG");
    log_level.map(|level| command.env("RUST_LOG", level));
    command.output().unwrap()
}

/// A folder of this test alone, empty.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("events").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn events(file: &PathBuf) -> Vec<Value> {
    let text = std::fs::read_to_string(file).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect()
}

fn messages(events: &[Value]) -> Vec<&str> {
    events.iter().map(|event| event["message"].as_str().unwrap()).collect()
}

const ENABLE: [&str; 4] = ["bus", "enable", "--hold", "0.1"];

#[test]
fn a_run_is_in_the_file_from_its_command_to_its_end() {
    let file = folder("run").join("events.jsonl");
    let enable = [&ENABLE[..], &["--events", file.to_str().unwrap()]].concat();
    assert!(powerball(&enable, None).status.success());
    let found = events(&file);
    let said = messages(&found);
    assert!(said[0].starts_with("powerball bus enable --hold 0.1"), "{said:?}");
    // The phases of the driver, in the order of docs/bus.md.
    let mut phases = said.iter().filter_map(|text| text.strip_prefix("the driver "));
    for phase in ["configures the nodes", "is ready, not enabled", "is running", "is stopping"] {
        assert!(phases.any(|found| found == phase), "{phase}: {said:?}");
    }
    let last = found.last().unwrap();
    assert_eq!((last["message"].as_str(), last["exit"].as_i64()), (Some("done"), Some(0)));
    for event in &found {
        assert!(event["timestamp"].as_str().unwrap().ends_with('Z') && event["level"] != "DEBUG", "{event}");
    }
    // The next run is added, with more where more is asked for.
    assert!(powerball(&enable, Some("debug")).status.success());
    let more = events(&file);
    assert_eq!(more[..found.len()], found);
    let states = more.iter().filter(|event| event["level"] == "DEBUG" && event["joint"] == 6);
    let states: Vec<&str> = states.map(|event| event["message"].as_str().unwrap()).collect();
    assert!(states.contains(&"joint 6: the drive is operation enabled"), "{states:?}");
}

#[test]
fn an_end_that_is_an_error_is_an_event_of_that_level() {
    let file = folder("error").join("events.jsonl");
    let path = ["--events", file.to_str().unwrap()];
    let output =
        powerball(&[&["record", "--trajectory", "absent.csv", "--out", "log.csv"], &path[..]].concat(), None);
    assert_eq!(output.status.code(), Some(2));
    let found = events(&file);
    let last = found.last().unwrap();
    assert_eq!((last["level"].as_str(), last["exit"].as_i64()), (Some("ERROR"), Some(2)));
    assert!(last["message"].as_str().unwrap().starts_with("absent.csv: "), "{last}");
    // A person reads it once.
    assert_eq!(String::from_utf8_lossy(&output.stderr).matches("absent.csv").count(), 1);
}

#[test]
fn levels_choose_what_is_on_standard_error() {
    let seen = |more: &[&str], level| {
        let output = powerball(&[&ENABLE[..], more].concat(), level);
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(!seen(&[], None).contains("the driver"));
    assert!(seen(&["-v"], None).contains("powerball: info: the driver is running"));
    assert!(
        seen(&["--quiet"], Some("powerball::bus=debug")).contains("powerball: debug: joint 1: the drive is")
    );
}

#[test]
fn events_that_cannot_be_kept_are_refused_before_anything_moves() {
    let output = powerball(&[&ENABLE[..], &["--events", "/absent/events.jsonl"]].concat(), None);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("/absent/events.jsonl: events cannot be added") && !said.contains("enabled"),
        "{said}"
    );
    let output = powerball(&ENABLE, Some("powerball=loud"));
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("RUST_LOG=powerball=loud"), "{output:?}");
}

/// Bash itself completes a word by the script.
#[test]
fn bash_completes_words_and_man_pages_have_every_command() {
    let folder = folder("shell");
    let script = powerball(&["completions", "bash"], None);
    assert!(script.status.success());
    std::fs::write(folder.join("powerball.bash"), &script.stdout).unwrap();
    let ask = "source powerball.bash; COMP_WORDS=(powerball identify --esti); COMP_CWORD=2; \
               _powerball powerball --esti identify; echo \"${COMPREPLY[@]}\"";
    let bash = Command::new("bash").arg("-c").arg(ask).current_dir(&folder).output();
    if let Ok(bash) = bash {
        assert_eq!(String::from_utf8_lossy(&bash.stdout).trim(), "--estimator", "{bash:?}");
    }
    let pages = folder.join("man1");
    assert!(powerball(&["man", pages.to_str().unwrap()], None).status.success());
    for page in ["powerball", "powerball-identify", "powerball-bus-sdo-read"] {
        let text = std::fs::read_to_string(pages.join(format!("{page}.1"))).unwrap();
        assert!(text.contains(&format!(".TH {page}")), "{text}");
    }
}
