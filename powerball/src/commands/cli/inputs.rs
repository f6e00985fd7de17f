//! What `identify` and `explain` share: an arm, logs, a folder for results.

use super::Failure;
use super::output::Progress;
use crate::explanation::torque_model::TorqueModel;
use crate::identification::mounting::Mounting;
use crate::logs::log::{Log, common_clock, read_logs};
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
    /// Logs to fit (CSV: t, q1…, tau1… or i1…); several, in the order in which they were recorded.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    pub log: Vec<PathBuf>,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

/// The arm and the logs of a command, read.
pub(crate) struct Loaded {
    pub body: RigidBody,
    pub fit: Vec<Log>,
    pub validate: Vec<Log>,
    pub warnings: Vec<String>,
    /// The model that was given.
    pub known: Option<TorqueModel>,
}

impl Loaded {
    /// Takes what is known out of the logs.
    pub(crate) fn take_out(&mut self) {
        if let Some(known) = &self.known {
            known.take_out(&self.body, &mut self.fit);
            known.take_out(&self.body, &mut self.validate);
        }
    }
}

/// An arm with what is known of it beforehand.
pub(crate) struct Known {
    /// The arm as the model has it.
    pub arm: Arm,
    model: Option<(TorqueModel, PathBuf)>,
}

impl Known {
    /// Reads an arm file and, where there is one, a model of the arm.
    pub(crate) fn read(arm: &Path, model: Option<&Path>) -> Result<Known, Failure> {
        Known::mounted(arm, model, Mounting::Filed)
    }

    /// The same for logs that were recorded with the base mounted otherwise.
    fn mounted(arm: &Path, model: Option<&Path>, mounting: Mounting) -> Result<Known, Failure> {
        let arm = Arm::read(arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let arm = mounting.of(&arm).map_err(Failure::Unusable)?;
        let Some(file) = model else { return Ok(Known { arm, model: None }) };
        let model = TorqueModel::read(file).map_err(|e| Failure::Unusable(e.to_string()))?;
        if mounting != Mounting::Filed && model.additions.arm_changes.gravity.is_some() {
            return Err(Failure::Unusable(format!(
                "{}: says how the base is tilted where it stands as filed, and nothing of it mounted \
                    otherwise",
                file.display()
            )));
        }
        let changed = model.additions.arm_changes.of(&arm);
        let arm = changed.map_err(|e| Failure::Unusable(format!("{}: {e}", file.display())))?;
        Ok(Known { arm, model: Some((model, file.to_path_buf())) })
    }

    /// The model, if it is one of this arm.
    pub(crate) fn model(self, body: &RigidBody) -> Result<Option<TorqueModel>, Failure> {
        let Some((model, file)) = self.model else { return Ok(None) };
        let checked = model.in_set_of(body).checked(body.names(), body.dof(), &file);
        checked.map(Some).map_err(|e| Failure::Unusable(e.to_string()))
    }
}

/// Reads and checks everything before any work is done. With a model the arm is as the model has it; the logs
/// are as they are, and all of one mounting of the base.
pub(crate) fn load(
    inputs: &Inputs,
    validate: &[PathBuf],
    model: Option<&Path>,
    mounting: Mounting,
    progress: &Progress,
) -> Result<Loaded, Failure> {
    let known = Known::mounted(&inputs.arm, model, mounting)?;
    let Recorded { fit, validate, warnings } = recorded(inputs, validate, &known.arm, progress)?;
    progress.say("deriving and proving the arm's dynamics");
    let body = RigidBody::new(&known.arm).map_err(|e| Failure::Refused(e.to_string()))?;
    let known = known.model(&body)?;
    Ok(Loaded { body, fit, validate, warnings, known })
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
    let (mut logs, findings) = read_logs(&files, arm).map_err(|e| Failure::Unusable(e.to_string()))?;
    warnings.extend(findings.iter().map(ToString::to_string));
    common_clock(&mut logs);
    let validate = logs.split_off(inputs.log.len());
    std::fs::create_dir_all(&inputs.out)
        .map_err(|e| Failure::Unusable(format!("{}: cannot be made: {e}", inputs.out.display())))?;
    Ok(Recorded { fit: logs, validate, warnings })
}

pub(super) fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}
