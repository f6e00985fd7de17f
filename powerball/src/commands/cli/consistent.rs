//! `powerball consistent`: published values made those of a real arm.

use super::{Failure, output};
use crate::identification::{NearestError, nearest_arm};
use crate::logs::Progress;
use clap::Args;
use dyngen::{Arm, Values};
use std::path::PathBuf;

/// Find the nearest parameters that a real arm can have.
///
/// Values of any parameter set (a paper's, or those of identified.json) need not be a body's. Of all real
/// arms the one is found whose torques come nearest to theirs, over states within the arm's limits. Writes
/// its parameters as values for `dyngen generate --values`, and says how far they are.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  powerball consistent --arm arm.toml --values table3.json --out \
        consistent.json\n  dyngen generate arm.toml -o arm.rs --values consistent.json")]
pub(crate) struct ConsistentCommand {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// The values: {"parameter": number, …}, or identified.json.
    #[arg(long, value_name = "FILE.json")]
    values: PathBuf,
    /// The values to write.
    #[arg(long, value_name = "FILE.json")]
    out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

impl ConsistentCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let values = Values::read(&self.values).map_err(|e| Failure::Unusable(e.to_string()))?;
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let found = nearest_arm(&arm, &values, Progress::to(&say)).map_err(|e| match e {
            NearestError::Values(e) => Failure::Unusable(e.to_string()),
            NearestError::Model(e) => Failure::Refused(e.to_string()),
        })?;
        output::write_file(&self.out, output::json(&found.parameters)?.as_bytes())?;
        if self.json {
            output::print(&output::json(&found)?);
            return Ok(());
        }
        for reason in &found.reasons {
            output::print(&format!("no real arm can have the given values: {reason}"));
        }
        let distance: Vec<String> = found.distance.iter().map(|d| format!("{d:.3}")).collect();
        output::print(&format!(
            "torque between the given values and the nearest real arm's, rms by joint: {} N·m",
            distance.join(", ")
        ));
        for link in &found.without_body {
            output::print(&format!(
                "note: no body can have the symmetries that the file declares of link {link}"
            ));
        }
        Ok(())
    }
}
