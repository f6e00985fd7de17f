//! `powerball identify`: from logs to identified.json.

use super::Failure;
use super::identify_page::{Shown, page};
use super::inputs::{Inputs, load, same_file};
use super::mounted::{MountedFile, MountedLogs};
use super::output::{self, Progress};
use super::reduced::{Reduced, Standing, in_memory, reduce};
use crate::explanation::torque_model::{Additions, TorqueModel};
use crate::identification::estimate::{
    ConsistentReport, Errors, FrictionLaw, InBand, JointFriction, ParameterEstimate, Solution, Spread,
    consistent_fit, errors, exchanged, identify, solve_in_band, solve_instrumental, solve_reduced,
    solve_robust, spread, spread_of,
};
use crate::identification::mounting::Mounting;
use crate::logs::log::{Log, read_logs};
use crate::logs::regression::{Data, DataOptions, RigidBody};
use crate::logs::summary::BANDS;
use clap::{Args, ValueEnum};
use dyngen::SetKind;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Fit the minimal inertial set and the friction of every joint (Eq. 16) to logs.
///
/// Writes identified.json and report.html, and consistent.json: the nearest parameters that a real arm can
/// have, as values for `dyngen generate --values`.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  powerball identify --arm arm.toml --log a.csv b.csv --validate c.csv --out \
        result\n  powerball identify --arm arm.toml --log a.summary b.summary --out result\n  \
    powerball identify --arm arm.toml --log upright.csv --mounting 90,0 --log on_its_side.csv --out result"
)]
pub(crate) struct Identify {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    #[command(flatten)]
    logs: MountedLogs,
    /// What is known already: model.json of `powerball explain` for the same arm file. Inertial set and
    /// friction are fitted beside its effects, which stay as they are. Logs of one mounting alone, no
    /// summaries.
    #[arg(long, value_name = "FILE.json")]
    model: Option<PathBuf>,
    /// The friction of every joint.
    #[arg(long, value_enum, default_value_t)]
    friction: Friction,
    /// How rows are counted.
    #[arg(long, value_enum, default_value_t)]
    estimator: Estimator,
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
    /// Eq. 16: γ1·tanh(γ2·q̇) + γ3·tanh(γ4·q̇) + γ5·q̇.
    #[default]
    Symmetric,
    /// Eq. 16 and a constant torque.
    Asymmetric,
}

/// An estimator by its name on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Estimator {
    /// Least squares, every joint weighted by its noise.
    #[default]
    Weighted,
    /// The same, and torque samples that the model cannot believe (knocks, spikes, brief collisions) count
    /// less or nothing.
    Robust,
    /// Instrumental variables: unbiased where positions are noisy. The regressor from every second sample of
    /// the positions, its instruments from those between.
    Instrumental,
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
    /// How the base stood for the fitted logs, where it was not as the arm file says or not always the same.
    /// The parameters are those that these mountings determine together.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mountings: Vec<MountedFit>,
    /// The widest, Hz.
    pub band: [f64; 2],
    /// The end of each joint's band, Hz: of its fit, and of its errors.
    pub joint_bands: Vec<f64>,
    /// Why these.
    pub band_reason: String,
    pub warnings: Vec<String>,
}

/// The logs of one mounting in the fit.
#[derive(Serialize)]
pub(super) struct MountedFit {
    pub mounting: String,
    /// In the base frame, m/s².
    pub gravity: [f64; 3],
    pub logs: Vec<String>,
    pub fit: Spread,
}

