//! `powerball excite`: from an arm file to trajectories.

use super::{Failure, output};
use crate::report::excited::{self, page, peaks};
use clap::{Args, ValueEnum};
use dyngen::{Arm, SetKind};
use powerball_controller::JointNumber;
pub(super) use powerball_identification::excite::{CLEARANCE, FloorAt, RADIUS};
use powerball_identification::excite::{
    Collision, Criterion, Error, ExcitationSettings, ExciteOptions, Excited, MassSource, Mounting, SEARCH,
    excite, searches,
};
use powerball_logs::Progress;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A parameter set on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Set {
    /// Exact for the numbers in the file.
    Minimal,
    /// Exact for every size of the arm; pins of bars are numbers.
    Symbolic,
    /// The file's [[grouping]].
    Published,
    /// Every parameter that the symmetries leave.
    Full,
}

impl From<Set> for SetKind {
    fn from(set: Set) -> Self {
        match set {
            Set::Minimal => SetKind::Minimal,
            Set::Symbolic => SetKind::Symbolic,
            Set::Published => SetKind::Published,
            Set::Full => SetKind::Full,
        }
    }
}

/// Criterion of the optimisation.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Goal {
    /// Condition number and 1/σ_min of the regressor (Eq. 17).
    Condition,
    /// D-optimality: the volume of the parameters' confidence region.
    Volume,
}

pub(super) fn floor(text: &str) -> Result<FloorAt, String> {
    match text.parse::<f64>() {
        _ if text == "none" => Ok(FloorAt(None)),
        Ok(height) if height.is_finite() => Ok(FloorAt(Some(height))),
        _ => Err("give a height in m, or none".to_string()),
    }
}

