//! `powerball identify`: from logs to identified.json.
//!
//! The file also has what was identified, in a copy of the robot description that the arm was imported from.

use super::inputs::{MapArgument, MountedLogs};
use super::output::{Accept, Verbosity};
use super::servos::{self, Masses};
use super::{Failure, output};
use crate::report;
use clap::{Args, ValueEnum};
use dyngen::export::{self, Known};
use dyngen::import::{ImportError, Options, Source};
use dyngen::{Arm, Values};
use powerball_explanation::torque_model::ModelFile;
use powerball_identification::estimate::FrictionKind;
use powerball_identification::servo::are_of_servos;
use powerball_identification::{
    Estimator, Identified, IdentifyOptions, KnownModel, NearestError, identify, nearest_arm,
};
use powerball_logs::Progress;
use std::path::{Path, PathBuf};

/// Fit the minimal inertial set and the friction of every joint (two tanh steps and a viscous
/// part, Eq. 16) to logs.
///
/// Writes identified.json and report.html; consistent.json: the nearest parameters that a real arm can have,
/// as values for `dyngen generate --values`; covariance.json: the covariance of all of it, for `powerball
/// compare`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    powerball identify --arm arm.toml --log a.csv b.csv --validate c.csv --out result\n  \
    powerball identify --arm arm.toml --log a.summary b.summary --out result\n  \
    powerball identify --arm arm.toml --log upright.csv --mounting 90,0 --log on_its_side.csv --out \
    result\n  \
    powerball identify --arm servos.toml --log goals_and_positions.csv --validate other.csv --out result")]
pub(crate) struct Identify {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    #[command(flatten)]
    logs: MountedLogs,
    #[command(flatten)]
    map: MapArgument,
    /// What is known already: model.json of `powerball explain` for the same arm file. Inertial set and
    /// friction are fitted in addition to its effects, which stay as they are. Logs of one mounting alone, no
    /// summaries.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
    /// The friction of every joint.
    #[arg(long, value_enum, default_value_t)]
    friction: Friction,
    /// How rows are counted.
    #[arg(long, value_enum, default_value_t)]
    estimator: EstimatorName,
    /// The URDF or MuJoCo model that the arm file was imported from: a copy of it with the identified values,
    /// friction and effects is written into the folder of the results, under its name.
    #[arg(long, value_name = "ORIGINAL")]
    export: Option<PathBuf>,
    #[command(flatten)]
    masses: Masses,
    /// Print how long each phase took, on standard error.
    #[arg(long)]
    timings: bool,
    #[command(flatten)]
    accept: Accept,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// A friction law by its name on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Friction {
    /// Two tanh steps and a viscous part (Eq. 16): γ1·tanh(γ2·q̇) + γ3·tanh(γ4·q̇) + γ5·q̇.
    #[default]
    Symmetric,
    /// The symmetric friction and a constant torque.
    Asymmetric,
}

/// An estimator by its name on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum EstimatorName {
    /// Least squares, every joint weighted by its noise.
    #[default]
    Weighted,
    /// Weighted least squares in which outliers of the torque (spikes, brief collisions) count less or
    /// nothing.
    Robust,
    /// Instrumental variables: unbiased where positions are noisy. The regressor from every second sample of
    /// the positions, its instruments from those between.
    Instrumental,
}

impl Identify {
    pub(crate) fn run(self, verbosity: Verbosity) -> Result<(), Failure> {
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let known = self.model.as_deref().map(ModelFile::read).transpose();
        let known = known.map_err(|e| Failure::Unusable(e.to_string()))?;
        let terminal = output::Progress::timed(self.timings);
        let logs = self.logs.clone().mapped(self.map.read()?);
        if are_of_servos(&logs.log, &arm) {
            return self.servos(&arm, &logs, &terminal, verbosity);
        }
        let say = |what: &str| terminal.say(what);
        let options = IdentifyOptions {
            friction: match self.friction {
                Friction::Symmetric => FrictionKind::Symmetric,
                Friction::Asymmetric => FrictionKind::Asymmetric,
            },
            estimator: match self.estimator {
                EstimatorName::Weighted => Estimator::Weighted,
                EstimatorName::Robust => Estimator::Robust,
                EstimatorName::Instrumental => Estimator::Instrumental,
            },
            known: known.as_ref().map(|known| known as &dyn KnownModel),
            progress: Progress::to(&say),
            ..IdentifyOptions::default()
        };
        output::make_folder(&self.out)?;
        let original = self.export.as_deref().map(|path| Original::read(path, &self.out)).transpose()?;
        let mut identified = identify(&arm, &logs.log, &logs.validate, &options)?;
        identified.arm_file = Some(self.arm.display().to_string());
        terminal.say("writing");
        let known = known.as_ref().map(|known| &known.model.additions);
        let files = report::identified::files(&identified, known).map_err(Failure::Refused)?;
        output::write_all(&files, &self.out)?;
        if self.json {
            output::data(&files.first());
        } else {
            output::print(&in_words(&identified, verbosity.verbose, &self.out));
        }
        if let Some(original) = original {
            original.write(&arm, &files.first(), &self.out.join("identified.json"))?;
        }
        self.accept.judge(&identified.unusable)
    }
}