impl Identify {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let options = DataOptions::default();
        for MountedFile { file, .. } in &self.logs.validate {
            if self.logs.log.iter().any(|log| same_file(&log.file, file)) {
                let name = file.display();
                return Err(Failure::Unusable(format!(
                    "{name} is given to --log and --validate: a log cannot judge its own fit"
                )));
            }
        }
        let whole = !matches!(self.estimator, Estimator::Weighted);
        let (mut reduced, additions) = match &self.model {
            Some(model) => self.known(model, &options, &progress)?,
            None => {
                let mut reduced = reduce(&self.arm, &self.logs.log, &options, whole, &progress)?;
                let files: Vec<&PathBuf> = self.logs.validate.iter().map(|f| &f.file).collect();
                let (held_out, findings) =
                    read_logs(&files, reduced.body().arm()).map_err(|e| Failure::Unusable(e.to_string()))?;
                reduced.warnings.extend(findings.iter().map(ToString::to_string));
                for (log, MountedFile { mounting, .. }) in held_out.into_iter().zip(&self.logs.validate) {
                    reduced.hold_out(log, mounting.unwrap_or_default(), &options)?;
                }
                (reduced, None)
            }
        };
        if whole && reduced.together.is_some() {
            return Err(Failure::Unusable(
                "--estimator robust and instrumental take logs of one mounting of the base".into(),
            ));
        }
        let mut warnings = std::mem::take(&mut reduced.warnings);
        let (body, bands) = (reduced.body(), reduced.bands());
        std::fs::create_dir_all(&self.out)
            .map_err(|e| Failure::Unusable(format!("{}: cannot be made: {e}", self.out.display())))?;
        progress.say("fitting");
        let law = match self.friction {
            Friction::Symmetric => FrictionLaw::Symmetric,
            Friction::Asymmetric => FrictionLaw::Asymmetric,
        };
        let InBand { solution, bands: mut in_band } = solve_in_band(bands, law);
        if whole {
            // What looks at single samples has one band.
            in_band.fill(0);
        }
        let (solution, errors) = match self.estimator {
            Estimator::Weighted => weighted(solution),
            Estimator::Instrumental => {
                let start = solve_reduced(bands.widest(), law);
                solve_instrumental(body, &reduced.standing[0].logs, &options, &start)
                    .map_err(Failure::Refused)?
            }
            Estimator::Robust => {
                let robust = solve_robust(body, &reduced.standing[0].logs, &options, law)
                    .map_err(|e| Failure::Refused(e.to_string()))?;
                for (j, share) in robust.doubted.iter().enumerate().filter(|(_, share)| **share > 0.01) {
                    warnings.push(format!(
                        "joint {}: {:.1} % of the torque samples were beyond belief and counted less",
                        j + 1,
                        100.0 * share
                    ));
                }
                weighted(robust.solution)
            }
        };
        let fit = spread_of(&solution, &solution.theta);
        let mountings = mounted_fits(&reduced, &solution, &in_band, law, &mut warnings)?;
        for (k, standing) in reduced.standing.iter().enumerate() {
            let errors = mountings.get(k).map_or(&fit, |mounted| &mounted.fit);
            warnings.extend(exchanged(&standing.body, &standing.logs, &options, errors));
        }
        let identified = identify(body.names(), &solution, &errors);
        let model = TorqueModel {
            arm: body.arm().name.clone(),
            set: SetKind::Minimal.to_string(),
            parameters: identified.parameters.clone(),
            friction: identified.friction.clone(),
            // They were taken out of the logs.
            additions: Additions::default(),
        };
        let joint_bands: Vec<f64> = in_band.iter().map(|band| BANDS[*band]).collect();
        let validate = if reduced.judging().next().is_none() {
            warnings
                .push("no log was given to --validate: the errors below are those of the fit itself".into());
            None
        } else {
            let judge = |standing: &Standing| judged(standing, &model, &joint_bands);
            let judged = reduced.judging().map(judge).collect::<Result<Vec<_>, _>>()?;
            match judged.as_slice() {
                [(only, _)] => Some(only.clone()),
                several => Spread::pooled(several),
            }
        };
        let held_out = reduced.judging().next();
        let shown = held_out.unwrap_or(&reduced.standing[0]);
        let logs = if held_out.is_some() { &shown.held_out } else { &shown.logs };
        let own = model.clone().in_set_of(&shown.body);
        let figures = Shown::new(&shown.body, logs, shown.mounting, &options, &joint_bands, &own)?;
        let undetermined: Vec<&str> =
            identified.parameters.iter().filter(|p| p.std.is_none()).map(|p| p.name.as_str()).collect();
        if !undetermined.is_empty() {
            warnings.push(format!(
                "these logs do not determine {}: they were set to 0; record a motion that excites them",
                undetermined.join("; ")
            ));
        }
        let values: Vec<f64> = identified.parameters.iter().map(|p| p.value).collect();
        let reasons = body.impossible(&values).map_err(|e| Failure::Refused(e.to_string()))?;
        warnings.extend(reasons.iter().map(|r| format!("no real arm can have these values: {r}")));
        progress.say("looking for the nearest real arm");
        let consistent = consistent_fit(body, &solution)
            .map_err(|e| Failure::Refused(e.to_string()))?
            .report(body, &solution);
        let result = Identification {
            arm: body.arm().name.clone(),
            set: "minimal",
            parameters: identified.parameters,
            friction: identified.friction,
            additions,
            fit,
            validate,
            physically_consistent: reasons.is_empty(),
            consistent,
            mountings,
            band: [0.0, BANDS[0]],
            joint_bands,
            band_reason: reason(&in_band, figures.motion),
            warnings,
        };
        let text = output::json(&result)?;
        output::write(&self.out, "identified.json", text.as_bytes())?;
        let values = output::json(&result.consistent.parameters)?;
        output::write(&self.out, "consistent.json", values.as_bytes())?;
        let page = page(&result, &body.filed(), &figures, result.validate.is_some());
        output::write(&self.out, "report.html", page.to_html().as_bytes())?;
        if self.json {
            output::print(&text);
        } else {
            for warning in &result.warnings {
                output::print(&format!("note: {warning}"));
            }
            let mut columns = vec![("fit", &result.fit)];
            columns.extend(result.mountings.iter().map(|m| (m.mounting.as_str(), &m.fit)));
            columns.extend(result.validate.as_ref().map(|s| ("held out", s)));
            output::print(&output::table(&columns));
        }
        Ok(())
    }
}

