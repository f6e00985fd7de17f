//! `powerball explain`: the residual loop, from logs to explained.json and report.html.

use super::Failure;
use super::inputs::{Inputs, load};
use super::output::{self, Progress};
use crate::explain::{Explained, add_to_page, explain};
use crate::regression::DataOptions;
use crate::report::Page;
use clap::Args;
use std::path::PathBuf;

/// Find, name and add what the model lacks on logs; every addition is judged on another path.
///
/// Writes explained.json, report.html, and model.json: the model with what was named, for `powerball generate`, `verify` and the
/// next `identify` or `explain`.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball explain --arm arm.toml --log a.csv b.csv c.csv --validate d.csv --out result"
)]
pub(crate) struct Explain {
    #[command(flatten)]
    inputs: Inputs,
    /// Logs of another path, on which additions must hold.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    validate: Vec<PathBuf>,
    /// What is known already: model.json of an earlier `powerball explain` for the same arm file. It is taken out of the logs as it
    /// stands; what is found comes to it.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
}

impl Explain {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let mut loaded = load(&self.inputs, &self.validate, self.model.as_deref(), &progress)?;
        loaded.take_out();
        let say = |what: &str| progress.say(what);
        let mut explained =
            explain(&loaded.body, &loaded.fit, &loaded.validate, &DataOptions::default(), &say)
                .map_err(|e| Failure::Refused(e.to_string()))?;
        explained.warnings.splice(0..0, loaded.warnings);
        let text = output::json(&explained)?;
        output::write(&self.inputs.out, "explained.json", text.as_bytes())?;
        if let Some(known) = &loaded.known {
            explained.model.additions = known.additions.and(&explained.model.additions);
        }
        let model = output::json(&explained.model)?;
        output::write(&self.inputs.out, "model.json", model.as_bytes())?;
        let mut page = Page::new(format!("What the model of {} lacks", explained.arm));
        add_to_page(&mut page, &explained);
        output::write(&self.inputs.out, "report.html", page.to_html().as_bytes())?;
        if self.inputs.json {
            output::print(&text);
        } else {
            output::print(&summary(&explained));
        }
        Ok(())
    }
}

fn summary(explained: &Explained) -> String {
    let mut text = String::new();
    for warning in &explained.warnings {
        text.push_str(&format!("note: {warning}\n"));
    }
    let [low, high] = explained.band;
    text.push_str(&format!("\nErrors on the other path, {low} to {high} Hz\n"));
    text.push_str(&output::table(&[
        ("before", &explained.before.validate),
        ("after", &explained.after.validate),
    ]));
    text.push('\n');
    if explained.effects.is_empty() {
        text.push_str(
            "\nNo effect was accepted: these logs do not show that the model lacks anything with a name.\n",
        );
    }
    for effect in &explained.effects {
        let joints: Vec<String> = effect.joints.iter().map(ToString::to_string).collect();
        text.push_str(&format!(
            "\n{} on joint {}: {}\n  p = {:.1e}, margin {:.2} over the next name, {:.0} % of the excess left\n",
            effect.effect, joints.join(", "), effect.parameters, effect.p_value, effect.margin, 100.0 * effect.leftover
        ));
        for rival in &effect.rivals {
            text.push_str(&format!("  not {}: {}\n", rival.effect, rival.why_not));
        }
    }
    if let Some(unattributed) = &explained.unattributed {
        let joints: Vec<String> = unattributed.joints.iter().map(ToString::to_string).collect();
        text.push_str(&format!(
            "\nUnattributed on joint {}: depends on {}\n",
            joints.join(", "),
            unattributed.depends_on.join(", ")
        ));
    }
    let fp = &explained.false_positives;
    text.push_str(&format!("\n{} of {} placebos were accepted", fp.accepted, fp.placebos));
    text
}
