//! `powerball excite`: from an arm file to trajectories.

use super::Failure;
use super::excite_page::page;
use super::output::{self, Progress};
use crate::identification::excite::{
    Conditions, Constraints, Criterion, Error, Excitation, Figures, Limits, Load, Masses, Mounting,
    Objective, Settings, Shape, Space, Task, Tightest, optimise_all,
};
use crate::identification::motion::Motion;
use clap::{Args, ValueEnum};
use dyngen::{Arm, Model, SetKind};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// An hour and more at 1 kHz.
const MOST_SAMPLES: f64 = 5e6;

/// Evaluations of one search, after which it hardly gains: more of them make more searches, each from starts
/// of its own.
const SEARCH: usize = 12_000;

/// A floor at its base that blocks more than this share of an arm's poses is not what it was built on.
const HANGS: f64 = 0.95;

/// A parameter set on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Set {
    /// Exact for the numbers in the file.
    Minimal,
    /// Exact for every size of the arm.
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

/// What is optimised.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Goal {
    /// Condition number and 1/σ_min of the regressor (Eq. 17).
    Condition,
    /// D-optimality: the volume of the parameters' confidence region.
    Volume,
}

/// A floor's height, or none.
#[derive(Clone, Copy, Debug)]
pub(super) struct FloorAt(Option<f64>);

/// Radius of the links' capsules, m, and the distance that they keep, where nothing is said.
pub(super) const RADIUS: f64 = 0.06;
pub(super) const CLEARANCE: f64 = 0.02;