impl Identify {
    /// As it is done for arms on position servos.
    fn servos(
        &self,
        arm: &Arm,
        logs: &MountedLogs,
        terminal: &output::Progress,
        verbosity: Verbosity,
    ) -> Result<(), Failure> {
        if self.model.is_some() || self.export.is_some() {
            return Err(Failure::Unusable(
                "--model and --export take logs with torques; these are of position servos (goal1 … and no \
                torque)"
                    .into(),
            ));
        }
        output::make_folder(&self.out)?;
        let asked = servos::Asked {
            arm: (arm, &self.arm),
            masses: &self.masses,
            logs: (&logs.log, &logs.validate),
            out: &self.out,
            json: self.json,
            accept: self.accept,
        };
        servos::identify(&asked, terminal, verbosity)
    }
}

/// What was found, for a person: what is wrong first, then the errors.
fn in_words(identified: &Identified, verbose: bool, out: &Path) -> String {
    let mut lines = output::first_lines(&identified.unusable, identified.conventions.as_ref(), verbose);
    lines.extend(identified.advice.clone());
    if verbose {
        lines.extend(identified.warnings.iter().map(|warning| format!("note: {warning}")));
    }
    let mut errors = vec![("fit", &identified.fit)];
    errors.extend(identified.mountings.iter().map(|m| (m.mounting.as_str(), &m.fit)));
    errors.extend(identified.validate.as_ref().map(|s| ("held out", s)));
    lines.push(output::table(&errors));
    lines.extend(identified.transmission.iter().flatten().map(|joint| joint.sentence()));
    lines.extend(output::notes(identified.warnings.len()).filter(|_| !verbose));
    lines.push(format!("report: {}", out.join("report.html").display()));
    lines.join("\n")
}

// `powerball consistent`: published values made those of a real arm.

/// Find the nearest parameters that a real arm can have.
///
/// Values of any parameter set (a paper's, or those of identified.json) can be impossible for a body. This
/// finds the real arm whose torques are nearest to theirs, over states within the arm's limits. Writes its
/// parameters as values for `dyngen generate --values`, and says how far they are.
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

impl ConsistentCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let values = Values::read(&self.values).map_err(|e| Failure::Unusable(e.to_string()))?;
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let found = nearest_arm(&arm, &values, Progress::to(&say)).map_err(|e| match e {
            NearestError::Values(e) => Failure::Unusable(e.to_string()),
            NearestError::Model(e) => Failure::Refused(e.to_string()),
        })?;
        output::write_file(&self.out, output::json(&found.parameters)?.as_bytes())?;
        if self.json {
            output::data(&output::json(&found)?);
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
            let body = arm.body_name(link - 1);
            output::print(&format!("note: no body can have the symmetries that the file declares of {body}"));
        }
        Ok(())
    }
}

// What was identified, in a copy of the robot description that the arm was imported from.

/// A URDF or a MuJoCo model, and where its copy goes.
pub(super) struct Original {
    source: Source,
    copy: PathBuf,
}

impl Original {
    /// Reads a robot description; the copy has its name, in `folder`.
    pub(super) fn read(path: &Path, folder: &Path) -> Result<Original, Failure> {
        let source = Source::read(path).map_err(|e| Failure::Unusable(e.to_string()))?;
        let copy = folder.join(path.file_name().unwrap_or_default());
        if matches!((copy.canonicalize(), path.canonicalize()), (Ok(copy), Ok(own)) if copy == own) {
            return Err(Failure::Unusable(format!(
                "{}: --export would write over it: choose another folder for --out",
                path.display()
            )));
        }
        Ok(Original { source, copy })
    }

    /// Writes the copy with the values, friction and effects of `identified`, a result as JSON that stands in
    /// `file`.
    pub(super) fn write(&self, arm: &Arm, identified: &str, file: &Path) -> Result<(), Failure> {
        let file = file.display().to_string();
        let known = Known::read(arm, (identified, &file), Some((identified, &file)));
        let known = known.map_err(Failure::Refused)?;
        let exported = export::source(&self.source, arm, &known, &Options::default());
        let exported = exported.map_err(|e| {
            let said = format!("{e}\n{file} is written; `dyngen export` has --base, --tip and --lock");
            match e {
                ImportError::Unreadable(_) => Failure::Unusable(said),
                ImportError::Refused(_) => Failure::Refused(said),
            }
        })?;
        for note in &exported.notes {
            // Standard output may be the result as JSON.
            tracing::warn!("{}: {note}", self.source.file);
        }
        output::write_file(&self.copy, &self.source.bytes(&exported.text))
    }
}
