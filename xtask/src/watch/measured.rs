//! What a watch reports about measured logs, with models of other logs of the same arm.

use super::{events, explained};
use dyngen::Arm;
use powerball::explanation::watch::WatchOptions;
use powerball::logs::log::{Log, read_logs};
use std::path::{Path, PathBuf};

/// Which logs a model is made of, and which are watched.
struct Case {
    folder: &'static str,
    fit: &'static [&'static str],
    validate: &'static [&'static str],
    watched: &'static [&'static str],
}

const CASES: [Case; 2] = [
    Case {
        folder: "ur10e",
        fit: &["fourier_12a", "fourier_12b", "fourier_5", "fourier_7", "fourier_8"],
        validate: &["fourier_12c"],
        watched: &["fourier_14", "joint_1", "joint_2", "joint_3", "fourier_14_load"],
    },
    Case {
        folder: "ur5_pushes",
        fit: &["no6", "no7", "no8"],
        validate: &["no9"],
        watched: &["no9", "no9_pushed"],
    },
];

/// Prints the events of each log.
pub(super) fn run(data: &Path) -> Result<(), String> {
    for Case { folder, fit, validate, watched } in &CASES {
        let folder = data.join(folder);
        let arm = Arm::read(&folder.join("arm.toml")).map_err(|e| e.to_string())?;
        let read = |names: &[&str]| -> Result<Vec<Log>, String> {
            let files: Vec<PathBuf> = names.iter().map(|name| folder.join(format!("{name}.csv"))).collect();
            Ok(read_logs(&files, &arm).map_err(|e| e.to_string())?.0)
        };
        let (body, model) = explained(&arm, &read(fit)?, &read(validate)?)?;
        for log in read(watched)? {
            println!("{}: {:.0} s", log.file, log.t.last().unwrap_or(&0.0) - log.t.first().unwrap_or(&0.0));
            for event in events(&body, &model, &WatchOptions::default(), &log) {
                println!("  {} (left {:.2})", event.sentence(body.arm()), event.evidence.left);
            }
        }
    }
    Ok(())
}
