//! `powerball explain`: the residual loop, from logs to explained.json and report.html.

use super::Failure;
use super::bus::{Where, virtual_bus};
use super::inputs::{Inputs, load};
use super::output::{self, Progress};
use crate::bus::driver::lwa4p::LWA4P;
use crate::bus::transport::{Bus, BusUrl};
use crate::explanation::experiment::{self, TRAJECTORY};
use crate::explanation::explain::{Change, ExplainError, Explained, Options, explain_with};
use crate::identification::motion::Motion;
use crate::logs::log::read_logs;
use crate::logs::regression::DataOptions;
use crate::procedure::{RecordError, record};
use crate::report::Page;
use crate::report::explained::add_to_page;
use crate::virtual_arm::Undeclared;
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Find, name and add what the model lacks on logs; every addition is judged on another path.
///
/// Writes explained.json, report.html, and model.json: the model with what was named, for `powerball
/// generate`, `verify` and the next `identify` or `explain`. Where two names fit equally well, also
/// next_experiment.csv: the trajectory on which they differ most. With --experiment THE ARM MOVES along it.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball explain --arm arm.toml --log a.csv b.csv c.csv --validate d.csv \
        --out result\n\n\
    On the virtual arm, from logs to a decision between two names that fit alike:\n  \
    powerball demo --effect asymmetry --seed 3 --out demo\n  \
    powerball explain --arm demo/arm.toml --log demo/fit_*.csv --validate demo/held_out_*.csv --out again \
    --experiment"
)]
pub(crate) struct Explain {
    #[command(flatten)]
    inputs: Inputs,
    /// Logs of another path, on which additions must hold.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    validate: Vec<PathBuf>,
    /// What is known already: model.json of an earlier `powerball explain` for the same arm file. It is taken
    /// out of the logs as it stands; what is found comes to it.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
    /// Where two names fit equally well, record the experiment that tells them apart, and explain again with
    /// its log.
    #[arg(long)]
    experiment: bool,
    /// Where something stays without a name, fit a bounded curve of the one or two signals that it depends on
    /// most; kept where errors fall that it was not fitted to.
    #[arg(long)]
    correct_unattributed: bool,
    /// The bus that the arm of the experiment is on.
    #[arg(long, value_name = "URL", default_value = "virtual", requires = "experiment")]
    bus: BusUrl,
    /// What is undeclared in the virtual arm, where it is on --bus virtual: as `powerball demo` writes it;
    /// without, the file virtual_arm.json beside the arm file.
    #[arg(long, value_name = "FILE", requires = "experiment")]
    plant: Option<PathBuf>,
}

impl Explain {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let arm = if self.experiment { Some(self.arm()?) } else { None };
        let mut loaded = load(&self.inputs, &self.validate, self.model.as_deref(), &progress)?;
        loaded.take_out();
        let (say, options) = (|what: &str| progress.say(what), DataOptions::default());
        let told = Options { correct_unattributed: self.correct_unattributed, ..Options::default() };
        let refused = |e: ExplainError| Failure::Refused(e.to_string());
        let mut explained = explain_with(&loaded.body, &loaded.fit, &loaded.validate, &options, &told, &say)
            .map_err(refused)?;
        let motion = experiment::propose(&loaded.body, &mut explained, &options, &say);
        if let Some(motion) = &motion {
            output::write(&self.inputs.out, TRAJECTORY, motion.to_csv().as_bytes())?;
        }
        match (arm, motion) {
            (Some((arm, note)), Some(motion)) => {
                progress.say("recording the experiment");
                let file = self.inputs.out.join("experiment.csv");
                self.record(&motion, arm, &file)?;
                let (mut new, findings) =
                    read_logs(&[&file], loaded.body.arm()).map_err(|e| Failure::Refused(e.to_string()))?;
                loaded.warnings.extend(findings.iter().map(ToString::to_string).chain(note));
                if let Some(known) = &loaded.known {
                    known.take_out(&loaded.body, &mut new);
                }
                let old = (loaded.fit.as_slice(), loaded.validate.as_slice());
                for new in new {
                    explained = experiment::learn(&loaded.body, old, new, &explained, &options, &told, &say)
                        .map_err(refused)?;
                }
                // What is still open may ask for another experiment.
                if let Some(next) = experiment::propose(&loaded.body, &mut explained, &options, &say) {
                    output::write(&self.inputs.out, TRAJECTORY, next.to_csv().as_bytes())?;
                }
            }
            (Some(_), None) => loaded.warnings.push(
                "--experiment: nothing was recorded: these logs leave no names open that a path within the \
                    arm file's limits could \
                 tell apart"
                    .to_string(),
            ),
            (None, _) => {}
        }
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

impl Explain {
    /// The bus of the experiment, opened before any work is done, and what there is to say of it.
    fn arm(&self) -> Result<(Box<dyn Bus>, Option<String>), Failure> {
        if self.bus != BusUrl::Virtual {
            if self.plant.is_some() {
                return Err(Failure::Unusable("--plant is for --bus virtual".to_string()));
            }
            return Ok((self.place().open()?, None));
        }
        let beside = self.inputs.arm.with_file_name(Undeclared::FILE);
        let file = self.plant.clone().or_else(|| beside.is_file().then_some(beside));
        let Some(file) = file else {
            let note = "the experiment was recorded on the built-in virtual arm, which has no undeclared \
                effect: it says \
                        nothing of another arm; name that one's bus by --bus, or the virtual arm's file by \
                        --plant";
            return Ok((self.place().open()?, Some(note.to_string())));
        };
        let arm = Undeclared::read(&file).map_err(Failure::Unusable)?.arm([0.0; 6], 1, false);
        let note = format!("the experiment was recorded on the virtual arm of {}", file.display());
        Ok((virtual_bus(arm.map_err(|e| Failure::Refused(e.to_string()))?)?, Some(note)))
    }

