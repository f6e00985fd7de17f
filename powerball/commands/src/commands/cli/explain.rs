//! `powerball explain`: the residual loop, from logs to explained.json and report.html.
//!
//! The file also has what `explain` prints.

use super::Failure;
use super::inputs::{Inputs, recorded, sources};
#[cfg(feature = "cli")]
use super::online::experiment::Experiment;
use super::output::{self, Accept, Progress, Verbosity, notes};
use super::servos::{self, Masses};
use crate::report;
use crate::report::explained::{change, nothing_named};
use crate::report::number;
use clap::Args;
use dyngen::Arm;
use powerball_controller::JointNumber;
#[cfg(feature = "cli")]
use powerball_explanation::experiment;
use powerball_explanation::experiment::TRAJECTORY;
use powerball_explanation::explain::{
    Explained, FEWEST_LOGS, FalsePositives, NamedEffect, Rival, Unattributed, Verdict,
};
use powerball_explanation::torque_model::TorqueModel;
use powerball_explanation::{ExplainError, ExplainOptions, Prepared};
use powerball_identification::Source;
use powerball_identification::servo::are_of_servos;
use powerball_logs as logs;
use powerball_logs::motion::Motion;
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
    /// What is known already: model.json of an earlier `powerball explain` for the same arm file. Its effects
    /// are removed from the logs unchanged; what is found is added.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
    /// Search again without each log in turn, of three or more: names that no more than half of these
    /// searches give are marked as seen in some logs. It takes that many times longer.
    #[arg(long)]
    leave_one_out: bool,
    /// Print how long each phase took, on standard error.
    #[arg(long)]
    timings: bool,
    #[command(flatten)]
    accept: Accept,
    #[command(flatten)]
    masses: Masses,
    #[cfg(feature = "cli")]
    #[command(flatten)]
    experiment: Experiment,
}

