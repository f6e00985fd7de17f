//! `powerball export`: what was found, in the form of a robot's controller.

use super::{Failure, output};
use crate::report::load::{Form, Load};
use clap::Args;
use std::path::PathBuf;

/// Write the load that `explain` or `compare` found in the form of a robot's controller.
///
/// RESULT is explained.json with a payload on the last link, or comparison.json of two fits of one arm of which the
/// second one carries a load. What the form cannot hold is printed.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  powerball export --for ur out/explained.json -o payload.script")]
pub(crate) struct Export {
    /// Whose form.
    #[arg(long = "for", value_enum, value_name = "CONTROLLER")]
    form: Form,
    /// The result.
    #[arg(value_name = "RESULT.json")]
    result: PathBuf,
    /// The file to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Print what was written as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

impl Export {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let placed = |reason: String| format!("{}: {reason}", self.result.display());
        let text = dyngen::file::text(&self.result).map_err(|e| Failure::Unusable(placed(e.to_string())))?;
        let load = Load::of_result(&text).map_err(|e| Failure::Refused(placed(e)))?;
        let exported = load.export(self.form).map_err(|e| Failure::Refused(placed(e)))?;
        output::write_file(&self.output, exported.text.as_bytes())?;
        if self.json {
            let what = serde_json::json!({"file": self.output, "notes": exported.notes});
            output::print(&output::json(&what)?);
        } else {
            exported.notes.iter().for_each(|note| output::print(&format!("note: {note}")));
        }
        Ok(())
    }
}