/// Why the joints' bands end where they do, and what of the motion lies in them: the arm moves below `motion`
/// Hz.
fn reason(bands: &[usize], motion: Option<f64>) -> String {
    let mut why = vec![format!("0 to {} Hz, above which arms are not rigid", BANDS[0])];
    for (k, high) in BANDS.iter().enumerate().skip(1) {
        let joints: Vec<String> =
            (1..=bands.len()).filter(|j| bands[j - 1] == k).map(|j| j.to_string()).collect();
        if !joints.is_empty() {
            why.push(format!(
                "0 to {high} Hz for joint {}, whose model torque is below what it leaves in the octave above",
                joints.join(", ")
            ));
        }
    }
    let lowest = bands.iter().map(|k| BANDS[*k]).fold(BANDS[0], f64::min);
    let motion = motion.map_or(String::new(), |motion| {
        let verdict = if motion > 0.5 * lowest {
            "that is too near to the end of a band: move slower, or much of the torque is left out"
        } else {
            "gravity and inertia are within, and so is what friction does at reversals, several times faster"
        };
        format!("; 99 % of the power of the speeds lies below {motion:.1} Hz: {verdict}")
    });
    format!("band {}{motion}", why.join("; "))
}

fn weighted(solution: Solution) -> (Solution, Errors) {
    let errors = errors(&solution);
    (solution, errors)
}

