//! Measured logs in which something is that their owners put there, or that a draw put there: what `explain`
//! reports about it. A question and its truth stand in a table; the page is made of the answers.

mod drawn;
mod owners;

use dyngen::Arm;
use powerball::explanation::{ExplainOptions, Explained, explain};
use powerball::logs::log::{Log, read_logs};
use powerball::logs::regression::RigidArm;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Where to read and to write.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The folder of the measured logs
    #[arg(long, default_value = "../shared/data")]
    data: PathBuf,
    /// How many effects are drawn
    #[arg(long, default_value_t = 200)]
    draws: u64,
    /// How many pairs of halves of clean logs are drawn
    #[arg(long, default_value_t = 30)]
    pairs: u64,
    /// The page
    #[arg(long, default_value = "docs/results/known_truth.md")]
    write: PathBuf,
}

/// Writes the page.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let mut page = String::from(HEAD);
    owners::write(&mut page, &arguments.data)?;
    drawn::write(&mut page, &arguments.data, arguments.draws, arguments.pairs)?;
    let Arguments { draws, pairs, .. } = arguments;
    let _ = write!(
        page,
        "\n\
        Made by `cargo run --release -p xtask -- known-truth --draws {draws} --pairs {pairs}`; draws are \
        seeded by their number.\n"
    );
    if let Some(folder) = arguments.write.parent() {
        fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    fs::write(&arguments.write, page).map_err(|e| format!("{}: {e}", arguments.write.display()))
}

const HEAD: &str = "# Measured logs with a known truth

Here `powerball explain` with its defaults is asked about logs of real arms whose truth is known: \
their owners, or a seeded draw, put something in. *Before*
and *after* are errors on the validation logs in percent of each joint's torque, of the base model \
and with all that was found. The textbook fit has Coulomb,
viscous and constant friction. PySINDy is sparse regression on the residual of a textbook's fit: all \
products of two of 1, sin q, cos q, velocities,
accelerations and their signs of all joints (`benches/sindy.py`, with Pinocchio's regressor; its \
base model and filters are its own, so its figures without a
term differ a little from the textbook's). Such a sum cannot say \"a mass on link 2 in this log\" or \
\"a push from 4.4 s on\". Its terms follow the path on which
they were found, and are wrong on other paths.

";

/// An arm with some of its logs.
struct Logs {
    arm: Arm,
    logs: Vec<Log>,
}

impl Logs {
    fn read(data: &Path, folder: &str, names: &[&str]) -> Result<Logs, String> {
        let folder = data.join(folder);
        let arm = Arm::read(&folder.join("arm.toml")).map_err(|e| e.to_string())?;
        let files: Vec<PathBuf> = names.iter().map(|name| folder.join(format!("{name}.csv"))).collect();
        let (mut logs, _) = read_logs(&files, &arm).map_err(|e| e.to_string())?;
        for (log, name) in logs.iter_mut().zip(names) {
            log.file = (*name).to_string();
        }
        Ok(Logs { arm, logs })
    }

    fn body(&self) -> Result<RigidArm, String> {
        RigidArm::new(&self.arm).map_err(|e| e.to_string())
    }

    /// What is reported where the last logs judge.
    fn explained(&self, fitted: usize) -> Result<Explained, String> {
        let (fit, validate) = self.logs.split_at(fitted);
        explain(&self.arm, fit, validate, &ExplainOptions::default()).map_err(|e| e.to_string())
    }
}
