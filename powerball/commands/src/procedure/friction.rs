//! The friction experiment (§II.C): each joint alone at constant velocities where gravity does not load it,
//! and the law that fits.

use super::constant_velocity::{self, Bounds, Plan};
use super::gravity_free::{self, GravityFree};
use super::laws::{Point, Rated, choose};
use super::{Behind, Cleared, Columns, LogTime, RecordError, Recorder, resume};
use dyngen::Model;
use powerball_bus::transport::Bus;
use powerball_identification::mounting::Mounting;
use powerball_logs::log::{LogError, read_log};
use serde_json::{Value, json};
use std::fs::File;
use std::path::{Path, PathBuf};

/// The planned experiment of a joint.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The pose in which gravity does not load the joint.
    pub place: GravityFree,
    /// The motion.
    pub plan: Plan,
}

/// The result from a joint's log.
#[derive(Clone, Debug)]
pub struct JointFriction {
    /// Joint, from 0.
    pub joint: usize,
    /// How the base was mounted, and the pose.
    pub place: GravityFree,
    /// Mean torques of the plateaus.
    pub points: Vec<Point>,
    /// Every law, rated.
    pub laws: Vec<Rated>,
    /// Index of the law that is chosen.
    pub chosen: usize,
}

/// Why an experiment has no result.
#[derive(Debug, thiserror::Error)]
pub enum FrictionError {
    /// The arm file lacks something.
    #[error("{0}")]
    Arm(String),
    /// The arm, or the file of its log.
    #[error("{0}")]
    Record(RecordError),
    /// A log could not be opened for writing.
    #[error("{}: cannot be written: {}", .0.display(), .1)]
    Write(PathBuf, std::io::Error),
    /// A log cannot be read.
    #[error("{0}")]
    Log(LogError),
    /// A log holds too few plateaus.
    #[error("{}: fewer than five velocities can be determined from this log: delete it and record the joint \
        again", .0.display())]
    TooLittle(PathBuf),
}

impl From<RecordError> for FrictionError {
    fn from(e: RecordError) -> Self {
        FrictionError::Record(e)
    }
}

/// Share of a joint's acceleration that the ramps use.
const SHARE: f64 = 0.5;

/// Plans a joint's experiment in a mounting; `None` where gravity cannot be kept off the joint there.
///
/// # Errors
/// [`FrictionError::Arm`] where the arm file gives the joint no limits.
pub fn plan(
    model: &Model,
    joint: usize,
    mounting: Mounting,
    period: f64,
) -> Result<Option<Experiment>, FrictionError> {
    let row = &model.arm().joints[joint];
    let missing =
        |key: &str| FrictionError::Arm(format!("joint {} needs `{key}` in the arm file", joint + 1));
    let position = row.position.ok_or_else(|| missing("position"))?;
    let velocity = row.velocity.ok_or_else(|| missing("velocity"))?;
    let acceleration = SHARE * row.acceleration.ok_or_else(|| missing("acceleration"))?;
    let place = gravity_free::best(model, joint, mounting);
    if place.leftover > gravity_free::FREE {
        return Ok(None);
    }
    let velocities = constant_velocity::velocities(velocity);
    let plan =
        constant_velocity::plan(joint, &place.pose, Bounds { position, acceleration }, &velocities, period);
    Ok(Some(Experiment { place, plan }))
}

/// The log of a joint's experiment in a folder.
#[must_use]
pub fn log_file(folder: &Path, joint: usize) -> PathBuf {
    folder.join(format!("friction_{}.csv", joint + 1))
}

/// Runs a joint's experiment: goes to the pose and records the motion, which was checked before the arm was
/// released. Returns its log, which may not be completely written yet: [close](Behind::close) it when the arm
/// stands.
///
/// # Errors
/// Where the arm stops, or the log cannot be written.
pub fn run<B: Bus, const N: usize>(
    recorder: &mut Recorder<B, N>,
    joint: usize,
    motion: &Cleared,
    folder: &Path,
) -> Result<Behind<File>, FrictionError> {
    let path = log_file(folder, joint);
    let start = motion.motion().samples().next().and_then(|[q, ..]| <[f64; N]>::try_from(q).ok());
    if let Some(start) = start {
        recorder.go(&start, 0.25, 1.0)?;
    }
    let mut log = Behind::new(File::create(&path).map_err(|e| FrictionError::Write(path, e))?);
    recorder.record(motion, &mut LogTime::default(), Columns::Everything, &mut log)?;
    Ok(log)
}

