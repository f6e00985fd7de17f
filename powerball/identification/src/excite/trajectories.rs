//! From an arm to exciting trajectories: the constraints of each mounting's path, the search, and a last
//! check.

use super::acceleration;
use super::{
    CLEARANCE, Conditions, Constraints, Error, Excitation, ExcitationSettings, FloorAt, Limits, Load, Masses,
    Mounting, Objective, RADIUS, Shape, Task, Tightest, optimise_all, surroundings,
};
use dyngen::{Arm, Model, SetKind};
use powerball_controller::JointNumber;
use powerball_logs::Progress;
use powerball_logs::motion::Motion;

/// An hour and more at 1 kHz.
const MOST_SAMPLES: f64 = 5e6;

/// All settings of [`excite`].
#[derive(Clone, Debug)]
pub struct ExciteOptions<'a> {
    /// The parameter set whose regressor is to be well conditioned.
    pub parameters: SetKind,
    /// The paths and their search.
    pub search: ExcitationSettings,
    /// Samples a second.
    pub rate: f64,
    /// The mountings of the base: a trajectory for each. If empty, the mounting of the arm file.
    pub mountings: Vec<Mounting>,
    /// Floor and links, if they are checked.
    pub collision: Option<Collision>,
    /// The arm's masses for the torque limits, if those are checked.
    pub masses: Option<MassSource>,
    /// The pose before the trajectory, rad: the straight way from there to its beginning is kept free too.
    pub from: Option<Vec<f64>>,
    /// The receiver of progress reports.
    pub progress: Progress<'a>,
}

/// How floor and links are checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collision {
    /// The floor; where none is given it is at 0 where the base stands upright and the arm can be above it,
    /// and there is none elsewhere.
    pub floor: Option<FloorAt>,
    /// Radius of the links' capsules, m.
    pub radius: f64,
    /// Distance that capsules keep from each other and from the floor, m.
    pub clearance: f64,
}

/// The source of an arm's masses.
#[derive(Clone, Debug, PartialEq)]
pub enum MassSource {
    /// Guessed from the links' capsules.
    Guess,
    /// The text of an identified.json or of values, and the file's name.
    Values {
        /// The text.
        text: String,
        /// The file's name, for messages.
        file: String,
    },
}

impl Default for Collision {
    fn default() -> Self {
        Collision { floor: None, radius: RADIUS, clearance: CLEARANCE }
    }
}

impl Default for ExciteOptions<'_> {
    fn default() -> Self {
        ExciteOptions {
            parameters: SetKind::Minimal,
            search: ExcitationSettings::default(),
            rate: 200.0,
            mountings: Vec::new(),
            collision: Some(Collision::default()),
            masses: Some(MassSource::Guess),
            from: None,
            progress: Progress::default(),
        }
    }
}

/// One trajectory, and how it keeps its limits.
#[derive(Clone, Debug)]
pub struct Trajectory {
    /// The mounting of the base for this trajectory.
    pub mounting: Mounting,
    /// The trajectory's samples.
    pub motion: Motion,
    /// The point at which the trajectory is nearest to a limit.
    pub tightest: Tightest,
    /// The limits of the file.
    pub limits: Limits,
    /// The constraints of the search, with its margin.
    pub constraints: Constraints,
}

/// Trajectories, and all that is reported about their search.
#[derive(Clone, Debug)]
pub struct Excited {
    /// The arm's name.
    pub arm: String,
    /// Parameters of the set, and how many of them the mountings determine.
    pub parameters: (usize, usize),
    /// The paths with their figures.
    pub found: Excitation,
    /// The regressor's condition numbers along them.
    pub conditions: Conditions,
    /// One for each mounting.
    pub trajectories: Vec<Trajectory>,
    /// The assumptions, a sentence each.
    pub assumed: Vec<String>,
}

