//! `powerball identify`: from logs to identified.json.

use super::Failure;
use super::identify_page::page;
use super::inputs::{Inputs, load};
use super::output::{self, Progress};
use crate::estimate::{
    ConsistentReport, Folds, JointFriction, ParameterEstimate, Spread, consistent_fit, fit, identify, spread,
};
use crate::explain::curves;
use crate::regression::{Data, DataOptions};
use crate::torque_model::Additions;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Fit the minimal inertial set and the friction of every joint (Eq. 16) to logs.
///
/// Writes identified.json and report.html, and consistent.json: the nearest parameters that a real arm can have, as values
/// for `dyngen generate --values`.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball identify --arm arm.toml --log a.csv b.csv --validate c.csv --out result"
)]
pub(crate) struct Identify {
    #[command(flatten)]
    inputs: Inputs,
    /// Logs on which the fit is judged, on another path.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    validate: Vec<PathBuf>,
    /// What is known already: model.json of `powerball explain` for the same arm file. Inertial set and friction are fitted beside its
    /// effects, which stay as they are.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
}

/// identified.json.
#[derive(Serialize)]
pub(super) struct Identification {
    pub arm: String,
    pub set: &'static str,
    pub parameters: Vec<ParameterEstimate>,
    pub friction: Vec<JointFriction>,
    /// As in model.json, where a model was given.
    #[serde(flatten)]
    pub additions: Option<Additions>,
    pub fit: Spread,
    pub validate: Option<Spread>,
    pub physically_consistent: bool,
    pub consistent: ConsistentReport,
    pub band: [f64; 2],
    pub warnings: Vec<String>,
}

impl Identify {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let mut loaded = load(&self.inputs, &self.validate, self.model.as_deref(), &progress)?;
        loaded.take_out();
        let options = DataOptions::default();
        let refused = |e: crate::regression::DataError| Failure::Refused(e.to_string());
        progress.say("preparing signals");
        let data = Data::new(&loaded.body, &loaded.fit, &options).map_err(refused)?;
        progress.say("fitting");
        let folds = Folds::new(&data);
        let fitted = fit(&data, &folds, &[], None);
        let identified = identify(&data, &fitted);
        let mut warnings = loaded.warnings;
        warnings.extend(data.notes.iter().cloned());
        let mut shown = curves(&data, &fitted.residual, &fitted.residual);
        let validate = if loaded.validate.is_empty() {
            warnings
                .push("no log was given to --validate: the errors below are those of the fit itself".into());
            None
        } else {
            let data = Data::new(&loaded.body, &loaded.validate, &options).map_err(refused)?;
            let residual = fitted.residual_on(&data, &[]);
            shown = curves(&data, &residual, &residual);
            Some(spread(&data, &residual))
        };
        let undetermined: Vec<&str> =
            identified.parameters.iter().filter(|p| p.std.is_none()).map(|p| p.name.as_str()).collect();
        if !undetermined.is_empty() {
            warnings.push(format!(
                "these logs do not determine {}: they were set to 0; record a motion that excites them",
                undetermined.join("; ")
            ));
        }
        let values: Vec<f64> = identified.parameters.iter().map(|p| p.value).collect();
        let reasons = loaded.body.impossible(&values).map_err(|e| Failure::Refused(e.to_string()))?;
        warnings.extend(reasons.iter().map(|r| format!("no real arm can have these values: {r}")));
        progress.say("looking for the nearest real arm");
        let consistent = consistent_fit(&data, &fitted)
            .map_err(|e| Failure::Refused(e.to_string()))?
            .report(&data, &fitted);
        let result = Identification {
            arm: loaded.body.arm().name.clone(),
            set: "minimal",
            parameters: identified.parameters,
            friction: identified.friction,
            additions: loaded.known.map(|known| known.additions),
            fit: spread(&data, &fitted.residual),
            validate,
            physically_consistent: reasons.is_empty(),
            consistent,
            band: [0.0, data.band.cutoff],
            warnings,
        };
        let text = output::json(&result)?;
        output::write(&self.inputs.out, "identified.json", text.as_bytes())?;
        let values = output::json(&result.consistent.parameters)?;
        output::write(&self.inputs.out, "consistent.json", values.as_bytes())?;
        let page = page(&result, &shown, result.validate.is_some());
        output::write(&self.inputs.out, "report.html", page.to_html().as_bytes())?;
        if self.inputs.json {
            output::print(&text);
        } else {
            for warning in &result.warnings {
                output::print(&format!("note: {warning}"));
            }
            let mut columns = vec![("fit", &result.fit)];
            columns.extend(result.validate.as_ref().map(|s| ("held out", s)));
            output::print(&output::table(&columns));
        }
        Ok(())
    }
}