/// The links and the floor of an arm in a mounting, and the floor's height: at the base where nothing is said
/// of it, the base stands upright and the arm can be above it, as an arm that is below its base wherever it
/// is hangs over something.
pub(super) fn surroundings(
    arm: &Arm,
    mounting: &Mounting,
    shape: &Shape,
    floor: Option<FloorAt>,
    clearance: f64,
    limits: &Limits,
) -> (Space, Option<f64>) {
    let up = mounting.up(arm);
    let free =
        |height: &f64| shape.blocked(&shape.floor(up, *height, &limits.0), clearance, &limits.0) < HANGS;
    let height = match floor {
        Some(FloorAt(height)) => height,
        None => (up.z > 0.5).then_some(0.0).filter(free),
    };
    let floor = height.map(|height| shape.floor(up, height, &limits.0));
    (Space { shape: shape.clone(), floor, clearance }, height)
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
/// Kept are the file's limits of position, speed, acceleration and torque, the floor, and the distance of the
/// arm's links from each other, as capsules along its geometry. What had to be assumed for that is said.
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
    /// The arm file; every joint needs `position`, `velocity` and `acceleration` in it.
    #[arg(long)]
    arm: PathBuf,
    /// The parameter set whose regressor is to be well conditioned.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
    /// Where the trajectory is written, CSV.
    #[arg(long)]
    out: PathBuf,
    /// Where a page with figures is written, HTML.
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
    /// Share of range, speed, acceleration and torque that stays unused.
    #[arg(long, default_value_t = 0.05)]
    margin: f64,
    /// What is optimised.
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
    /// Looks neither at the floor nor at links that touch.
    #[arg(long)]
    no_collision: bool,
    /// The arm's masses for the torque limits: an identified.json, or a values file `{"parameter": number,
    /// …}`. Without it they are guessed from the capsules.
    #[arg(long, value_name = "FILE.json", conflicts_with = "no_torque")]
    values: Option<PathBuf>,
    /// Does not look at torque limits.
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

/// One trajectory, and how it keeps its limits.
pub(super) struct Trajectory {
    pub mounting: Mounting,
    pub file: PathBuf,
    pub motion: Motion,
    pub tightest: Tightest,
    pub limits: Limits,
    pub constraints: Constraints,
}

/// All that is told of a search.
pub(super) struct Told {
    pub arm: String,
    pub parameters: (usize, usize),
    pub found: Excitation,
    pub conditions: Conditions,
    pub trajectories: Vec<Trajectory>,
    pub assumed: Vec<String>,
}

impl Excite {
    pub(crate) fn run(self) -> Result<(), Failure> {
        for (name, value) in [("--rate", self.rate), ("--radius", self.radius), ("--period", self.period)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Failure::Unusable(format!("{name} must be above 0")));
            }
        }
        let samples = self.rate * self.period * self.periods as f64;
        if samples > MOST_SAMPLES {
            return Err(Failure::Unusable(format!(
                "--rate, --period and --periods make {samples:.0} samples: more than {MOST_SAMPLES} are no \
                    trajectory"
            )));
        }
        if !(self.clearance.is_finite() && self.clearance >= 0.0) {
            return Err(Failure::Unusable("--clearance must not be below 0".to_string()));
        }
        let progress = Progress::new();
        let arm = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        for note in arm.notes() {
            eprintln!("powerball: {}: {note}", self.arm.display());
        }
        if let Some(from) = self.from.as_ref().filter(|from| from.len() != arm.dof()) {
            return Err(Failure::Unusable(format!(
                "--from has {} numbers, the arm {} joints",
                from.len(),
                arm.dof()
            )));
        }
        let files = self.files()?;
        progress.say("deriving and proving the arm's regressor");
        let mountings = self.mountings();
        let derive = |mounting: &Mounting| -> Result<Model, Error> {
            Ok(Model::derive(mounting.of(&arm).map_err(Error::Setting)?)?)
        };
        let models = mountings.iter().map(derive).collect::<Result<Vec<_>, _>>().map_err(refused)?;
        let mut assumed = Vec::new();
        let tasks = self.tasks(&arm, &models, &mountings, &mut assumed)?;
        let settings = Settings {
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
            searches: (self.evaluations / SEARCH).max(1),
            seed: self.seed,
        };
        progress.say("searching");
        let kind = self.parameters.into();
        let found = optimise_all(&tasks, kind, &settings).map_err(refused)?;
        let motions: Vec<Motion> = found.paths.iter().map(|path| path.sample(self.rate)).collect();
        // What is written is looked at once more, sample by sample.
        for (task, motion) in tasks.iter().zip(&motions) {
            if let Some(why) = task.constraints.broken(motion) {
                return Err(Failure::Refused(format!("the trajectory that was found does not hold: {why}")));
            }
        }
        let references: Vec<&Model> = models.iter().collect();
        let objective = Objective::new(&references, kind, 1).map_err(refused)?;
        let limits = Limits::of(&arm, 0.0).map_err(|e| refused(e.into()))?;
        let trajectory =
            |(((task, motion), mounting), file): (((Task<'_>, Motion), Mounting), PathBuf)| Trajectory {
                mounting,
                file,
                tightest: task.constraints.tightest(&motion),
                motion,
                limits: limits.clone(),
                constraints: task.constraints,
            };
        let told = Told {
            arm: arm.name.clone(),
            parameters: objective.size(),
            conditions: objective.conditions(&motions),
            found,
            trajectories: tasks.into_iter().zip(motions).zip(mountings).zip(files).map(trajectory).collect(),
            assumed,
        };
        for trajectory in &told.trajectories {
            write(&trajectory.file, trajectory.motion.to_csv().as_bytes())?;
        }
        if let Some(report) = &self.report {
            write(report, page(&told).to_html().as_bytes())?;
        }
        match self.json {
            true => output::print(&in_json(&told).to_string()),
            false => output::print(in_words(&told).trim_end()),
        }
        Ok(())
    }

    fn mountings(&self) -> Vec<Mounting> {
        if self.mounting.is_empty() { vec![Mounting::Filed] } else { self.mounting.clone() }
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

    /// What each mounting's path must keep; what had to be assumed for it.
    fn tasks<'m>(
        &self,
        arm: &Arm,
        models: &'m [Model],
        mountings: &[Mounting],
        assumed: &mut Vec<String>,
    ) -> Result<Vec<Task<'m>>, Failure> {
        let limits = Limits::of(arm, self.margin).map_err(|e| refused(e.into()))?;
        let shape = Shape::new(arm, &limits.0, self.radius);
        let mut masses = None;
        if !self.no_torque {
            let (found, without) = self.masses(arm, &models[0], mountings, &shape, &limits)?;
            assumed.push(format!("torque: {}", found.origin));
            assumed.extend(without);
            masses = Some(found);
        }
        if self.no_collision {
            assumed.push("floor and self-collision were not looked at".to_string());
        } else {
            assumed.push(format!(
                "links are capsules of radius {} m along the frames of the file, {} m clear of each other \
                    and of the floor; adjoining ones may fold to about {:.0}°",
                self.radius,
                self.clearance,
                2.0 * ((1.0 + 0.5 * self.clearance / self.radius) / 3.0).min(1.0).asin().to_degrees()
            ));
            for (a, b) in shape.always_touching() {
                assumed.push(format!(
                    "links {a} and {b} touch in every pose with this radius: nothing is said of them"
                ));
            }
        }
        let mut tasks = Vec::new();
        for (model, mounting) in models.iter().zip(mountings) {
            let space = (!self.no_collision).then(|| {
                let (space, height) =
                    surroundings(arm, mounting, &shape, self.floor, self.clearance, &limits);
                assumed.push(match (height, self.floor) {
                    (Some(height), Some(_)) => format!("base {mounting}: floor at {height} m"),
                    (Some(height), None) => {
                        format!(
                            "base {mounting}: floor at {height} m, the base frame's origin; --floor says \
                            where it is"
                        )
                    }
                    (None, _) => format!("base {mounting}: no floor"),
                });
                space
            });
            let load = masses.as_ref().map(|masses| Load::new(model, masses, &limits.0)).transpose();
            let constraints = Constraints {
                limits: limits.clone(),
                space,
                load: load.map_err(refused)?,
                from: self.from.clone(),
            };
            if let Some(from) = self.from.as_ref().filter(|from| constraints.lacks(from) > 0.0) {
                let mut pose = Motion::new(arm.dof(), 1.0);
                pose.push(from.iter().map(|q| [*q, 0.0, 0.0]));
                let free = Constraints { load: None, ..constraints };
                let why = free.broken(&pose).unwrap_or_else(|| "it is at the clearance".to_string());
                return Err(Failure::Refused(format!(
                    "the arm cannot stand at --from, base {mounting}: {why}"
                )));
            }
            tasks.push(Task { model, constraints });
        }
        Ok(tasks)
    }

    /// The arm's masses, and a note on joints without a torque limit.
    fn masses(
        &self,
        arm: &Arm,
        model: &Model,
        mountings: &[Mounting],
        shape: &Shape,
        limits: &Limits,
    ) -> Result<(Masses, Option<String>), Failure> {
        let without: Vec<String> =
            (1..=arm.dof()).filter(|j| arm.joints[j - 1].torque.is_none()).map(|j| j.to_string()).collect();
        let without = (!without.is_empty())
            .then(|| format!("the arm file has no torque limit for joint {}", without.join(", ")));
        let masses = match &self.values {
            None => Masses::guess(model, shape, &limits.0).map_err(refused)?,
            Some(path) => {
                let name = path.display().to_string();
                let text = std::fs::read_to_string(path)
                    .map_err(|e| Failure::Unusable(format!("{name}: cannot be read: {e}")))?;
                // Values belong to the arm as it is filed.
                let filed = match mountings.first() {
                    Some(Mounting::Filed) => None,
                    _ => Some(Model::derive(arm.clone()).map_err(|e| refused(e.into()))?),
                };
                Masses::parse(&text, &name, filed.as_ref().unwrap_or(model)).map_err(refused)?
            }
        };
        Ok((masses, without))
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

fn in_json(told: &Told) -> Value {
    let figures = |f: &Figures| json!({"condition": f.condition, "least_singular_value": f.least, "mean_singular_value": f.mean});
    let trajectory = |(trajectory, path): (&Trajectory, &crate::identification::excite::Fourier)| {
        let torque = trajectory.tightest.torque.as_ref();
        let joints: Vec<Value> = peaks(&trajectory.motion)
            .iter()
            .zip(&path.joints)
            .enumerate()
            .map(|(i, ([low, high, speed, acceleration], series))| {
                json!({"position": [low, high], "velocity": speed, "acceleration": acceleration,
                    "torque": torque.map(|t| t[i]),
                    "middle": series.middle, "a": series.a, "b": series.b})
            })
            .collect();
        let nearest = trajectory.tightest.nearest.map(
            |(near, time)| json!({"distance": near.distance, "between": near.contact.to_string(), "time": time}),
        );
        json!({"out": trajectory.file, "mounting": trajectory.mounting.to_string(), "samples": trajectory.motion.len(),
            "duration": trajectory.motion.duration(), "fundamental": path.fundamental, "nearest": nearest, "joints": joints})
    };
    let mut object = json!({
        "parameters": told.parameters.0, "rank": told.parameters.1,
        "figures": figures(&told.found.figures), "random_start": figures(&told.found.usual),
        "conditions": {"raw": told.conditions.raw, "normalised": told.conditions.normalised},
        "assumed": told.assumed,
    });
    let mut list: Vec<Value> = told.trajectories.iter().zip(&told.found.paths).map(trajectory).collect();
    if let ([Value::Object(only)], Value::Object(object)) = (list.as_mut_slice(), &mut object) {
        object.append(only);
    } else {
        object["trajectories"] = list.into();
    }
    object
}

fn in_words(told: &Told) -> String {
    let mut out = String::new();
    let (good, usual) = (&told.found.figures, &told.found.usual);
    for trajectory in &told.trajectories {
        let motion = &trajectory.motion;
        let _ = writeln!(
            out,
            "{}: {} samples, {:.2} s from rest to rest, base {}",
            trajectory.file.display(),
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
        told.parameters.0,
        told.conditions.raw,
        told.conditions.normalised,
        good.condition,
        usual.condition,
        good.least,
        usual.least
    );
    for trajectory in &told.trajectories {
        let _ = writeln!(
            out,
            "\njoint   position [rad]     of limit        speed  of limit   acceleration  of limit   torque  of limit"
        );
        let torque = trajectory.tightest.torque.as_ref();
        for (i, ([low, high, speed, acceleration], limit)) in
            peaks(&trajectory.motion).iter().zip(&trajectory.limits.0).enumerate()
        {
            let [lowest, highest] = limit.position;
            let torque = torque.map_or("-".to_string(), |t| format!("{:.1}", t[i]));
            let _ = writeln!(
                out,
                "{:>5}  {low:>6.2} … {high:<6.2}  {lowest:>6.2} … {highest:<6.2}  {speed:>6.2}    {:>6.2}      {acceleration:>9.2}    {:>6.2}   {torque:>6}    {:>6}",
                i + 1,
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
    told.assumed.iter().for_each(|line| {
        let _ = writeln!(out, "assumed: {line}");
    });
    out
}

/// Lowest and highest position, largest speed and acceleration of each joint.
fn peaks(motion: &Motion) -> Vec<[f64; 4]> {
    let mut peaks = vec![[f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0]; motion.dof()];
    for [q, dq, ddq] in motion.samples() {
        for (i, [low, high, speed, acceleration]) in peaks.iter_mut().enumerate() {
            *low = low.min(q[i]);
            *high = high.max(q[i]);
            *speed = speed.max(dq[i].abs());
            *acceleration = acceleration.max(ddq[i].abs());
        }
    }
    peaks
}
