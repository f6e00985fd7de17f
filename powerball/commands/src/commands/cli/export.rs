//! `powerball export`: what was found, in the form of a robot's controller or of a simulator.

use super::exported_arm::{ArmForm, ArmResult};
use super::{Failure, output};
use crate::report::load::{Form, Load};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Write the load that `explain` or `compare` found in the form of a robot's controller, or the arm that
/// `identify` or `explain` found in the form of a simulator. What the form cannot hold is printed.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball export --for ur out/explained.json -o payload.script\n  \
    powerball export --for sdf out/identified.json -o arm.sdf")]
pub(crate) struct Export {
    /// Whose form.
    #[arg(long = "for", value_enum, value_name = "FORM")]
    form: Target,
    /// The result. For a controller: explained.json with a payload on the last link, or comparison.json of
    /// two fits of one arm of which the second one carries a load. For a simulator: identified.json,
    /// model.json, or explained.json next to its model.json.
    #[arg(value_name = "RESULT.json")]
    result: PathBuf,
    /// The arm file (TOML) that the result was identified with, for sdf, usd and fmu. Default: the path in
    /// identified.json or explained.json, else arm.toml next to the result.
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// The file to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Print what was written as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// A load for a controller, or the arm for a simulator.
#[derive(Clone, Copy, Debug)]
enum Target {
    Load(Form),
    Arm(ArmForm),
}

impl ValueEnum for Target {
    fn value_variants<'a>() -> &'a [Self] {
        const {
            &[
                Target::Load(Form::Franka),
                Target::Load(Form::Ur),
                Target::Load(Form::Kuka),
                Target::Load(Form::Kinova),
                Target::Load(Form::Doosan),
                Target::Load(Form::Xarm),
                Target::Arm(ArmForm::Sdf),
                Target::Arm(ArmForm::Usd),
                Target::Arm(ArmForm::Fmu),
            ]
        }
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Target::Load(form) => form.to_possible_value(),
            Target::Arm(form) => form.to_possible_value(),
        }
    }
}

impl Export {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let (bytes, notes) = match self.form {
            Target::Load(form) => load(form, &self.result)?,
            Target::Arm(form) => ArmResult::read(&self.result, self.arm.as_deref())?.export(form)?,
        };
        output::write_file(&self.output, &bytes)?;
        if self.json {
            let what = serde_json::json!({"file": self.output, "notes": notes});
            output::data(&output::json(&what)?);
        } else {
            notes.iter().for_each(|note| output::print(&format!("note: {note}")));
        }
        Ok(())
    }
}

/// The load of a result for a controller.
fn load(form: Form, result: &Path) -> Result<(Vec<u8>, Vec<String>), Failure> {
    let placed = |reason: String| format!("{}: {reason}", result.display());
    let text = dyngen::file::text(result).map_err(|e| Failure::Unusable(placed(e.to_string())))?;
    let load = Load::of_result(&text).map_err(|e| Failure::Refused(placed(e)))?;
    let exported = load.export(form).map_err(|e| Failure::Refused(placed(e)))?;
    Ok((exported.text.into_bytes(), exported.notes))
}
