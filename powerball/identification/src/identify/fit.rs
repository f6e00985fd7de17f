//! The fit by the estimator that is asked for.
//!
//! The file also has a model along logs, for people to look at.

use super::gather::Gathered;
use super::judge::by_band;
use super::result::IdentifyError;
use super::{Estimator, IdentifyOptions};
use crate::estimate::{
    BaseModel, InBand, Solution, StandardErrors, TorqueCurve, curves, noise_floor, solve_in_band,
    solve_instrumental, solve_reduced, solve_robust, standard_errors,
};
use crate::mounting::Mounting;
use dyngen::exact::rational::to_f64;
use powerball_controller::JointNumber;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::Log;
use powerball_logs::regression::{Data, DataOptions, Recording, RigidArm};
use powerball_logs::signal::motion::occupied;
use powerball_logs::signal::motion::{Turns, turns};

/// A fit with its errors.
#[derive(Debug)]
pub(super) struct Fitted {
    pub solution: Solution,
    pub errors: StandardErrors,
    /// By joint: which of [`BANDS`](powerball_logs::summary::BANDS).
    pub bands: Vec<usize>,
}

/// From this share of doubted samples on, a joint is reported.
const DOUBTED: f64 = 0.01;

/// Fits what was gathered.
pub(super) fn fit(
    gathered: &Gathered,
    options: &IdentifyOptions<'_>,
    warnings: &mut Vec<String>,
) -> Result<Fitted, IdentifyError> {
    let (body, law) = (gathered.body(), options.friction);
    // What looks at single samples has one band, and logs of one mounting.
    let (logs, widest) = (&gathered.mounted[0].logs, vec![0; body.dof()]);
    match options.estimator {
        Estimator::Weighted => {
            let InBand { solution, bands } = solve_in_band(gathered.bands(), law);
            Ok(weighted(solution, bands))
        }
        Estimator::Instrumental => {
            let start = solve_reduced(gathered.bands().widest(), law);
            let (solution, errors) =
                solve_instrumental(body, logs, &options.data, &start).map_err(IdentifyError::Instruments)?;
            Ok(Fitted { solution, errors, bands: widest })
        }
        Estimator::Robust => {
            let robust = solve_robust(body, logs, &options.data, law)?;
            for (j, share) in robust.doubted.iter().enumerate().filter(|(_, share)| **share > DOUBTED) {
                warnings.push(format!(
                    "joint {}: {:.1} % of the torque samples were beyond belief and counted less",
                    JointNumber::from_index(j),
                    100.0 * share
                ));
            }
            Ok(weighted(robust.solution, widest))
        }
    }
}

fn weighted(solution: Solution, bands: Vec<usize>) -> Fitted {
    Fitted { errors: standard_errors(&solution), solution, bands }
}

// A model along logs, for people to look at: torques, motion, friction, and what repeats with positions.

/// Rows of a joint that its spectra are taken of; more would show no more.
const ROWS: usize = 20_000;
/// Cycles a turn: of the joint, and of the motor.
const JOINT_TURN: f64 = 24.0;
const MOTOR_TURN: f64 = 2.6;
/// The share of the velocities' power that says how fast a motion is.
const MOST_POWER: f64 = 0.99;

/// What a model predicts for logs: the validation set where there is one. Empty where there are no logs.
#[derive(Clone, Debug, Default)]
pub struct Along {
    /// Measured torque and error, by joint.
    pub curves: Vec<TorqueCurve>,
    /// Motion, friction and spectra, by joint.
    pub joints: Vec<JointAlong>,
    /// What the logs are.
    pub logs: Vec<LogFacts>,
    /// What noise alone leaves, by joint, N·m.
    pub noise_floor: Vec<f64>,
    /// How the base stood for them.
    pub mounting: Mounting,
    /// The frequency below which 99 % of the power of the velocities lies, Hz.
    pub motion: Option<f64>,
}

/// One joint along logs.
#[derive(Clone, Debug)]
pub struct JointAlong {
    /// Time along the logs, s, and position, rad or m; not a number between logs.
    pub position: Vec<(f64, f64)>,
    /// Time along the logs, s, and velocity, rad/s or m/s; not a number between logs.
    pub velocity: Vec<(f64, f64)>,
    /// Velocity, and what torque is left for friction, N·m.
    pub friction: Vec<(f64, f64)>,
    /// The error by cycles a turn of the joint.
    pub by_joint: Turns,
    /// The error up to a few cycles a turn of the motor, where the file has a gear ratio.
    pub by_motor: Turns,
}