impl Explain {
    pub(crate) fn run(self, verbosity: Verbosity) -> Result<(), Failure> {
        let progress = Progress::timed(self.timings);
        let arm = Arm::read(&self.inputs.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let [fit, validate] = sources(&self.inputs, &self.validate)?;
        if are_of_servos(&fit, &arm) {
            return self.servos((&fit, &validate), &arm, &progress, verbosity);
        }
        #[cfg(feature = "cli")]
        let opened = self.experiment.opened(&self.inputs)?;
        let known = self.model.as_deref().map(TorqueModel::read).transpose();
        let known = known.map_err(|e| Failure::Unusable(e.to_string()))?;
        let recorded = recorded(&self.inputs, &self.validate, &arm, &progress)?;
        if self.leave_one_out && recorded.fit.len() < FEWEST_LOGS {
            return Err(Failure::Unusable(format!(
                "--leave-one-out takes {FEWEST_LOGS} logs or more, --log has {}: fewer logs show too little \
                 when one of them is left out",
                recorded.fit.len()
            )));
        }
        let say = |what: &str| progress.say(what);
        let leave_one_out = self.leave_one_out;
        let progress_of = logs::Progress::to(&say);
        let options =
            ExplainOptions { known, leave_one_out, progress: progress_of, ..ExplainOptions::default() };
        let refused = |e| self.failure(&e);
        let prepared = Prepared::new(&arm, &recorded.fit, &recorded.validate, &options).map_err(refused)?;
        let (mut explained, motion) = prepared.explained(&options).map_err(refused)?;
        self.write_trajectory(motion.as_ref())?;
        #[cfg(feature = "cli")]
        if let Some(opened) = opened {
            let (new, notes) = opened.recorded(motion.as_ref(), &arm, &self.inputs.out, &progress)?;
            let old = (prepared.logs.as_slice(), prepared.validate.as_slice());
            for new in prepared.without_known(new) {
                explained =
                    experiment::learn(&prepared.body, old, new, &explained, &options).map_err(refused)?;
            }
            if motion.is_some() {
                // What is still open may ask for another experiment.
                let next = experiment::propose(&prepared.body, &mut explained, &options);
                self.write_trajectory(next.as_ref())?;
            }
            explained.warnings.splice(0..0, notes);
        }
        explained.warnings.splice(0..0, recorded.warnings);
        explained.arm_file = Some(self.inputs.arm.display().to_string());
        progress.say("writing");
        self.write(&prepared.with_known(explained), verbosity)
    }

    /// As it is done for arms on position servos.
    fn servos(
        &self,
        logs: (&[Source<'_>], &[Source<'_>]),
        arm: &Arm,
        progress: &Progress,
        verbosity: Verbosity,
    ) -> Result<(), Failure> {
        #[cfg(feature = "cli")]
        let experiment = self.experiment.is_requested();
        #[cfg(not(feature = "cli"))]
        let experiment = false;
        if self.model.is_some() || self.leave_one_out || experiment {
            return Err(Failure::Unusable(
                "--model, --leave-one-out and --experiment take logs with torques; these are of position \
                servos (goal1 … and no torque)"
                    .into(),
            ));
        }
        output::make_folder(&self.inputs.out)?;
        let asked = servos::Asked {
            arm: (arm, &self.inputs.arm),
            masses: &self.masses,
            logs,
            out: &self.inputs.out,
            json: self.inputs.json,
            accept: self.accept,
        };
        servos::explain(&asked, progress, verbosity)
    }

    /// Writes the trajectory of the experiment that an explanation asks for.
    fn write_trajectory(&self, motion: Option<&Motion>) -> Result<(), Failure> {
        let Some(motion) = motion else { return Ok(()) };
        output::write(&self.inputs.out, TRAJECTORY, motion.to_csv().as_bytes())
    }

    /// Writes and prints the result.
    fn write(&self, explained: &Explained, verbosity: Verbosity) -> Result<(), Failure> {
        let files = report::explained::files(explained).map_err(Failure::Refused)?;
        output::write_all(&files, &self.inputs.out)?;
        let (arm, out) = (&self.inputs.arm, &self.inputs.out);
        match (self.inputs.json, verbosity.verbose) {
            (true, _) => output::data(&files.first()),
            (_, true) => output::print(&everything(explained, arm, out)),
            _ => output::print(&summary(explained, arm, out)),
        }
        self.accept.judge(&explained.unusable)
    }

    /// Why there is no explanation: a known model that cannot be used is a wrong input.
    fn failure(&self, e: &ExplainError) -> Failure {
        match (e, &self.model) {
            (ExplainError::Changes(_) | ExplainError::Known(_), Some(file)) => {
                Failure::Unusable(format!("{}: {e}", file.display()))
            }
            _ => Failure::Refused(e.to_string()),
        }
    }
}

// What `explain` prints: the answer first, in few lines; everything with `--verbose`.

/// Lines of the answer; names that find no room are counted.
const LINES: usize = 25;
/// Laws without a name that have a line.
const LAWS: usize = 2;
/// Other names that a line lists.
const RIVALS: usize = 3;
/// Logs unlike the others that have a line.
const LOGS: usize = 2;

/// The answer in at most [`LINES`] lines for an arm of seven joints. `arm` and `out` are the arm file and the
/// folder of the results, for the next command.
pub(super) fn summary(explained: &Explained, arm: &Path, out: &Path) -> String {
    let mut head = output::first_lines(&explained.unusable, explained.conventions.as_ref(), false);
    head.push(table(explained));
    let mut tail: Vec<String> = Vec::new();
    let laws = explained.laws.iter().take(LAWS);
    tail.extend(laws.map(|law| format!("no name on joint {}: {}", list(&law.joints), law.sentence())));
    tail.extend(explained.unattributed.as_ref().map(without_name));
    tail.extend(odd_logs(explained));
    if let Some(joints) = &explained.transmission {
        let count = joints.len();
        tail.push(format!(
            "what is between the motors' torques and the links', {count} joints: --verbose or the page"
        ));
    }
    tail.extend(decided(explained));
    tail.extend(notes(explained.warnings.len()));
    tail.push(format!("report: {}", out.join("report.html").display()));
    tail.push(format!("next: {}", next(explained, arm, out)));
    let used: usize = head.iter().chain(&tail).map(|line| line.lines().count()).sum();
    // One line counts those that have no room.
    head.extend(names(explained, LINES.saturating_sub(used + 1)));
    head.extend(tail);
    head.join("\n")
}

/// As [`summary`], with all evidence, rivals and notes.
pub(super) fn everything(explained: &Explained, arm: &Path, out: &Path) -> String {
    let first = output::first_lines(&explained.unusable, explained.conventions.as_ref(), true);
    let mut text = first.iter().map(|line| format!("{line}\n")).collect::<String>();
    let odd = explained.logs.iter().filter(|log| !log.like_the_others);
    odd.for_each(|log| text.push_str(&format!("{}\n", log.sentence())));
    for warning in &explained.warnings {
        text.push_str(&format!("note: {warning}\n"));
    }
    text.push_str(&table(explained));
    text.push('\n');
    text.push_str(&explained.verdict.iter().filter(|v| !v.advice.is_empty()).map(advice).collect::<String>());
    if explained.effects.is_empty() {
        text.push_str(&format!("{}\n", nothing_named(explained)));
    }
    for effect in &explained.effects {
        text.push_str(&evidence(effect, &explained.sliding));
    }
    for law in &explained.laws {
        text.push_str(&format!("no name on joint {}: {}\n", list(&law.joints), law.sentence()));
    }
    if let Some(rest) = &explained.unattributed {
        text.push_str(&format!("{}\n", without_name(rest)));
    }
    text.push_str(
        &explained.transmission.iter().flatten().map(|joint| joint.sentence() + "\n").collect::<String>(),
    );
    text.push_str(&open_in_words(explained));
    let FalsePositives { accepted, surrogates, without, .. } = &explained.false_positives;
    text.push_str(&format!(
        "{accepted} of {surrogates} effects that cannot be there were accepted (shifted in time)"
    ));
    if *without > 0 {
        text.push_str(&format!(
            "; constant torques are left out: {without}, as they are the same at every time"
        ));
    }
    text.push_str(&format!("\nreport: {}\n", out.join("report.html").display()));
    text.push_str(&format!("next: {}", next(explained, arm, out)));
    text
}

/// What the logs leave open and what an experiment decided, in words; empty where there is nothing of the
/// kind.
pub(super) fn open_in_words(explained: &Explained) -> String {
    let mut text = decided(explained).map_or_else(String::new, |line| line + "\n");
    if let Some(next) = &explained.next_experiment {
        text.push_str(&format!("Next experiment: {}\n", next.advice));
    }
    text
}

/// A line a joint: its error before and after on the logs to judge on, the change, what is left, the verdict.
fn table(explained: &Explained) -> String {
    let mut text =
        String::from("joint        before         after  change, 95 % interval     left  band, Hz  verdict");
    let (before, after) = (&explained.before.validate, &explained.after.validate);
    for verdict in &explained.verdict {
        let j = verdict.joint.index();
        let unit = if explained.sliding.get(j).copied().unwrap_or(false) { "N" } else { "N·m" };
        let cell = |rms: f64| format!("{} {unit}", number(rms));
        let changed = explained.held_out_change.iter().find(|c| c.joint == verdict.joint);
        text.push_str(&format!(
            "\n{:>5}  {:>12}  {:>12}  {:>21}  {:>7}  {:>8}  {}",
            verdict.joint.number(),
            cell(before.rms[j]),
            cell(after.rms[j]),
            changed.map_or_else(String::new, change),
            if verdict.left.is_nan() { "–".to_string() } else { format!("{:.1} %", 100.0 * verdict.left) },
            report::band_of(after.band[j]),
            verdict.state
        ));
    }
    text
}

/// One line a name, `most` names at most: its joints, size, probability and what it was not.
fn names(explained: &Explained, most: usize) -> Vec<String> {
    if explained.effects.is_empty() {
        return vec![nothing_named(explained).to_string()];
    }
    let line = |effect: &NamedEffect| {
        format!(
            "{} on {}: {}; right in {:.0} of 100{}{}",
            effect.effect,
            on(&effect.joints, explained.verdict.len()),
            effect.size(&explained.sliding),
            100.0 * effect.probability,
            again(effect),
            not(effect)
        )
    };
    let mut lines: Vec<String> = explained.effects.iter().take(most).map(line).collect();
    let more: Vec<&str> = explained.effects.iter().skip(most).map(|effect| effect.effect.as_str()).collect();
    if !more.is_empty() {
        lines.push(format!("and {} more: {}", more.len(), more.join(", ")));
    }
    lines
}

/// In which logs a name is, and whether it was found again in fewer of them.
fn again(effect: &NamedEffect) -> String {
    match effect.again {
        Some(again) if effect.in_some_logs => {
            format!("; seen in some logs: {} of {} searches on fewer give it", again.found, again.of)
        }
        _ => in_logs(effect),
    }
}

fn in_logs(effect: &NamedEffect) -> String {
    match effect.logs.as_slice() {
        [] => String::new(),
        [one] => format!(
            "; in {}",
            Path::new(one).file_name().map_or(one.as_str(), |name| name.to_str().unwrap_or(one))
        ),
        several => format!("; in {} of the logs", several.len()),
    }
}

fn not(effect: &NamedEffect) -> String {
    let (alike, others): (Vec<_>, Vec<_>) = effect.rivals.iter().partition(|rival| rival.alike);
    let names = |of: &[&Rival], between: &str| {
        of.iter().take(RIVALS).map(|rival| rival.effect.clone()).collect::<Vec<_>>().join(between)
    };
    let mut text = String::new();
    if !alike.is_empty() {
        text.push_str(&format!("; or {}, which fits as well", names(&alike, " or ")));
    }
    if !others.is_empty() {
        text.push_str(&format!("; not {}", names(&others, ", ")));
    }
    text
}

fn without_name(rest: &Unattributed) -> String {
    let signals: Vec<&str> = rest.depends_on.iter().take(3).map(String::as_str).collect();
    format!(
        "without a name: what is left of joint {}; it depends on {}",
        list(&rest.joints),
        signals.join(", ")
    )
}

fn odd_logs(explained: &Explained) -> Vec<String> {
    let odd: Vec<String> =
        explained.logs.iter().filter(|log| !log.like_the_others).map(|log| log.sentence()).collect();
    let mut lines: Vec<String> = odd.iter().take(LOGS).cloned().collect();
    if odd.len() > LOGS {
        lines.push(format!("{} more logs are unlike the others", odd.len() - LOGS));
    }
    lines
}

fn decided(explained: &Explained) -> Option<String> {
    let experiment = explained.experiment.as_ref()?;
    let why = &experiment.why;
    Some(match experiment.decided {
        Some(name) => format!("The experiment decides for {name}: {why}"),
        None => format!("The experiment does not decide: {why}"),
    })
}

/// What to do next.
fn next(explained: &Explained, arm: &Path, out: &Path) -> String {
    if let Some(experiment) = &explained.next_experiment {
        return experiment.advice.clone();
    }
    let open = explained.verdict.iter().filter(|v| !v.state.is_good() && !v.advice.is_empty());
    match open.max_by(|a, b| a.left.total_cmp(&b.left)) {
        Some(worst) => format!("joint {}: {}", worst.joint, worst.advice),
        None => format!(
            "powerball generate --arm {} --model {} --output model.rs",
            arm.display(),
            out.join("model.json").display()
        ),
    }
}

fn advice(verdict: &Verdict) -> String {
    format!("joint {}: {}\n", verdict.joint, verdict.advice)
}

fn evidence(effect: &NamedEffect, sliding: &[bool]) -> String {
    let mut text = format!(
        "{} on joint {}: {}\n  \
         p = {:.1e}, evidence {:.2} times that of the next name, {:.0} % of the excess over noise left, \
         right in {:.0} of 100\n",
        effect.effect,
        list(&effect.joints),
        effect.size(sliding),
        effect.p_value,
        effect.margin,
        100.0 * effect.leftover,
        100.0 * effect.probability
    );
    for rival in &effect.rivals {
        text.push_str(&format!("  not {}: {}\n", rival.effect, rival.why_not));
    }
    text
}

fn on(joints: &[JointNumber], dof: usize) -> String {
    match joints {
        [one] => format!("joint {one}"),
        all if all.len() == dof => "all joints".to_string(),
        several => format!("joints {}", list(several)),
    }
}

fn list(joints: &[JointNumber]) -> String {
    joints.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}