/// Searches exciting trajectories (Eq. 17 to 20) within an arm's limits and surroundings.
///
/// # Errors
/// Settings that make no sense; [`Error::NoPose`], [`Error::NoStart`] and [`Error::NoPath`] where there is no
/// way to keep the constraints.
pub fn excite(arm: &Arm, options: &ExciteOptions<'_>) -> Result<Excited, Error> {
    check(arm, options)?;
    let (limited, proposed) = acceleration::proposed(arm, options.masses.as_ref())?;
    let arm = &limited;
    options.progress.say("deriving and proving the arm's regressor");
    let mountings = match options.mountings.as_slice() {
        [] => vec![Mounting::Filed],
        mountings => mountings.to_vec(),
    };
    let derive = |mounting: &Mounting| -> Result<Model, Error> {
        Ok(Model::derive(mounting.of(arm).map_err(Error::Setting)?)?)
    };
    let models = mountings.iter().map(derive).collect::<Result<Vec<_>, _>>()?;
    let mut assumed: Vec<String> = proposed.into_iter().collect();
    let tasks = tasks(arm, &models, &mountings, options, &mut assumed)?;
    options.progress.say("searching");
    let found = optimise_all(&tasks, options.parameters, &options.search)?;
    let motions: Vec<Motion> = found.paths.iter().map(|path| path.sample(options.rate)).collect();
    // The results are checked once more, sample by sample.
    for (task, motion) in tasks.iter().zip(&motions) {
        if let Some(why) = task.constraints.broken(motion) {
            return Err(Error::Broken(why));
        }
    }
    let references: Vec<&Model> = models.iter().collect();
    let objective = Objective::new(&references, options.parameters, 1)?;
    let limits = Limits::of(arm, 0.0)?;
    let conditions = objective.conditions(&motions);
    let trajectory = |((task, motion), mounting): ((Task<'_>, Motion), Mounting)| Trajectory {
        mounting,
        tightest: task.constraints.tightest(&motion),
        motion,
        limits: limits.clone(),
        constraints: task.constraints,
    };
    Ok(Excited {
        arm: arm.name.clone(),
        parameters: objective.size(),
        conditions,
        found,
        trajectories: tasks.into_iter().zip(motions).zip(mountings).map(trajectory).collect(),
        assumed,
    })
}

fn check(arm: &Arm, options: &ExciteOptions<'_>) -> Result<(), Error> {
    let period = std::f64::consts::TAU / options.search.fundamental;
    let radius = options.collision.map_or(RADIUS, |c| c.radius);
    for (name, value) in [("--rate", options.rate), ("--radius", radius), ("--period", period)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::Setting(format!("{name} must be above 0")));
        }
    }
    let samples = options.rate * period * options.search.periods as f64;
    if samples > MOST_SAMPLES {
        return Err(Error::Setting(format!(
            "--rate, --period and --periods make {samples:.0} samples: at most {MOST_SAMPLES} are allowed"
        )));
    }
    let clearance = options.collision.map_or(CLEARANCE, |c| c.clearance);
    if !(clearance.is_finite() && clearance >= 0.0) {
        return Err(Error::Setting("--clearance must not be below 0".to_string()));
    }
    match &options.from {
        Some(from) if from.len() != arm.dof() => {
            Err(Error::Setting(format!("--from has {} numbers, the arm {} joints", from.len(), arm.dof())))
        }
        _ => Ok(()),
    }
}

