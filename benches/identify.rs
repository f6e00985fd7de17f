//! A million samples of six joints identified from memory: this project's stream, compared with numpy and
//! Pinocchio in the same run.
//!
//! `cargo bench -p powerball-benches --bench identify` (`PYTHON=…` names an interpreter that has both;
//! without one only the stream is timed); `-- --write docs/results/performance.md` writes how the stream
//! grows with the length of a log into the page.

#![allow(clippy::unwrap_used, missing_docs)]

mod support;

use chacha20::ChaCha8Rng;
use dyngen::exact::rational::to_f64;
use powerball::controller::friction::{TABLE_2, TanhFriction};
use powerball::identification::estimate::{States, Stream};
use powerball::logs::regression::RigidArm;
use powerball_workspace::arm;
use rand::{RngExt, SeedableRng};
use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Write;
use std::process::Command;

const SAMPLES: usize = 1_000_000;
const ROUNDS: usize = 3;
/// Samples that are taken in at once where the length grows.
const BLOCK: usize = 10_000;

/// Seconds and peak memory of logs of several lengths, taken in blocks as a reader hands them on.
fn growth(body: &RigidArm) {
    let shapes: Vec<[f64; 2]> = TABLE_2.iter().map(|g| [g[1], g[3]]).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw = |scale: f64| -> Vec<f64> {
        (0..BLOCK * body.dof()).map(|_| scale * rng.random_range(-1.0..1.0)).collect()
    };
    let (q, dq, ddq, tau) = (draw(2.0), draw(1.0), draw(3.0), draw(10.0));
    let mut table = "| samples | s | peak memory of the program, MB |\n|---|---|---|\n".to_string();
    for blocks in [1, 10, 100] {
        let [time] = support::paired(
            ROUNDS,
            [&mut || {
                let mut stream = Stream::new(body, &shapes);
                for _ in 0..blocks {
                    stream.push(States { q: &q, dq: &dq, ddq: &ddq, tau: &tau });
                }
                black_box(stream.fit());
            }],
        );
        let memory = peak_memory().map_or("not known here".to_string(), |mb| format!("{mb:.0}"));
        let _ = writeln!(table, "| {} | {:.3} | {memory} |", blocks * BLOCK, time.as_secs_f64());
    }
    support::publish("identify-growth", &table);
}

/// The most memory that this program has held, MB, where Linux says so.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<f64>().ok()? / 1024.0)
}

fn main() {
    let arm = arm("arm");
    let body = RigidArm::new(&arm).unwrap();
    // First: the peak of memory never sinks again.
    growth(&body);
    let n = body.dof();
    let samples = std::env::var("SAMPLES").map_or(SAMPLES, |s| s.parse().unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut draw =
        |scale: f64| -> Vec<f64> { (0..samples * n).map(|_| scale * rng.random_range(-1.0..1.0)).collect() };
    let (q, dq, ddq) = (draw(2.0), draw(1.0), draw(3.0));
    let mut tau = draw(0.1);
    // Cylinders of a few kilograms: all that matters is that both fit the same torques.
    let values: Vec<f64> = (0..body.names().len()).map(|k| 0.5 + 0.1 * (k as f64).sin()).collect();
    for (k, (t, rigid)) in tau.iter_mut().zip(body.torque(&q, &dq, &ddq, &values)).enumerate() {
        *t += rigid + TanhFriction::new(TABLE_2[k % n]).torque(dq[k]);
    }
    let shapes: Vec<[f64; 2]> = TABLE_2.iter().map(|g| [g[1], g[3]]).collect();
    let mut fit = None;
    let [time] = support::paired(
        ROUNDS,
        [&mut || {
            let mut stream = Stream::new(&body, &shapes);
            stream.push(States { q: &q, dq: &dq, ddq: &ddq, tau: &tau });
            fit = Some(stream.fit());
        }],
    );
    let fit = fit.unwrap();
    let rms = (fit.rms.iter().map(|r| r * r).sum::<f64>() / n as f64).sqrt();
    let seconds = time.as_secs_f64();
    let columns = body.names().len() + 3 * n;
    println!("{samples} samples of {n} joints, from memory to estimates");
    println!("this project:        {seconds:8.3} s, {columns} columns, rms {rms:.4} N·m");

    let folder = std::env::temp_dir().join(format!("identify-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let dh: Vec<[f64; 4]> = arm
        .joints
        .iter()
        .map(|j| [to_f64(&j.a), j.alpha.radians(), to_f64(&j.d), j.theta.radians()])
        .collect();
    let gravity = arm.gravity.each_ref().map(to_f64);
    let head = serde_json::json!({ "dh": dh, "gravity": gravity, "steepness": shapes });
    std::fs::write(folder.join("arm.json"), head.to_string()).unwrap();
    let mut file = std::io::BufWriter::new(std::fs::File::create(folder.join("states.bin")).unwrap());
    for values in [&q, &dq, &ddq, &tau] {
        values.iter().for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
    }
    drop(file);
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/support/identify_numpy.py");
    let done = Command::new(&python).arg(script).arg(&folder).output();
    std::fs::remove_dir_all(&folder).unwrap();
    match done {
        Ok(done) if done.status.success() => {
            let peer: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
            let theirs = peer["seconds"].as_f64().unwrap();
            println!(
                "numpy and Pinocchio: {theirs:8.3} s, {} columns, rms {:.4} N·m (numpy {}, Pinocchio {})",
                peer["columns"],
                peer["rms"].as_f64().unwrap(),
                peer["numpy"],
                peer["pinocchio"]
            );
            println!("ratio:               {:8.1}", theirs / seconds);
        }
        _ => println!("numpy and Pinocchio: skipped, {python} does not have both (set PYTHON)"),
    }
}