/// Whether a log reaches the end of the motion.
#[must_use]
pub fn is_complete(path: &Path, experiment: &Experiment) -> bool {
    let motion = &experiment.plan.motion;
    resume::last_time(path).is_some_and(|t| t > motion.duration() - 2.0 * motion.period)
}

/// Fits the laws to a joint's log.
///
/// # Errors
/// Where the log cannot be read or holds too little.
pub fn analyse(model: &Model, experiment: &Experiment, path: &Path) -> Result<JointFriction, FrictionError> {
    let joint = experiment.plan.joint;
    // This experiment has on purpose what a reader of logs doubts (a joint that rests, say).
    let log = read_log(path, model.arm(), &mut Vec::new()).map_err(FrictionError::Log)?;
    let points = experiment.plan.points(&log.t, &log.torque[joint]);
    let (laws, chosen) = choose(&points).ok_or_else(|| FrictionError::TooLittle(path.to_path_buf()))?;
    Ok(JointFriction { joint, place: experiment.place.clone(), points, laws, chosen })
}

impl JointFriction {
    /// The result as a JSON object.
    #[must_use]
    pub fn json(&self) -> Value {
        let law = |rated: &Rated| {
            let f = &rated.fitted;
            json!({"law": f.law.name(), "levels": f.levels, "shapes": f.shapes, "constant_torque": f.offset,
                "held_out_rms": rated.held_out, "gamma": f.gamma()})
        };
        let point = |p: &Point| json!({"velocity": p.velocity, "torque": p.torque, "error": p.error});
        json!({
            "joint": self.joint + 1,
            "mounting": self.place.mounting.to_string(),
            "pose": self.place.pose,
            "points": self.points.iter().map(point).collect::<Vec<_>>(),
            "laws": self.laws.iter().map(law).collect::<Vec<_>>(),
            "chosen": self.laws[self.chosen].fitted.law.name(),
            // Eq. 16 is always fitted: the rest of the software works with it.
            "gamma": self.laws[0].fitted.gamma(),
        })
    }
}

#[cfg(test)]
#[cfg(feature = "demo")]
mod tests {
    use super::*;
    use crate::procedure::Envelope;
    use powerball_bus::driver::Driver;
    use powerball_bus::driver::lwa4p::LWA4P;
    use powerball_bus::transport::{Master, Memory};
    use powerball_controller::friction::{TABLE_2, TanhFriction};
    use powerball_virtual_arm::{VirtualArm, lwa4p};

    /// Table 2's curves come back within 1 % of their range over the bus: encoder steps, current noise, servo
    /// and all. One joint of each mounting.
    #[test]
    fn table_2_is_recovered_on_the_virtual_arm() {
        let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
        let folder = std::env::temp_dir().join(format!("powerball_friction_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for (joint, mounting) in [(4, Mounting::Filed), (1, Mounting::Turned { roll: 0.0, pitch: 90.0 })] {
            let experiment = plan(&model, joint, mounting, LWA4P.period_seconds()).unwrap().unwrap();
            let mut setup = lwa4p::setup([0.0; 6], 3).unwrap();
            setup.plant = lwa4p::mounted(mounting.gravity(model.arm())).unwrap();
            let bus = Memory::new(VirtualArm::new(setup).unwrap(), LWA4P.bitrate);
            let mut recorder =
                Recorder::enable(Master::new(Driver::new(LWA4P).unwrap(), bus), Envelope::new(|_| None))
                    .unwrap();
            let motion = recorder.clear(experiment.plan.motion.clone()).unwrap();
            run(&mut recorder, joint, &motion, &folder).unwrap().close().1.unwrap();
            let path = log_file(&folder, joint);
            assert!(is_complete(&path, &experiment));
            let found = analyse(&model, &experiment, &path).unwrap();
            let truth = TanhFriction::new(TABLE_2[joint]);
            let range = truth.torque(0.55);
            for k in 1..=55 {
                let v = f64::from(k) * 0.01;
                let error = (found.laws[0].fitted.torque(v) - truth.torque(v)).abs();
                assert!(error < 0.01 * range, "joint {}: {error} of {range} at {v}", joint + 1);
            }
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