/// What a log is.
#[derive(Clone, Debug, PartialEq)]
pub struct LogFacts {
    /// The log's name, without folders.
    pub name: String,
    /// Duration, s.
    pub seconds: f64,
    /// Samples.
    pub samples: usize,
    /// Samples a second.
    pub rate: f64,
    /// Pieces without a gap.
    pub pieces: usize,
}

impl Along {
    /// `joint_bands` are the ends of the joints' bands, Hz, in which the noise floor counts.
    pub(super) fn new(
        body: &RigidArm,
        logs: &[Log],
        mounting: Mounting,
        options: &DataOptions,
        joint_bands: &[f64],
        model: &BaseModel,
    ) -> Result<Along, IdentifyError> {
        if logs.is_empty() {
            return Ok(Along::default());
        }
        let data = Data::new(body, logs, options)?;
        let residual = model.residual(body, &data);
        let (joints, curves) = (
            (0..data.dof()).map(|j| JointAlong::new(&data, model, j, &residual[j])).collect(),
            curves(&data, &residual, &residual),
        );
        let (mut floor, motion) = (noise_floor(&data), motion(&data));
        // A band takes many times the memory of its logs.
        drop((data, residual));
        for band in by_band(body, logs, joint_bands, options) {
            let (members, data) = band?;
            let own = noise_floor(&data);
            members.into_iter().for_each(|j| floor[j] = own[j]);
        }
        Ok(Along {
            joints,
            curves,
            logs: logs.iter().map(LogFacts::of).collect(),
            noise_floor: floor,
            mounting,
            motion,
        })
    }
}

impl JointAlong {
    fn new(data: &Data<'_>, model: &BaseModel, j: usize, residual: &[f64]) -> JointAlong {
        let law = TanhFriction::new(model.friction[j].gamma());
        let (q, v) = rows(data, j);
        let ratio = data.body.arm().joints[j].rotor_ratio.as_ref().map(to_f64);
        let some = q.len().min(ROWS);
        let by = |least: f64, most: f64| turns(&q[..some], &residual[..some], least, most);
        JointAlong {
            position: along(data, |r, k| data.recordings[r].q[k * data.dof() + j]),
            velocity: along(data, |r, k| data.recordings[r].v[k * data.dof() + j]),
            friction: v.iter().zip(residual).map(|(v, e)| (*v, e + law.torque(*v))).collect(),
            by_joint: by(1.0, JOINT_TURN),
            by_motor: ratio.map_or(Turns::default(), |ratio| by(0.2 * ratio, MOTOR_TURN * ratio)),
        }
    }
}

impl LogFacts {
    fn of(log: &Log) -> LogFacts {
        let seconds = log.t.last().unwrap_or(&0.0) - log.t.first().unwrap_or(&0.0);
        let name = std::path::Path::new(&log.file).file_name();
        LogFacts {
            name: name.map_or(log.file.clone(), |n| n.to_string_lossy().into()),
            seconds,
            samples: log.t.len(),
            rate: log.t.len().saturating_sub(1) as f64 / seconds.max(f64::MIN_POSITIVE),
            pieces: log.pieces.len(),
        }
    }
}

/// The frequency below which 99 % of the power of the velocities lies, Hz.
fn motion(data: &Data<'_>) -> Option<f64> {
    let of = |r: &Recording| -> Vec<Vec<f64>> { (0..data.dof()).map(|j| r.velocity(j).collect()).collect() };
    let velocities: Vec<Vec<f64>> = data.recordings.iter().flat_map(of).collect();
    occupied(&velocities, data.rate(), MOST_POWER)
}

/// Positions and velocities of a joint's rows.
fn rows(data: &Data<'_>, j: usize) -> (Vec<f64>, Vec<f64>) {
    let at = data.recordings.iter().zip(&data.joints[j].kept).flat_map(|(recording, kept)| {
        let sample = data.joints[j].band.kept(recording.len());
        kept.iter().map(move |k| (recording, sample[*k])).collect::<Vec<_>>()
    });
    at.map(|(r, k)| (r.q[k * data.dof() + j], r.v[k * data.dof() + j])).unzip()
}

/// A value of every sample in the band along the logs, one after the other, broken between them.
fn along(data: &Data<'_>, value: impl Fn(usize, usize) -> f64) -> Vec<(f64, f64)> {
    let (mut points, mut start) = (Vec::new(), 0.0);
    for (r, recording) in data.recordings.iter().enumerate() {
        let kept = data.band.kept(recording.len());
        points.extend(kept.iter().map(|k| (start + *k as f64 / recording.rate, value(r, *k))));
        start += recording.len() as f64 / recording.rate + 1.0;
        points.push((start, f64::NAN));
    }
    points
}