/// The fit by mounting, where the base did not always stand as filed.
fn mounted_fits(
    reduced: &Reduced,
    solution: &Solution,
    in_band: &[usize],
    law: FrictionLaw,
    warnings: &mut Vec<String>,
) -> Result<Vec<MountedFit>, Failure> {
    let fits = match (&reduced.together, reduced.standing.as_slice()) {
        (None, [only]) if only.mounting == Mounting::Filed => Vec::new(),
        (None, _) => vec![spread_of(solution, &solution.theta)],
        (Some(all), standing) => {
            let fits = all.spreads(solution, in_band).map_err(|e| Failure::Refused(e.to_string()))?;
            let contradictions = all.contradictions(&fits, in_band, law);
            for (joints, standing) in contradictions.iter().zip(standing).filter(|(j, _)| !j.is_empty()) {
                let joints: Vec<String> = joints.iter().map(ToString::to_string).collect();
                warnings.push(format!(
                    "one set of parameters leaves more than twice as much of the logs with the base {} on \
                        joint {} as a set of their own: \
                     is the mounting of each log told right, and was it one arm with one load?",
                    standing.mounting,
                    joints.join(", ")
                ));
            }
            fits
        }
    };
    let mounted = |(fit, standing): (Spread, &Standing)| MountedFit {
        mounting: standing.mounting.to_string(),
        gravity: standing.body.gravity(),
        logs: standing.bands.widest().logs.iter().map(|(name, _)| name.clone()).collect(),
        fit,
    };
    Ok(fits.into_iter().zip(&reduced.standing).map(mounted).collect())
}

/// What a model leaves of logs that took no part in it, each joint in its band; and the rows of each joint.
fn judged(
    standing: &Standing,
    model: &TorqueModel,
    joint_bands: &[f64],
) -> Result<(Spread, Vec<usize>), Failure> {
    let body = &standing.body;
    let model = model.clone().in_set_of(body);
    let mut judged: Option<(Spread, Vec<usize>)> = None;
    for (members, data) in by_band(body, &standing.held_out, joint_bands)? {
        let own = spread(&data, &model.residual(body, &data, &[]));
        let (all, rows) = judged.get_or_insert_with(|| (own.clone(), vec![0; body.dof()]));
        for j in members {
            (all.rms[j], all.relative[j]) = (own.rms[j], own.relative[j]);
            rows[j] = data.joints[j].len();
        }
    }
    judged.ok_or_else(|| Failure::Refused("no joint has a band".into()))
}

impl Identify {
    /// The logs of an arm of which a model is known, with what is known taken out of them.
    fn known(
        &self,
        model: &Path,
        options: &DataOptions,
        progress: &Progress,
    ) -> Result<(Reduced, Option<Additions>), Failure> {
        let files = |files: &[MountedFile]| files.iter().map(|f| f.file.clone()).collect::<Vec<PathBuf>>();
        let mut mountings =
            self.logs.log.iter().chain(&self.logs.validate).map(|f| f.mounting.unwrap_or_default());
        let mounting = mountings.next().unwrap_or_default();
        if mountings.any(|other| other != mounting) {
            return Err(Failure::Unusable("--model takes logs of one mounting of the base".into()));
        }
        let log = files(&self.logs.log);
        let inputs = Inputs { arm: self.arm.clone(), log, out: self.out.clone(), json: self.json };
        let mut loaded = load(&inputs, &files(&self.logs.validate), Some(model), mounting, progress)?;
        loaded.take_out();
        let known = loaded.known.map(|known| known.additions);
        let (body, warnings) = (loaded.body, loaded.warnings);
        let reduced = in_memory(body, loaded.fit, loaded.validate, warnings, options, mounting, progress)?;
        Ok((reduced, known))
    }
}

pub(super) fn prepared<'a>(
    body: &'a RigidBody,
    logs: &[Log],
    options: &DataOptions,
) -> Result<Data<'a>, Failure> {
    Data::new(body, logs, options).map_err(|e| Failure::Refused(e.to_string()))
}

/// Logs prepared in every band that a joint has, widest first, with the joints of that band, from 0.
pub(super) fn by_band<'a>(
    body: &'a RigidBody,
    logs: &[Log],
    joint_bands: &[f64],
) -> Result<Vec<(Vec<usize>, Data<'a>)>, Failure> {
    let members =
        |band: f64| -> Vec<usize> { (0..joint_bands.len()).filter(|j| joint_bands[*j] == band).collect() };
    let with = |band: f64| DataOptions { cutoff: band, ..DataOptions::default() };
    BANDS
        .iter()
        .map(|band| (members(*band), *band))
        .filter(|(members, _)| !members.is_empty())
        .map(|(members, band)| Ok((members, prepared(body, logs, &with(band))?)))
        .collect()
}
