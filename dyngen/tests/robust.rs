//! Inputs that are damaged at random: never a panic, always a message, exit codes 0, 1 and 2 only.
//!
//! `DYNGEN_MUTANTS=100000 cargo test -p dyngen --test robust --release` looks longer than the default.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::export::{self, Known};
use dyngen::{Arm, Model, Values, import};
use rand::{RngExt, SeedableRng};
use std::path::Path;
use std::process::Command;

const ARM: &str = include_str!("../../tests/arms/planar2r.toml");
const GROUPED: &str = include_str!("../../powerball/arm.toml");
const URDF: &str = include_str!("urdf/fixed.urdf");
const STATES: &str = "q1,q2,dq1,dq2,ddq1,ddq2\n0.1,-0.2,1,2,3,4\n1e-3,2,0,0,0,0\n";

/// What people, tools and broken disks write in place of what belongs there.
const SPLINTERS: [&str; 32] = [
    "",
    "\0",
    "\n",
    "\"",
    "'",
    "[",
    "]",
    "[[",
    "{",
    "<",
    "</",
    "/>",
    "-",
    "--",
    "=",
    ",",
    "#",
    "NaN",
    "inf",
    "-inf",
    "1e400",
    "1e-400",
    "99999999999999999999999999",
    "-0",
    "pi",
    "pi/0",
    "0x10",
    "é",
    "\u{202e}",
    "true",
    "1979-05-27",
    "\\u0000",
];

/// A text with some places cut, doubled, moved or replaced.
fn damaged(text: &str, rng: &mut ChaCha8Rng) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for _ in 0..rng.random_range(1..4) {
        let at = rng.random_range(0..=chars.len());
        let longest = if rng.random_range(0..4) == 0 { 200 } else { 4 };
        let length = rng.random_range(0..longest);
        let end = (at + length).min(chars.len());
        let piece: Vec<char> = chars[at..end].to_vec();
        match rng.random_range(0..4) {
            0 => drop(chars.drain(at..end)),
            1 => drop(chars.splice(at..at, piece)),
            2 => {
                let splinter = SPLINTERS[rng.random_range(0..SPLINTERS.len())];
                chars.splice(at..end, splinter.chars());
            }
            _ => {
                chars.drain(at..end);
                let to = rng.random_range(0..=chars.len());
                chars.splice(to..to, piece);
            }
        }
    }
    chars.into_iter().collect()
}

fn mutants(default: usize) -> usize {
    std::env::var("DYNGEN_MUTANTS").ok().and_then(|n| n.parse().ok()).unwrap_or(default)
}

#[test]
fn damaged_arm_files_are_read_or_refused_with_places() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut read = 0;
    for i in 0..mutants(4000) {
        let text = damaged(if i % 2 == 0 { ARM } else { GROUPED }, &mut rng);
        match Arm::parse(&text, "arm.toml") {
            Ok(_) => read += 1,
            Err(e) => assert!(!e.0.is_empty() && e.0.iter().all(|d| !d.message.is_empty()), "{text}"),
        }
    }
    assert!(read > 0, "no mutant was an arm: the damage is too coarse to find anything");
}

#[test]
fn damaged_arms_that_are_still_arms_have_a_model_or_a_reason() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..mutants(300) {
        let text = damaged(ARM, &mut rng);
        if let Ok(arm) = Arm::parse(&text, "arm.toml")
            && let Err(e) = Model::derive(arm)
        {
            assert!(!e.to_string().is_empty(), "{text}");
        }
    }
}

#[test]
fn damaged_urdfs_are_imported_or_refused_with_reasons() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let options = import::Options { tip: Some("left_finger".to_string()), ..import::Options::default() };
    let mut read = 0;
    for _ in 0..mutants(1000) {
        let text = damaged(URDF, &mut rng);
        match import::urdf(&text, "robot.urdf", &options) {
            Ok(imported) => {
                read += 1;
                assert!(imported.values.iter().all(|(_, value)| value.is_finite()), "{text}");
            }
            Err(e) => assert!(e.to_string().starts_with("robot.urdf: "), "{e}\n{text}"),
        }
    }
    assert!(read > 0);
}

