//! What `explain` reads: an arm, logs, what is known already; and a folder for results.

use super::Failure;
use super::output::{self, Progress};
use crate::explanation::torque_model::{ModelFile, TorqueModel};
use crate::identification::mounting::Mounting;
use crate::identification::{KnownModel, Recorded, Source};
use crate::logs::log::{ColumnMap, notes_of};
use crate::logs::regression::RigidArm;
use clap::Args;
use dyngen::Arm;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arm and logs.
#[derive(Args, Debug)]
pub(crate) struct Inputs {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    pub arm: PathBuf,
    /// Logs to fit (CSV, Parquet, MCAP, rosbag2, npz or mat: t, q1…, tau1… or i1…); several, in the order in which
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
        ColumnMap::said(&self.map).map_err(Failure::Unusable)
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
    pub(crate) fn model(self, body: &RigidArm) -> Result<Option<TorqueModel>, Failure> {
        let checked = self.model.map(|model| model.checked(body)).transpose();
        checked.map_err(|e| Failure::Unusable(e.to_string()))
    }
}

/// Reads the logs and makes the folder of the results.
pub(crate) fn recorded(
    inputs: &Inputs,
    validate: &[PathBuf],
    arm: &Arm,
    progress: &Progress,
) -> Result<Recorded, Failure> {
    progress.say("reading logs");
    let map = Arc::new(inputs.map.read()?);
    let sources = |files: &[PathBuf]| -> Vec<Source<'static>> {
        files.iter().map(|file| Source::file(file).mapped(Arc::clone(&map))).collect()
    };
    let mut read = Recorded::read(arm, &sources(&inputs.log), &sources(validate))?;
    read.warnings.splice(0..0, notes_of(arm));
    output::make_folder(&inputs.out)?;
    Ok(read)
}