    fn place(&self) -> Where {
        Where { bus: self.bus.clone(), json: self.inputs.json }
    }

    fn record(&self, motion: &Motion, bus: Box<dyn Bus>, file: &Path) -> Result<(), Failure> {
        if motion.dof() != LWA4P.joints.len() {
            return Err(Failure::Unusable(format!(
                "--experiment: the driver's arm has {} joints, the arm file has {}; {TRAJECTORY} is written, \
                    record it with the \
                 arm's own driver",
                LWA4P.joints.len(),
                motion.dof()
            )));
        }
        let master = self.place().driver(bus)?;
        let mut log = std::fs::File::create(file)
            .map_err(|e| Failure::Unusable(format!("{}: cannot be written: {e}", file.display())))?;
        record(master, motion, |_| None, &mut log).map(|_| ()).map_err(|e| match e {
            RecordError::Write(_) => Failure::Unusable(e.to_string()),
            other => Failure::Refused(format!("the experiment was not recorded: {other}")),
        })
    }
}

/// What the logs leave open and what an experiment decided, in words; empty where there is nothing of the
/// kind.
pub(super) fn open_in_words(explained: &Explained) -> String {
    let mut text = String::new();
    let of = |value: &Option<Value>, key: &str| -> Option<String> {
        value.as_ref()?.get(key)?.as_str().map(str::to_string)
    };
    if let Some(why) = of(&explained.experiment, "why") {
        match of(&explained.experiment, "decided") {
            Some(name) => text.push_str(&format!("\nThe experiment decides for {name}: {why}\n")),
            None => text.push_str(&format!("\nThe experiment does not decide: {why}\n")),
        }
    }
    if let Some(advice) = of(&explained.next_experiment, "advice") {
        text.push_str(&format!("\nNext experiment: {advice}\n"));
    }
    text
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
    let whole = |share: f64| format!("{:+.0}", 100.0 * share);
    let change = |c: &Change| {
        format!("joint {} {} % ({} to {})", c.joint, whole(c.rms), whole(c.interval[0]), whole(c.interval[1]))
    };
    let changes: Vec<String> = explained.held_out_change.iter().map(change).collect();
    text.push_str(&format!("\nchange with its 95 % interval: {}\n", changes.join(", ")));
    if explained.effects.is_empty() {
        text.push_str(
            "\nNo effect was accepted: these logs do not show that the model lacks anything with a name.\n",
        );
    }
    for effect in &explained.effects {
        let joints: Vec<String> = effect.joints.iter().map(ToString::to_string).collect();
        text.push_str(&format!(
            "\n{} on joint {}: {}\n  p = {:.1e}, margin {:.2} over the next name, {:.0} % of the excess \
                left\n",
            effect.effect,
            joints.join(", "),
            effect.parameters,
            effect.p_value,
            effect.margin,
            100.0 * effect.leftover
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
        for c in unattributed.correction.iter().flatten() {
            let signals: Vec<&str> = c.curves.iter().map(|curve| curve.signal.as_str()).collect();
            text.push_str(&format!(
                "  a curve of {} within ±{:.2} N·m lowers the held-out error of joint {} from {:.4} to {:.4} \
                    N·m\n",
                signals.join(" and "),
                c.limit,
                c.joint,
                c.rms_before,
                c.rms_after
            ));
        }
        if unattributed.correction.as_ref().is_some_and(Vec::is_empty) {
            text.push_str("  no curve of these signals lowers held-out errors: none is kept\n");
        }
    }
    text.push_str(&open_in_words(explained));
    let fp = &explained.false_positives;
    text.push_str(&format!("\n{} of {} placebos were accepted", fp.accepted, fp.placebos));
    text
}
