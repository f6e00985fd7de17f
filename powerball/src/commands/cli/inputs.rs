//! What `explain` reads: an arm, logs, what is known already; and a folder for results.

use super::Failure;
use super::output::{self, Progress};
use crate::explanation::torque_model::{ModelFile, TorqueModel};
use crate::identification::KnownModel;
use crate::identification::mounting::Mounting;
use crate::logs::log::{ColumnMap, Log, common_clock, read_logs_as};
use crate::logs::regression::RigidBody;
use clap::Args;
use dyngen::Arm;
use std::path::{Path, PathBuf};

/// Arm and logs.
#[derive(Args, Debug)]
pub(crate) struct Inputs {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    pub arm: PathBuf,
    /// Logs to fit (CSV, Parquet, MCAP, rosbag2 or npz: t, q1…, tau1… or i1…); several, in the order in which
    /// they were recorded.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub log: Vec<PathBuf>,
    #[command(flatten)]
    pub map: MapArgument,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

/// How the columns of logs are read.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct MapArgument {
    /// Which column is what, where names do not say it: a TOML file, or a line of it such as
    /// 'joints = ["a", "b"]', 'topic = "/joint_states"' or 'tau.sign = -1'. May be repeated.
    #[arg(long, value_name = "MAP.toml")]
    map: Vec<String>,
}

impl MapArgument {
    /// The map of all that was said.
    pub(crate) fn read(&self) -> Result<ColumnMap, Failure> {
        // Lines first: in a file they might fall into a table that it opened.
        let (lines, files): (Vec<&String>, Vec<&String>) =
            self.map.iter().partition(|said| said.contains('='));
        let mut text = lines.iter().map(|line| format!("{line}\n")).collect::<String>();
        for file in &files {
            let read = std::fs::read_to_string(file);
            text.push_str(&read.map_err(|e| Failure::Unusable(format!("{file}: cannot be read: {e}")))?);
        }
        let name = match (lines.as_slice(), files.as_slice()) {
            ([], [file]) => file.as_str(),
            _ => "--map",
        };
        ColumnMap::parse(&text, name).map_err(Failure::Unusable)
    }
}

/// An arm with what is known of it beforehand.
pub(crate) struct Known {
    /// The arm as the model has it.
    pub arm: Arm,
    model: Option<ModelFile>,
}

impl Known {
    /// Reads an arm file and, where there is one, a model of the arm.
    pub(crate) fn read(arm: &Path, model: Option<&Path>) -> Result<Known, Failure> {
        let arm = Arm::read(arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let Some(file) = model else { return Ok(Known { arm, model: None }) };
        let model = ModelFile::read(file).map_err(|e| Failure::Unusable(e.to_string()))?;
        let arm = model.arm(&arm, Mounting::Filed).map_err(Failure::Unusable)?;
        Ok(Known { arm, model: Some(model) })
    }

    /// The model, if it is one of this arm.
    pub(crate) fn model(self, body: &RigidBody) -> Result<Option<TorqueModel>, Failure> {
        let checked = self.model.map(|model| model.checked(body)).transpose();
        checked.map_err(|e| Failure::Unusable(e.to_string()))
    }
}

/// The logs of a command, on a common clock, and what was found in them and in the arm file.
pub(crate) struct Recorded {
    pub fit: Vec<Log>,
    pub validate: Vec<Log>,
    pub warnings: Vec<String>,
}

/// Reads the logs and makes the folder of the results.
pub(crate) fn recorded(
    inputs: &Inputs,
    validate: &[PathBuf],
    arm: &Arm,
    progress: &Progress,
) -> Result<Recorded, Failure> {
    let mut warnings = arm.notes();
    for file in validate {
        if inputs.log.iter().any(|log| same_file(log, file)) {
            let name = file.display();
            return Err(Failure::Unusable(format!(
                "{name} is given to --log and --validate: a log cannot judge its own fit"
            )));
        }
    }
    progress.say("reading logs");
    let files: Vec<&PathBuf> = inputs.log.iter().chain(validate).collect();
    let (mut logs, findings) =
        read_logs_as(&files, arm, &inputs.map.read()?).map_err(|e| Failure::Unusable(e.to_string()))?;
    warnings.extend(findings.iter().map(ToString::to_string));
    common_clock(&mut logs);
    let validate = logs.split_off(inputs.log.len());
    output::make_folder(&inputs.out)?;
    Ok(Recorded { fit: logs, validate, warnings })
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}