#[test]
fn damaged_mujoco_models_are_imported_written_or_refused_with_reasons() {
    const MJCF: &str = include_str!("mjcf/arm.xml");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let good = import::mjcf(MJCF, "", &import::Options::default()).unwrap();
    let known = Known::read(&good.arm, (&good.values_json(), "values.json"), None).unwrap();
    let (mut read, mut written) = (0, 0);
    for _ in 0..mutants(1000) {
        let text = damaged(MJCF, &mut rng);
        match import::mjcf(&text, "arm.xml", &import::Options::default()) {
            Ok(imported) => {
                read += 1;
                assert!(imported.values.iter().all(|(_, value)| value.is_finite()), "{text}");
            }
            Err(e) => assert!(e.to_string().starts_with("arm.xml: "), "{e}\n{text}"),
        }
        match export::mjcf(&text, "arm.xml", &good.arm, &known, &import::Options::default()) {
            Ok(_) => written += 1,
            Err(e) => assert!(e.to_string().starts_with("arm.xml: "), "{e}\n{text}"),
        }
    }
    assert!(read > 0 && written > 0);
}

#[test]
fn damaged_values_are_read_or_refused() {
    let values = import::urdf(URDF, "", &import::Options { tip: Some("hand".into()), ..Default::default() });
    let text = values.unwrap().values_json();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..mutants(2000) {
        let text = damaged(&text, &mut rng);
        if let Err(e) = Values::parse(&text, "values.json") {
            assert!(e.to_string().starts_with("values.json"), "{e}");
        }
    }
}

#[test]
fn the_command_ends_with_its_codes_whatever_it_reads() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("robust");
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    let [arm, urdf, values, states, out] =
        ["arm.toml", "robot.urdf", "values.json", "states.csv", "out.toml"].map(path);
    let names = "m mx my mz Ixx Ixy Ixz Iyy Iyz Izz Im".split(' ');
    let good: Vec<String> = names.flat_map(|n| [format!("\"{n}1\": 1.5"), format!("\"{n}2\": 2")]).collect();
    let good = format!("{{{}}}", good.join(", "));
    let files = [&arm, &urdf, &values, &states];
    let commands: [&[&str]; 5] = [
        &["describe", &arm, "--json"],
        &["eval", &arm, "--function", "inverse_dynamics", "--states", &states, "--values", &values],
        &["check", &arm, "--values", &values],
        &["generate", &arm, "-o", &out, "--functions", "gravity", "--force"],
        &["import", &urdf, "--tip", "hand", "-o", &out, "--force"],
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for i in 0..mutants(100) {
        let mut texts = [ARM.to_string(), URDF.to_string(), good.clone(), STATES.to_string()];
        let mut spoilt = None;
        if i > 0 {
            let which = rng.random_range(0..texts.len());
            texts[which] = damaged(&texts[which], &mut rng);
            spoilt = Some(files[which].as_str());
        }
        for (file, text) in files.iter().zip(&texts) {
            std::fs::write(file, text).unwrap();
        }
        // What reads only good files was asked in the first round.
        for command in commands.into_iter().filter(|c| spoilt.is_none_or(|file| c.contains(&file))) {
            let run = Command::new(env!("CARGO_BIN_EXE_dyngen")).args(command).output().unwrap();
            let said = String::from_utf8_lossy(&run.stderr);
            let code = run.status.code();
            // A damaged number may make an arm that is none: 3.
            let codes = if i > 0 { 0..=3 } else { 0..=2 };
            assert!(
                code.is_some_and(|code| codes.contains(&code)),
                "{command:?}: {code:?}: {said}\n{texts:#?}"
            );
            assert!(!said.contains("panicked"), "{command:?}: {said}\n{texts:#?}");
            // The first round is not damaged; check may find its values impossible, and says so on standard
            // output.
            assert!(i > 0 || code == Some(0) || command[0] == "check", "{command:?}: {said}");
            assert!(
                code == Some(0) || !said.is_empty() || !run.stdout.is_empty(),
                "{command:?} says nothing"
            );
        }
    }
}
