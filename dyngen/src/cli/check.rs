//! `dyngen check`.

use super::{Failure, model, print};
use dyngen::Values;
use dyngen::consistency;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen check powerball/arm.toml --values powerball/table3.json")]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// Parameter values: a JSON file {"parameter": number, …} by the names of a set.
    #[arg(long, value_name = "FILE.json")]
    values: PathBuf,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let model = model(&args.arm)?;
    let (kind, values) =
        Values::read(&args.values).and_then(|v| v.recognise(&model)).map_err(Failure::input)?;
    let verdict = consistency::check(&model, kind, &values).map_err(Failure::refused)?;
    if args.json {
        let object = serde_json::json!({
            "possible": verdict.possible,
            "reasons": verdict.reasons,
            "pose": verdict.pose,
            "min_eigenvalue": verdict.min_eigenvalue,
        });
        print(&format!("{object}\n"))?;
    } else {
        let mut text = match verdict.possible {
            true => format!("possible: nothing speaks against these values of the {kind} set\n"),
            false => format!("not possible: no real arm has these values of the {kind} set\n"),
        };
        for reason in &verdict.reasons {
            text.push_str(&format!("  {reason}\n"));
        }
        let pose: Vec<String> = verdict.pose.iter().map(|q| format!("{q:.4}")).collect();
        text.push_str(&format!(
            "smallest eigenvalue of B(q): {:.6} at q = [{}]\n",
            verdict.min_eigenvalue,
            pose.join(", ")
        ));
        print(&text)?;
    }
    Ok(if verdict.possible { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
