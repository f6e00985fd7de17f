//! Logs of position servos, which hold set-points and no torques: as `identify` and `explain` take them.

use super::Failure;
use super::output::{self, Accept, Verbosity};
use crate::report;
use dyngen::{Arm, Values};
use powerball_explanation::Rule;
use powerball_explanation::servo::{ExplainedServos, explain_servos};
use powerball_identification::Source;
use powerball_identification::servo::{IdentifiedServos, ServoInput, identify_servos};
use powerball_logs as logs;
use std::path::{Path, PathBuf};

/// What is known of the bodies of an arm on servos.
#[derive(clap::Args, Clone, Debug, Default)]
pub(super) struct Masses {
    /// Masses of the arm, where its joints are position servos (logs with goal1 … and without torque): {"m1":
    /// 0.5, "mx1": …}, every inertial parameter of each link. Without it they are those of ARM.values.json,
    /// which `dyngen import` writes next to the arm file; else torques are shares of the torque at full duty.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
}

/// What is given for an identification of servos.
pub(super) struct Asked<'a> {
    pub arm: (&'a Arm, &'a Path),
    pub masses: &'a Masses,
    pub logs: (&'a [Source<'a>], &'a [Source<'a>]),
    pub out: &'a Path,
    pub json: bool,
    pub accept: Accept,
}

impl Asked<'_> {
    /// The arm with what is known of it, and the logs with all notes about both.
    fn read(&self, progress: logs::Progress<'_>) -> Result<ServoInput, Failure> {
        let (arm, file) = self.arm;
        let values = self.masses.values.as_ref().map(|path| Values::read(path)).transpose();
        let values = values.map_err(|e| Failure::Unusable(e.to_string()))?;
        Ok(ServoInput::read(arm, (values, Some(file)), self.logs, progress)?)
    }

    /// Writes the files of a result, prints it around its own lines, and judges whether it should be used.
    fn finish(
        &self,
        files: &report::Files,
        (unusable, warnings): (&[String], &[String]),
        own_lines: impl FnOnce() -> Vec<String>,
        verbosity: Verbosity,
    ) -> Result<(), Failure> {
        output::write_all(files, self.out)?;
        if self.json {
            output::data(&files.first());
        } else {
            let verbose = verbosity.verbose;
            let mut lines = output::first_lines(unusable, None, verbose);
            if verbose {
                lines.extend(warnings.iter().map(|warning| format!("note: {warning}")));
            }
            lines.extend(own_lines());
            lines.extend(output::notes(warnings.len()).filter(|_| !verbose));
            lines.push(format!("report: {}", self.out.join("report.html").display()));
            output::print(&lines.join("\n"));
        }
        self.accept.judge(unusable)
    }
}

/// `powerball identify` on logs of position servos.
pub(super) fn identify(
    asked: &Asked<'_>,
    terminal: &output::Progress,
    verbosity: Verbosity,
) -> Result<(), Failure> {
    let say = |what: &str| terminal.say(what);
    let read = asked.read(logs::Progress::to(&say))?;
    let mut found = identify_servos(&read.arm, &read.fit, &read.validate, logs::Progress::to(&say))?;
    found.warnings.splice(0..0, read.warnings);
    let files = report::servos::files(&found).map_err(Failure::Refused)?;
    asked.finish(&files, (&found.unusable, &found.warnings), || in_words(&found), verbosity)
}

/// What was found, for a person.
fn in_words(found: &IdentifiedServos) -> Vec<String> {
    let mut lines = vec!["joint  position error (simulated closed loop), rad".to_string()];
    for (j, servo) in found.servo.iter().enumerate() {
        let held_out = found.validate.as_ref().map_or(String::new(), |v| {
            let goal = v.goal_error[j].map_or("the drive is off".to_string(), |error| {
                format!("its goal, late by the best delay: {error:.4}")
            });
            format!(", held out {:.4} ({goal})", v.position_error[j])
        });
        lines.push(format!(
            "{:>5}  fit {:.4}{held_out}",
            servo.joint.to_string(),
            found.fit.position_error[j]
        ));
        let fitted: Vec<String> =
            servo.parameters.iter().filter(|p| !p.known).map(report::servos::in_words).collect();
        lines.push(format!("       {}", fitted.join(", ")));
    }
    lines
}

/// `powerball explain` on logs of position servos.
pub(super) fn explain(
    asked: &Asked<'_>,
    terminal: &output::Progress,
    verbosity: Verbosity,
) -> Result<(), Failure> {
    let say = |what: &str| terminal.say(what);
    let progress = logs::Progress::to(&say);
    let read = asked.read(progress)?;
    let mut found = explain_servos(&read.arm, &read.fit, &read.validate, &Rule::default(), progress)?;
    found.warnings.splice(0..0, read.warnings);
    let files = report::servos::explained(&found).map_err(Failure::Refused)?;
    asked.finish(&files, (&found.unusable, &found.warnings), || explained_in_words(&found), verbosity)
}

/// What was found, for a person.
fn explained_in_words(found: &ExplainedServos) -> Vec<String> {
    let mut lines: Vec<String> = found.effects.iter().map(report::servos::effect_in_words).collect();
    if found.effects.is_empty() {
        lines.push(
            "nothing is named: no candidate lowers the position error on the validation logs".to_string(),
        );
    }
    for (j, verdict) in found.verdict.iter().enumerate() {
        let of = |both: &powerball_explanation::servo::Both| both.validate.position_error[j];
        lines.push(format!(
            "joint {}: position error {:.4} rad held out, {:.4} with what was named; {}",
            verdict.joint,
            of(&found.before),
            of(&found.after),
            verdict.state
        ));
    }
    lines
}
