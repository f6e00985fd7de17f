//! Logs of position servos, which hold set-points and no torques: as `identify` and `explain` take them.

use super::Failure;
use super::output::{self, Accept, Verbosity};
use crate::report;
use dyngen::{Arm, Values};
use powerball_explanation::Rule;
use powerball_explanation::servo::{ExplainedServos, explain_servos};
use powerball_identification::servo::{IdentifiedServos, ServoArm, identify_servos};
use powerball_identification::{Input, Source};
use powerball_logs as logs;
use powerball_logs::log::{LogError, ServoLog, is_of_servos};
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

impl Masses {
    /// The values that were given, else those next to the arm file.
    fn read(&self, arm: &Path) -> Result<Option<Values>, Failure> {
        let imported = arm.with_extension("values.json");
        let path = self.values.as_ref().or(imported.is_file().then_some(&imported));
        path.map(|path| Values::read(path)).transpose().map_err(|e| Failure::Unusable(e.to_string()))
    }

    /// What is to be reported about them.
    fn note(&self, arm: &Path) -> Option<String> {
        let imported = arm.with_extension("values.json");
        let is_used = self.values.is_none() && imported.is_file();
        is_used.then(|| format!("{}: the masses are taken from it", imported.display()))
    }

    /// The arm with what is known of it.
    pub(super) fn arm(&self, arm: &Arm, file: &Path) -> Result<ServoArm, Failure> {
        Ok(ServoArm::new(arm, self.read(file)?.as_ref())?)
    }
}

/// Logs of servos, and what is odd about them.
pub(super) struct ServoLogs {
    pub(super) fit: Vec<ServoLog>,
    pub(super) validate: Vec<ServoLog>,
    pub(super) warnings: Vec<String>,
}

/// Whether logs are those of position servos: the first file says it for all.
pub(super) fn are_of_servos(logs: &[Source<'_>], arm: &Arm) -> bool {
    logs.first().is_some_and(|source| match &source.input {
        Input::File(path) => is_of_servos(path, arm, &source.map),
        _ => false,
    })
}

impl ServoLogs {
    /// Reads all of them.
    pub(super) fn read(fit: &[Source<'_>], validate: &[Source<'_>], arm: &Arm) -> Result<ServoLogs, Failure> {
        let both = fit.iter().find(|a| validate.iter().any(|b| a.name() == b.name()));
        if let Some(both) = both {
            return Err(powerball_identification::IdentifyError::JudgesItself(both.name()).into());
        }
        let (mut warnings, mut errors) = (arm.notes(), Vec::new());
        let mut read = |sources: &[Source<'_>]| -> Vec<ServoLog> {
            let one = |source: &Source<'_>| {
                let (Input::File(path), None) = (&source.input, source.mounting) else {
                    errors.push(format!("{}: --mounting is of logs with torques", source.name()));
                    return None;
                };
                match ServoLog::read(path, arm, &source.map) {
                    Ok((log, findings)) => {
                        warnings.extend(findings.iter().map(ToString::to_string));
                        Some(log)
                    }
                    Err(LogError(reasons)) => {
                        errors.extend(reasons.iter().map(ToString::to_string));
                        None
                    }
                }
            };
            sources.iter().filter_map(one).collect()
        };
        let (mut fit, mut validate) = (read(fit), read(validate));
        ServoLog::common_clock(fit.iter_mut().chain(&mut validate));
        match errors.is_empty() {
            true => Ok(ServoLogs { fit, validate, warnings }),
            false => Err(Failure::Unusable(errors.join("\n"))),
        }
    }
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
    fn read(&self, terminal: &output::Progress) -> Result<(ServoArm, ServoLogs), Failure> {
        let arm = self.masses.arm(self.arm.0, self.arm.1)?;
        terminal.say("reading logs");
        let mut read = ServoLogs::read(self.logs.0, self.logs.1, self.arm.0)?;
        read.warnings.splice(0..0, self.masses.note(self.arm.1));
        Ok((arm, read))
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
            output::print(&files.first());
        } else if !verbosity.quiet {
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
    let (arm, read) = asked.read(terminal)?;
    let mut found = identify_servos(&arm, &read.fit, &read.validate, logs::Progress::to(&say))?;
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
    let (arm, read) = asked.read(terminal)?;
    let progress = logs::Progress::to(&say);
    let mut found = explain_servos(&arm, &read.fit, &read.validate, &Rule::default(), progress)?;
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