/// The constraints of each mounting's path; the assumptions for them.
fn tasks<'m>(
    arm: &Arm,
    models: &'m [Model],
    mountings: &[Mounting],
    options: &ExciteOptions<'_>,
    assumed: &mut Vec<String>,
) -> Result<Vec<Task<'m>>, Error> {
    let limits = Limits::of(arm, options.search.margin)?;
    let shape = Shape::new(arm, &limits.0, options.collision.map_or(RADIUS, |c| c.radius));
    let masses = match &options.masses {
        None => None,
        Some(source) => {
            let found = masses(arm, &models[0], mountings, source, &shape, &limits)?;
            assumed.push(format!("torque: {}", found.origin));
            if !arm.bars.is_empty() && *source == MassSource::Guess {
                assumed.push(format!("torque: bars of closed loops ({}) have no mass", arm.bar_names()));
            }
            assumed.extend(without_torque_limit(arm));
            Some(found)
        }
    };
    match options.collision {
        None => assumed.push("floor and self-collision were not checked".to_string()),
        Some(Collision { radius, clearance, .. }) => {
            assumed.push(format!(
                "links are capsules of radius {radius} m along the frames of the file, {clearance} m clear \
                    of each other and of the floor; adjoining ones may fold to about {:.0}°",
                2.0 * ((1.0 + 0.5 * clearance / radius) / 3.0).min(1.0).asin().to_degrees()
            ));
            let (of_floor, unknown): (Vec<usize>, Vec<usize>) =
                (0..arm.bars.len()).partition(|bar| shape.bars().any(|known| known == *bar));
            for (bars, what) in [(of_floor, "links"), (unknown, "links and floor")] {
                let names: Vec<String> =
                    bars.iter().map(|bar| format!("'{}'", arm.bars[*bar].name)).collect();
                if !names.is_empty() {
                    let names = names.join(", ");
                    assumed.push(format!("bars of closed loops ({names}) are not checked against {what}"));
                }
            }
            for (a, b) in shape.always_touching() {
                assumed.push(format!(
                    "links {a} and {b} touch in every pose with this radius: their distance is not checked"
                ));
            }
        }
    }
    let mut tasks = Vec::new();
    for (model, mounting) in models.iter().zip(mountings) {
        let space = options.collision.map(|Collision { floor, clearance, .. }| {
            let (space, height) = surroundings(arm, mounting, &shape, floor, clearance, &limits);
            assumed.push(match (height, floor) {
                (Some(height), Some(_)) => format!("base {mounting}: floor at {height} m"),
                (Some(height), None) => format!(
                    "base {mounting}: floor at {height} m, the base frame's origin; --floor says where it is"
                ),
                (None, _) => format!("base {mounting}: no floor"),
            });
            space
        });
        let load = masses.as_ref().map(|masses| Load::new(model, masses, &limits.0)).transpose()?;
        let constraints = Constraints { limits: limits.clone(), space, load, from: options.from.clone() };
        if let Some(from) = options.from.as_ref().filter(|from| constraints.lacks(from) > 0.0) {
            let mut pose = Motion::new(arm.dof(), 1.0);
            pose.push(from.iter().map(|q| [*q, 0.0, 0.0]));
            let free = Constraints { load: None, ..constraints };
            let why = free.broken(&pose).unwrap_or_else(|| "it is at the clearance".to_string());
            return Err(Error::NoStart { mounting: *mounting, why });
        }
        tasks.push(Task { model, constraints });
    }
    Ok(tasks)
}

/// The arm's masses.
fn masses(
    arm: &Arm,
    model: &Model,
    mountings: &[Mounting],
    source: &MassSource,
    shape: &Shape,
    limits: &Limits,
) -> Result<Masses, Error> {
    match (source, mountings.first()) {
        (MassSource::Guess, _) => Masses::guess(model, shape, &limits.0),
        (MassSource::Values { text, file }, Some(Mounting::Filed)) => Masses::parse(text, file, model),
        // Values belong to the arm as mounted in its file.
        (MassSource::Values { text, file }, _) => Masses::parse(text, file, &Model::derive(arm.clone())?),
    }
}

/// A note on joints without a torque limit.
fn without_torque_limit(arm: &Arm) -> Option<String> {
    let without: Vec<String> = (0..arm.dof())
        .filter(|j| arm.joints[*j].torque.is_none())
        .map(|j| JointNumber::from_index(j).to_string())
        .collect();
    (!without.is_empty())
        .then(|| format!("the arm file has no torque limit for joint {}", without.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is not known of the bars of an arm is among what is assumed.
    #[test]
    fn bars_are_named_where_they_are_not_checked() {
        let arm = Arm::parse(
            r#"
name = "palletiser"
convention = "modified"
gravity = [0, 0, -9.81]
[[joint]]
kind = "revolute"
a = 0
alpha = "-pi/2"
d = 0.5
theta = 0
position = [-1, 1]
velocity = 1
acceleration = 3
torque = 400
[[joint]]
kind = "revolute"
a = 0.5
alpha = 0
d = 0
theta = 0
position = [-1, 1]
velocity = 1
acceleration = 3
torque = 100
[[loop]]
joints = [2, "tail", "rod end", "crank"]
lengths = [0.2, 0.5, 0.2, 0.5]
inner = "pi"
outer = "pi"
bar = [{ name = "rod" }, { name = "crank" }]
"#,
            "arm.toml",
        )
        .unwrap();
        let models = [Model::derive(arm.clone()).unwrap()];
        let mut assumed = Vec::new();
        tasks(&arm, &models, &[Mounting::Filed], &ExciteOptions::default(), &mut assumed).unwrap();
        for line in [
            "torque: bars of closed loops ('rod', 'crank') have no mass",
            "bars of closed loops ('rod', 'crank') are not checked against links",
        ] {
            assert!(assumed.iter().any(|a| a == line), "{assumed:#?}");
        }
    }
}
