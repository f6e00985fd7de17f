//! How much memory reading a log takes, against what its arrays take. Prints the figures of docs/logs.md with
//! `--nocapture`.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic)]

use powerball::Log;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

const SAMPLES: usize = 300_000;
const JOINTS: usize = 7;
/// Of the arrays' size, at the peak.
const MOST: f64 = 1.5;
/// What libraries hold whatever a log's size, MB: buffers, a row group, windows of decompression.
const FIXED_MB: f64 = 8.0;

fn arm() -> dyngen::Arm {
    let joint = |k| {
        let turn = if k % 2 == 0 { "pi/2" } else { "-pi/2" };
        format!(
            "[[joint]]\nkind = \"revolute\"\nname = \"arm_joint_{}\"\na = 0.3\nalpha = \"{turn}\"\nd = 0.1\n\
            theta = 0\n",
            k + 1
        )
    };
    let joints: String = (0..JOINTS).map(joint).collect();
    let head = "name = \"seven\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n";
    dyngen::Arm::parse(&format!("{head}{joints}"), "seven.toml").unwrap()
}

fn log() -> Log {
    let t: Vec<f64> = (0..SAMPLES).map(|k| 0.001 * k as f64).collect();
    let wave = |j: usize, size: f64| {
        t.iter().map(|t| size * (t * (1.0 + 0.1 * j as f64)).sin()).collect::<Vec<f64>>()
    };
    Log {
        file: "made".into(),
        q: (0..JOINTS).map(|j| wave(j, 1.0)).collect(),
        torque: (0..JOINTS).map(|j| wave(j, 5.0)).collect(),
        temperature: None,
        motor: None,
        pieces: std::iter::once(0..SAMPLES).collect(),
        doubts: Vec::new(),
        clock: 0.0,
        t,
    }
}

/// An empty folder.
fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The log in each format, in a folder of that name.
fn written(folder: &str) -> [(&'static str, PathBuf); 3] {
    let (folder, made) = (scratch(folder), log());
    let names: Vec<String> = (1..=JOINTS).map(|j| format!("arm_joint_{j}")).collect();
    ["log.csv", "log.parquet", "log.mcap"].map(|name| {
        let file = folder.join(name);
        made.write_for(&file, &names).unwrap();
        (name, file)
    })
}

/// MB that the program holds now, and that it held at most.
fn held() -> [f64; 2] {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let of = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0
    };
    [of("VmRSS:"), of("VmHWM:")]
}

/// Run by the test below, in a program of its own for each file; `LOG` and `ARM_OF_LOG` are files.
#[test]
#[ignore = "a part of the test below"]
fn one() {
    let Ok(file) = std::env::var("LOG") else { return };
    let arm = match std::env::var("ARM_OF_LOG") {
        Ok(arm) => dyngen::Arm::read(Path::new(&arm)).unwrap(),
        Err(_) => arm(),
    };
    let (before, start) = (held()[0], Instant::now());
    let (log, _) = Log::read(&file, &arm).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let arrays = 8.0 * log.t.len() as f64 * (1 + log.q.len() + log.torque.len()) as f64 / f64::from(1 << 20);
    println!("\nfigures {} {arrays:.1} {:.1} {seconds:.2}", log.t.len(), held()[1] - before);
}

/// `powerball log` within that many kB of address space: its exit code and what it printed.
fn looked_at(file: &Path, more: &[&str], kilobytes: usize) -> (Option<i32>, String) {
    let command = format!("ulimit -v {kilobytes}; exec \"$@\"");
    let mut shell = Command::new("bash");
    shell.args(["-c", &command, "bash", env!("CARGO_BIN_EXE_powerball"), "log"]).arg(file).args(more);
    let start = Instant::now();
    let done = shell.output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(start.elapsed().as_secs_f64() < 5.0, "{}: {:?}", file.display(), start.elapsed());
    (done.status.code(), said)
}