/// Search exciting trajectories (Eq. 17 to 20) within the arm's limits and surroundings, and write them.
///
/// The path keeps the file's limits of position, velocity, acceleration and torque, the floor, and the
/// distance of the arm's links from each other, as capsules along its geometry. What had to be assumed for
/// that is reported.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  powerball excite --arm arm.toml --out path.csv --period 10 --harmonics 5 \
        --floor -0.2\n  \
    powerball excite --arm arm.toml --out path.csv --mounting filed --mounting 90,0 --values \
    identified.json\n\n\
    The file has the columns t, q1…qn, dq1…dqn, ddq1…ddqn in rad and s, from rest to rest; with several \
    mountings there is\n\
    one file for each, path_1.csv, path_2.csv and so on, which determine the parameters together."
)]
pub(crate) struct Excite {
    /// The arm file; every joint needs `position`, `velocity` and `acceleration` in it, or `torque` in place
    /// of `acceleration` where the masses are known (--values).
    #[arg(long)]
    arm: PathBuf,
    /// The parameter set whose regressor is to be well conditioned.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
    /// File for the trajectory, CSV.
    #[arg(long)]
    out: PathBuf,
    /// File for a page with figures, HTML.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Duration of one period of the Fourier series, s.
    #[arg(long, default_value_t = 10.0)]
    period: f64,
    /// Harmonics of each joint.
    #[arg(long, default_value_t = 4)]
    harmonics: usize,
    /// How often the path is run through.
    #[arg(long, default_value_t = 2)]
    periods: usize,
    /// Duration of the start from rest and of the stop, s.
    #[arg(long, default_value_t = 1.0)]
    ramp: f64,
    /// Share of range, velocity, acceleration and torque that stays unused.
    #[arg(long, default_value_t = 0.05)]
    margin: f64,
    /// Criterion of the optimisation.
    #[arg(long, value_enum, default_value = "condition")]
    objective: Goal,
    /// Weight of 1/σ_min against the condition number.
    #[arg(long, default_value_t = 1.0)]
    weight: f64,
    /// How the base stands: `filed`, ROLL,PITCH in degrees from there, or gravity in its frame as X,Y,Z in
    /// m/s²; repeat it for a trajectory in each of several mountings.
    #[arg(long, value_name = "MOUNTING", allow_hyphen_values = true)]
    mounting: Vec<Mounting>,
    /// Height of the floor above the base frame's origin along the vertical, m, or `none`. Without it the
    /// floor is at 0 where the base stands upright and the arm can be above it, and there is none elsewhere.
    #[arg(long, value_name = "Z", value_parser = floor, allow_hyphen_values = true)]
    floor: Option<FloorAt>,
    /// Radius of the links' capsules, m.
    #[arg(long, default_value_t = RADIUS, allow_hyphen_values = true)]
    radius: f64,
    /// Distance that capsules keep from each other and from the floor, m.
    #[arg(long, default_value_t = CLEARANCE, allow_hyphen_values = true)]
    clearance: f64,
    /// Ignore the floor and links that touch.
    #[arg(long)]
    no_collision: bool,
    /// The arm's masses for the torque limits: an identified.json, or a values file `{"parameter": number,
    /// …}`. Without it they are those of ARM.values.json, which `dyngen import` writes next to the arm file;
    /// else they are estimated from the capsules.
    #[arg(long, value_name = "FILE.json", conflicts_with = "no_torque")]
    values: Option<PathBuf>,
    /// Ignore torque limits.
    #[arg(long)]
    no_torque: bool,
    /// The pose before the trajectory, rad with commas between: the straight way from there to its beginning
    /// is kept free too.
    #[arg(long, value_name = "Q1,…", value_delimiter = ',', allow_hyphen_values = true)]
    from: Option<Vec<f64>>,
    /// How many paths are tried.
    #[arg(long, default_value_t = 6 * SEARCH)]
    evaluations: usize,
    /// Samples a second.
    #[arg(long, default_value_t = 200.0)]
    rate: f64,
    /// Seed of the search; the same seed finds the same path.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Prints one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl Excite {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        for note in arm.notes() {
            tracing::warn!("{}: {note}", self.arm.display());
        }
        let files = self.files()?;
        let terminal = output::Progress::new();
        let say = |what: &str| terminal.say(what);
        let options = ExciteOptions {
            parameters: self.parameters.into(),
            search: self.search(),
            rate: self.rate,
            mountings: self.mounting.clone(),
            collision: (!self.no_collision).then_some(Collision {
                floor: self.floor,
                radius: self.radius,
                clearance: self.clearance,
            }),
            masses: if self.no_torque { None } else { Some(self.masses()?) },
            from: self.from.clone(),
            progress: Progress::to(&say),
        };
        let excited = excite(&arm, &options).map_err(refused)?;
        for (trajectory, file) in excited.trajectories.iter().zip(&files) {
            write(file, trajectory.motion.to_csv().as_bytes())?;
        }
        if let Some(report) = &self.report {
            write(report, page(&excited).to_html().as_bytes())?;
        }
        match self.json {
            true => output::data(&in_json(&excited, &files).to_string()),
            false => output::print(in_words(&excited, &files).trim_end()),
        }
        Ok(())
    }

    fn search(&self) -> ExcitationSettings {
        ExcitationSettings {
            harmonics: self.harmonics,
            fundamental: std::f64::consts::TAU / self.period,
            periods: self.periods,
            ramp: self.ramp,
            margin: self.margin,
            criterion: match self.objective {
                Goal::Condition => Criterion::Condition { lambda2: self.weight },
                Goal::Volume => Criterion::Volume,
            },
            evaluations: self.evaluations,
            searches: searches(self.evaluations),
            seed: self.seed,
        }
    }

    /// The masses of the option, else those that an import has written next to the arm file.
    fn masses(&self) -> Result<MassSource, Failure> {
        let imported = self.arm.with_extension("values.json");
        let path = match &self.values {
            Some(path) => path,
            None if imported.is_file() => {
                tracing::warn!("{}: the masses are taken from it", imported.display());
                &imported
            }
            None => return Ok(MassSource::Guess),
        };
        let file = path.display().to_string();
        let text = dyngen::file::text(path)
            .map_err(|e| Failure::Unusable(format!("{file}: cannot be read: {e}")))?;
        Ok(MassSource::Values { text, file })
    }

    /// One file for each mounting.
    fn files(&self) -> Result<Vec<PathBuf>, Failure> {
        let count = self.mounting.len().max(1);
        if count == 1 {
            return Ok(vec![self.out.clone()]);
        }
        let nameless = || Failure::Unusable(format!("--out {} names no file", self.out.display()));
        let stem = self.out.file_stem().and_then(|s| s.to_str()).ok_or_else(nameless)?;
        let ending = self.out.extension().and_then(|s| s.to_str()).map_or(String::new(), |e| format!(".{e}"));
        Ok((1..=count).map(|k| self.out.with_file_name(format!("{stem}_{k}{ending}"))).collect())
    }
}

