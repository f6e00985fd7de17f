//! `powerball consistent`: published values made those of a real arm.

use super::Failure;
use super::output::{self, Progress};
use crate::identification::estimate::{TorqueMetric, nearest};
use clap::Args;
use dyngen::consistency;
use dyngen::{Arm, Model, SetKind, Values};
use serde::Serialize;
use std::collections::BTreeMap;
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

/// What was found.
#[derive(Serialize)]
struct Found {
    arm: String,
    set: &'static str,
    /// Whether the given values were a real arm's already, and why not.
    possible: bool,
    reasons: Vec<String>,
    /// rms of the torque between both over the arm's states, by joint, N·m.
    distance: Vec<f64>,
    /// The given set's values, before and after.
    values: Vec<Change>,
    /// Every parameter of the arm.
    parameters: BTreeMap<String, f64>,
    /// Smallest eigenvalue of each link's pseudo-inertia.
    eigenvalues: Vec<f64>,
    /// Links, from 1, whose declared symmetries no body can have.
    without_body: Vec<usize>,
}

#[derive(Serialize)]
struct Change {
    name: String,
    given: f64,
    consistent: f64,
}

/// Torques nearer than this count as the same, N·m.
const SAME: f64 = 1e-3;

impl ConsistentCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let unusable = |e: dyngen::Diagnostics| Failure::Unusable(e.to_string());
        let refused = |e: dyngen::Error| Failure::Refused(e.to_string());
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let values = Values::read(&self.values).map_err(unusable)?;
        progress.say("deriving the arm");
        let model = Model::derive(arm).map_err(refused)?;
        let (kind, given) = values.recognise(&model).map_err(unusable)?;
        let verdict = consistency::check(&model, kind, &given).map_err(refused)?;
        progress.say("looking for the nearest real arm");
        let metric = TorqueMetric::new(&model, kind).map_err(refused)?;
        let consistent = nearest(&model, kind, &given, &metric.matrix(SAME)).map_err(refused)?;
        let difference: Vec<f64> = consistent.set.iter().zip(&given).map(|(a, b)| a - b).collect();
        let names = model.set(kind).map_err(refused)?.names();
        let kept = model.arm().kept_parameters();
        let found = Found {
            arm: model.arm().name.clone(),
            set: set_name(kind),
            possible: verdict.possible,
            reasons: verdict.reasons,
            distance: metric.rms(&difference),
            values: names
                .into_iter()
                .zip(given.iter().zip(&consistent.set))
                .map(|(name, (given, consistent))| Change { name, given: *given, consistent: *consistent })
                .collect(),
            parameters: kept.iter().map(|p| (p.to_string(), consistent.all[p.index()])).collect(),
            eigenvalues: consistent.eigenvalues,
            without_body: consistent.without_body.iter().map(|l| l + 1).collect(),
        };
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

fn set_name(kind: SetKind) -> &'static str {
    match kind {
        SetKind::Full => "full",
        SetKind::Minimal => "minimal",
        SetKind::Symbolic => "symbolic",
        SetKind::Published => "published",
    }
}