/// Files that state that they are large: refused by the size they state, and not by what is left when it is
/// too late.
#[test]
fn what_needs_more_memory_than_is_allowed_is_refused_before_it_is_read() {
    const ADDRESSES: usize = 600_000;
    for (name, file) in written("log_refused") {
        let (code, said) = looked_at(&file, &["--memory", "10MB"], ADDRESSES);
        assert_eq!(code, Some(2), "{name}: {said}");
        for words in [name, "of memory, and a log may take 10.0 MB", "--memory"] {
            assert!(said.contains(words), "{name}: {said}");
        }
    }
    let folder = scratch("log_too_large");
    // 8 TB of zeros, none of them on the disk, and rows of nothing.
    let array = |name: &str, shape: &str, bytes: u64| {
        let head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let size = u16::try_from(head.len()).unwrap().to_le_bytes();
        let file = folder.join(name);
        std::fs::write(&file, [b"\x93NUMPY\x01\x00", &size[..], head.as_bytes()].concat()).unwrap();
        std::fs::OpenOptions::new()
            .write(true)
            .open(&file)
            .unwrap()
            .set_len(10 + head.len() as u64 + bytes)
            .unwrap();
        file
    };
    for file in [
        array("zeros.npy", "(1000000000000,)", 8_000_000_000_000),
        array("nothing.npy", "(1000000000000, 0)", 0),
    ] {
        let (code, said) = looked_at(&file, &[], ADDRESSES);
        assert_eq!(code, Some(2), "{}: {said}", file.display());
        assert!(said.contains(".0 TB of memory"), "{said}");
        std::fs::remove_file(&file).unwrap();
    }
    let wide = folder.join("wide.csv");
    let names: Vec<String> = (1..=100_000).map(|k| format!("q{k}")).collect();
    std::fs::write(&wide, format!("{}\n{}\n", names.join(","), vec!["0"; names.len()].join(","))).unwrap();
    let (code, said) = looked_at(&wide, &[], ADDRESSES);
    assert!(code == Some(2) && said.contains("wide.csv:1: header: 100000 columns: "), "{code:?} {said}");
}

/// What need not end is refused before it is opened.
#[test]
fn pipes_and_devices_are_no_logs_and_no_maps() {
    let folder = scratch("log_pipes");
    let (pipe, csv) = (folder.join("pipe"), folder.join("log.csv"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    std::fs::write(&csv, "t,q1\n0,0\n").unwrap();
    for input in [&pipe, Path::new("/dev/zero")] {
        let map = input.display().to_string();
        for (file, more) in [(input, &[][..]), (&csv, &["--map", &map][..])] {
            let (code, said) = looked_at(file, more, 600_000);
            assert!(
                code == Some(2) && said.contains(&map) && said.contains("a pipe or a device"),
                "{code:?} {said}"
            );
        }
    }
}

#[test]
fn a_log_is_read_in_little_more_memory_than_its_arrays_take() {
    for (name, file) in written("log_memory") {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "one", "--ignored", "--nocapture"])
            .env("LOG", &file)
            .env_remove("ARM_OF_LOG");
        let done = command.output().unwrap();
        let text = String::from_utf8_lossy(&done.stdout).into_owned();
        let figures =
            text.lines().find_map(|line| line.strip_prefix("figures ")).unwrap_or_else(|| panic!("{text}"));
        let figures: Vec<f64> = figures.split(' ').map(|x| x.parse().unwrap()).collect();
        let [samples, arrays, peak, seconds] = figures[..] else { panic!("{text}") };
        println!("{name}: {samples} samples, arrays of {arrays:.1} MB, {peak:.1} MB at most, {seconds:.2} s");
        assert_eq!(samples as usize, SAMPLES);
        assert!(peak <= MOST * arrays + FIXED_MB, "{name}: {peak} MB for arrays of {arrays} MB");
    }
}