fn refused(e: Error) -> Failure {
    match e {
        Error::Setting(what) => Failure::Unusable(what),
        other => Failure::Refused(other.to_string()),
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    match (path.parent(), path.file_name().and_then(|name| name.to_str())) {
        (Some(folder), Some(name)) => output::write(folder, name, bytes),
        _ => Err(Failure::Unusable(format!("{} names no file", path.display()))),
    }
}

fn in_json(result: &Excited, files: &[PathBuf]) -> Value {
    let mut object = excited::json(result);
    match object.get_mut("trajectories").and_then(Value::as_array_mut) {
        Some(list) => list.iter_mut().zip(files).for_each(|(entry, file)| entry["out"] = json!(file)),
        None => object["out"] = json!(files.first()),
    }
    object
}

fn in_words(result: &Excited, files: &[PathBuf]) -> String {
    let mut out = String::new();
    let (good, usual) = (&result.found.figures, &result.found.usual);
    for (trajectory, file) in result.trajectories.iter().zip(files) {
        let motion = &trajectory.motion;
        let _ = writeln!(
            out,
            "{}: {} samples, {:.2} s from rest to rest, base {}",
            file.display(),
            motion.len(),
            motion.duration(),
            trajectory.mounting
        );
    }
    let _ = writeln!(
        out,
        "regressor of {} parameters: condition number {:.1} raw, {:.2} with normalised columns\n\
         as optimised (rows over torque limits, columns over their usual size): {:.2} (a random path: \
         {:.1}), \
         smallest singular value {:.3} ({:.3})",
        result.parameters.0,
        result.conditions.raw,
        result.conditions.normalised,
        good.condition,
        usual.condition,
        good.least,
        usual.least
    );
    for trajectory in &result.trajectories {
        let _ = writeln!(
            out,
            "\n\
            joint   position [rad]     of limit        velocity  of limit   acceleration  of limit   torque  \
            of limit"
        );
        let torque = trajectory.tightest.torque.as_ref();
        for (i, ([low, high, velocity, acceleration], limit)) in
            peaks(&trajectory.motion).iter().zip(&trajectory.limits.0).enumerate()
        {
            let [lowest, highest] = limit.position;
            let torque = torque.map_or("-".to_string(), |t| format!("{:.1}", t[i]));
            let _ = writeln!(
                out,
                "{:>5}  {low:>6.2} … {high:<6.2}  {lowest:>6.2} … {highest:<6.2}  {velocity:>6.2}    \
                {:>6.2}      {acceleration:>9.2}    {:>6.2}   {torque:>6}    {:>6}",
                JointNumber::from_index(i).number(),
                limit.velocity,
                limit.acceleration,
                limit.torque.map_or("-".to_string(), |t| format!("{t:.0}")),
            );
        }
        if let Some((near, time)) = trajectory.tightest.nearest {
            let _ = writeln!(out, "nearest: {} at {time:.2} s, {:.3} m apart", near.contact, near.distance);
        }
    }
    out.push('\n');
    result.assumed.iter().for_each(|line| {
        let _ = writeln!(out, "assumed: {line}");
    });
    out
}
