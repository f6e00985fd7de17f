//! A fit as a model: values with standard errors that hold for coloured residuals.
//!
//! The module also has the base model along logs, torques over time for plots, and the verdict on each joint.

use super::over_blocks;
use super::reduced::Solution;
use super::spectrum::noise_floor;
use super::uncertainty::StandardErrors;
use dyngen::{SetKind, Values};
use powerball_controller::JointNumber;
use powerball_controller::friction::TanhFriction;
use powerball_logs::parallel;
use powerball_logs::regression::{Block, Data, Recording, RigidArm, Signals};
use serde::{Deserialize, Serialize};

/// A parameter with its standard error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// The parameter's name: its sum of parameters.
    pub name: String,
    /// The estimate, SI units.
    pub value: f64,
    /// Standard error; `None` where the logs do not determine the parameter.
    #[serde(default)]
    pub std: Option<f64>,
    /// Standard error over |value|.
    #[serde(default)]
    pub relative_std: Option<f64>,
    /// 95 % interval, by Student's t.
    #[serde(default)]
    pub interval: Option<[f64; 2]>,
}

impl ParameterEstimate {
    /// A value without an error.
    #[must_use]
    pub fn plain(name: &str, value: f64) -> ParameterEstimate {
        ParameterEstimate { name: name.to_string(), value, std: None, relative_std: None, interval: None }
    }
}

/// Eq. 16 of a joint with standard errors of γ1 … γ5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointFriction {
    /// Joint, from 1.
    pub joint: usize,
    /// γ1, N·m.
    pub gamma1: f64,
    /// γ2, s/rad.
    pub gamma2: f64,
    /// γ3, N·m.
    pub gamma3: f64,
    /// γ4, s/rad.
    pub gamma4: f64,
    /// γ5, N·m·s/rad.
    pub gamma5: f64,
    /// Constant torque, N·m, where the law has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Standard errors of γ1 … γ5; null where not determined or at a bound.
    #[serde(default)]
    pub std: [Option<f64>; 5],
    /// Standard error of the Coulomb friction γ1 + γ3, N·m: where both bend alike the logs determine the sum
    /// far better than either. Left out where it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coulomb_std: Option<f64>,
}

impl JointFriction {
    /// γ1 … γ5 without errors; `joint` counts from 0.
    #[must_use]
    pub fn plain(joint: usize, [gamma1, gamma2, gamma3, gamma4, gamma5]: [f64; 5]) -> JointFriction {
        JointFriction {
            joint: joint + 1,
            gamma1,
            gamma2,
            gamma3,
            gamma4,
            gamma5,
            offset: None,
            std: [None; 5],
            coulomb_std: None,
        }
    }

    /// γ1 … γ5.
    #[must_use]
    pub fn gamma(&self) -> [f64; 5] {
        [self.gamma1, self.gamma2, self.gamma3, self.gamma4, self.gamma5]
    }
}

/// The values of a fit with their standard errors.
#[derive(Clone, Debug, Serialize)]
pub struct Estimates {
    /// The minimal set.
    pub parameters: Vec<ParameterEstimate>,
    /// Friction by joint.
    pub friction: Vec<JointFriction>,
}

/// How large an error is, by joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResidualStats {
    /// rms of the error, N·m.
    pub rms: Vec<f64>,
    /// rms of the error over rms of the measured torque.
    pub relative: Vec<f64>,
    /// rms of the error over the standard deviation of the measured torque; empty where that is not known.
    /// Not part of the JSON.
    #[serde(skip)]
    pub of_deviation: Vec<f64>,
    /// The end of the band in which the errors are, Hz, by joint: they are those from 0 to there.
    pub band: Vec<f64>,
    /// Samples in the band, of all joints' rows the most.
    pub samples: usize,
}

impl ResidualStats {
    /// The statistics of several data together; each comes with the rows of every joint.
    #[must_use]
    pub fn pooled(parts: &[(ResidualStats, Vec<usize>)]) -> Option<ResidualStats> {
        let dof = parts.first()?.0.rms.len();
        // Sums of squares of the errors and of the torques, and rows.
        let sums = |j: usize| {
            parts.iter().fold([0.0; 3], |[left, torque, rows], (stats, count)| {
                let (n, error) = (count[j] as f64, stats.rms[j]);
                let measured = if stats.relative[j] > 0.0 { error / stats.relative[j] } else { 0.0 };
                [left + n * error * error, torque + n * measured * measured, rows + n]
            })
        };
        // As many of the deviations.
        let deviation = |j: usize| {
            let (left, variance) = parts.iter().fold((0.0, 0.0), |(left, variance), (stats, count)| {
                let (n, error) = (count[j] as f64, stats.rms[j]);
                let ratio = stats.of_deviation.get(j).copied().unwrap_or(0.0);
                (
                    left + n * error * error,
                    variance + if ratio > 0.0 { n * (error / ratio).powi(2) } else { 0.0 },
                )
            });
            if variance > 0.0 { (left / variance).sqrt() } else { 0.0 }
        };
        let of_deviation = (0..dof).map(deviation).collect();
        let sums: Vec<[f64; 3]> = (0..dof).map(sums).collect();
        let ratio = |a: f64, b: f64| if b > 0.0 { (a / b).sqrt() } else { 0.0 };
        Some(ResidualStats {
            rms: sums.iter().map(|[left, _, rows]| ratio(*left, *rows)).collect(),
            relative: sums.iter().map(|[left, torque, _]| ratio(*left, *torque)).collect(),
            of_deviation,
            band: parts[0].0.band.clone(),
            samples: sums.iter().map(|[_, _, rows]| *rows as usize).max().unwrap_or(0),
        })
    }

    /// The joints that are predicted no better than by the mean of their torque; where that is not known,
    /// than by nothing.
    #[must_use]
    pub fn useless_joints(&self) -> Vec<JointNumber> {
        let ratios = if self.of_deviation.is_empty() { &self.relative } else { &self.of_deviation };
        (0..ratios.len()).filter(|j| ratios[*j] >= 1.0).map(JointNumber::from_index).collect()
    }
}

/// The spread of residuals on their data.
#[must_use]
pub fn residual_stats(data: &Data<'_>, residual: &[Vec<f64>]) -> ResidualStats {
    // A sum over nothing is -0 and would print so.
    let rms = |x: &[f64]| (x.iter().fold(0.0, |sum, v| sum + v * v) / x.len().max(1) as f64).sqrt();
    let errors: Vec<f64> = residual.iter().map(|r| rms(r)).collect();
    let relative = errors
        .iter()
        .zip(&data.joints)
        .map(|(e, joint)| {
            let measured = rms(&joint.torque);
            if measured > 0.0 { e / measured } else { 0.0 }
        })
        .collect();
    let deviation = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
        rms(&x.iter().map(|v| v - mean).collect::<Vec<_>>())
    };
    let of_deviation = (errors.iter().zip(&data.joints))
        .map(|(e, joint)| {
            let deviation = deviation(&joint.torque);
            if deviation > 0.0 { e / deviation } else { 0.0 }
        })
        .collect();
    ResidualStats {
        rms: errors,
        relative,
        of_deviation,
        band: data.joints.iter().map(|joint| joint.band.cutoff).collect(),
        samples: data.joints.iter().map(|j| j.len()).max().unwrap_or(0),
    }
}

/// The values of a solution of the minimal set `names`, with their errors.
#[must_use]
pub fn estimates(names: &[String], solution: &Solution, errors: &StandardErrors) -> Estimates {
    let layout = solution.layout;
    let parameters = names
        .iter()
        .enumerate()
        .map(|(c, name)| {
            let (value, std) = (solution.theta[c], errors.std[c]);
            ParameterEstimate {
                name: name.clone(),
                value,
                std,
                relative_std: std.filter(|_| value != 0.0).map(|s| s / value.abs()),
                interval: std.map(|s| [value - errors.quantile[c] * s, value + errors.quantile[c] * s]),
            }
        })
        .collect();
    let friction = (0..layout.dof)
        .map(|j| {
            let [gamma1, gamma2, gamma3, gamma4, gamma5] = solution.friction(j);
            let at = |k: usize| layout.friction(j, k);
            let std = |c: usize| errors.std[c];
            // The tangent's coefficient is level · Δ ln γ.
            let shape = |k: usize, gamma: f64| {
                let level = solution.theta[at(k)];
                std(at(3 + k)).filter(|_| level > 0.0).map(|s| s / level * gamma)
            };
            let determined = || [at(0), at(1)].into_iter().filter(|c| errors.std[*c].is_some());
            let variance: f64 =
                determined().flat_map(|a| determined().map(move |b| errors.covariance[(a, b)])).sum();
            JointFriction {
                joint: j + 1,
                gamma1,
                gamma2,
                gamma3,
                gamma4,
                gamma5,
                offset: (layout.extra > 0).then(|| solution.offset(j)),
                std: [std(at(0)), shape(0, gamma2), std(at(1)), shape(1, gamma4), std(at(2))],
                coulomb_std: (determined().count() > 0).then(|| variance.max(0.0).sqrt()),
            }
        })
        .collect();
    Estimates { parameters, friction }
}

/// The spread of what coefficients leave on the reduced logs.
#[must_use]
pub fn stats_of(solution: &Solution, theta: &[f64]) -> ResidualStats {
    let joints: Vec<(f64, f64, u64)> =
        (0..solution.layout.dof).map(|j| solution.mean_squares(j, theta)).collect();
    ResidualStats {
        rms: joints.iter().map(|(left, _, _)| left.sqrt()).collect(),
        relative: joints
            .iter()
            .map(|(left, torque, _)| if *torque > 0.0 { (left / torque).sqrt() } else { 0.0 })
            .collect(),
        of_deviation: Vec::new(),
        band: solution.bands.clone(),
        samples: joints.iter().map(|(_, _, rows)| *rows as usize).max().unwrap_or(0),
    }
}

// The base model along logs: the rigid arm in its minimal set and the friction of Eq. 16, nothing else.

/// The result of an identification: τ = rigid(q, q̇, q̈) + Eq. 16 friction.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseModel {
    /// The arm's name.
    pub arm: String,
    /// The minimal set's values, SI units.
    pub parameters: Vec<ParameterEstimate>,
    /// Eq. 16 by joint.
    pub friction: Vec<JointFriction>,
}

impl BaseModel {
    /// The model in the minimal set of a body, if its own parameters determine that set; else the unchanged
    /// model.
    #[must_use]
    pub fn in_set_of(mut self, body: &RigidArm) -> BaseModel {
        if let Some(parameters) = in_set_of(&self.parameters, &self.arm, body) {
            self.parameters = parameters;
        }
        self
    }

    /// Measured less predicted torque, by joint and row, N·m.
    #[must_use]
    pub fn residual(&self, body: &RigidArm, data: &Data<'_>) -> Signals {
        data.residual(&parallel::map(&data.recordings, |recording| self.torque(body, recording)))
    }

    /// The torque along one recording, n a sample, N·m.
    fn torque(&self, body: &RigidArm, recording: &Recording) -> Vec<f64> {
        let parameters: Vec<f64> = self.parameters.iter().map(|p| p.value).collect();
        let mut torque = body.torque(&recording.q, &recording.v, &recording.a, &parameters);
        let law = |f: &JointFriction| (TanhFriction::new(f.gamma()), f.offset.unwrap_or(0.0));
        let laws: Vec<(TanhFriction<f64>, f64)> = self.friction.iter().map(law).collect();
        for (row, velocities) in
            torque.chunks_exact_mut(recording.dof).zip(recording.v.chunks_exact(recording.dof))
        {
            for ((torque, velocity), (law, offset)) in row.iter_mut().zip(velocities).zip(&laws) {
                *torque += law.torque(*velocity);
                *torque += offset;
            }
        }
        torque
    }
}

/// Parameters in the minimal set of a body, which they determine: those that logs of several mountings
/// determine together, say. Errors of converted values are not known. `None` where nothing is to be
/// converted, or cannot be.
#[must_use]
pub fn in_set_of(
    parameters: &[ParameterEstimate],
    arm: &str,
    body: &RigidArm,
) -> Option<Vec<ParameterEstimate>> {
    let names = body.names();
    if names.iter().all(|name| parameters.iter().any(|p| p.name == *name)) {
        return None;
    }
    let values = Values::named(parameters.iter().map(|p| (p.name.as_str(), p.value)), arm);
    let model = body.model();
    let values = values.of_set(model, model.set(SetKind::Minimal).ok()?).ok()?;
    let plain = |(name, value): (&String, f64)| ParameterEstimate::plain(name, value);
    Some(names.iter().zip(values).map(plain).collect())
}

// Torques over time, for people to look at.

/// Between two recordings on the axis of a figure, s.
const BETWEEN: f64 = 1.0;

/// Measured and predicted torque of one joint, in the band, by row.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueCurve {
    /// Time along the logs, one after the other without their pauses, s.
    pub t: Vec<f64>,
    /// Measured torque, N·m.
    pub measured: Vec<f64>,
    /// Measured minus predicted by one model (the base model, where two are compared), N·m.
    pub before: Vec<f64>,
    /// Measured minus predicted by the other one (with all accepted effects), N·m.
    pub after: Vec<f64>,
    /// Places where rows are missing before a row: the end of a log, or a rest phase.
    pub breaks: Vec<usize>,
}

impl TorqueCurve {
    /// The points of one quantity, with a point that is not a number wherever rows are missing.
    #[must_use]
    pub fn points(&self, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(self.t.len() + self.breaks.len());
        let mut breaks = self.breaks.iter().peekable();
        for (row, t) in self.t.iter().enumerate() {
            if breaks.next_if(|at| **at == row).is_some() {
                points.push((*t, f64::NAN));
            }
            points.push((*t, value(row)));
        }
        points
    }
}

/// The curves of every joint from the residuals of both models.
#[must_use]
pub fn curves(data: &Data<'_>, before: &[Vec<f64>], after: &[Vec<f64>]) -> Vec<TorqueCurve> {
    (0..data.dof())
        .map(|j| {
            let rows = &data.joints[j];
            let (mut t, mut breaks) = (Vec::with_capacity(rows.len()), Vec::new());
            let mut start = 0.0;
            for (recording, kept) in data.recordings.iter().zip(&rows.kept) {
                let sample = rows.band.kept(recording.len());
                for (i, k) in kept.iter().enumerate() {
                    if i == 0 || kept[i - 1] + 1 != *k {
                        breaks.push(t.len());
                    }
                    t.push(start + sample[*k] as f64 / recording.rate);
                }
                start += recording.len() as f64 / recording.rate + BETWEEN;
            }
            let (before, after) = (before[j].clone(), after[j].clone());
            TorqueCurve { t, measured: rows.torque.clone(), before, after, breaks }
        })
        .collect()
}

// A model that is there already, judged on logs that it has not seen.

/// How a joint's prediction does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointVerdict {
    /// Joint, from 1.
    pub joint: usize,
    /// rms of the error, N·m.
    pub rms: f64,
    /// 95 % interval of the rms, from blocks that count as independent, N·m.
    pub interval: [f64; 2],
    /// rms of the error over rms of the measured torque.
    pub relative: f64,
    /// Residual of white measurement noise alone, N·m.
    pub noise_floor: f64,
    /// Whether even the upper end of the interval is within the tolerance; `None` where the joint does not
    /// move in these logs.
    pub within: Option<bool>,
}

/// Judges the residual of a model on data: an error up to `tolerance` times the rms torque of a joint passes.
#[must_use]
pub fn verdicts(data: &Data<'_>, residual: &[Vec<f64>], tolerance: f64) -> Vec<JointVerdict> {
    let errors = residual_stats(data, residual);
    let floor = noise_floor(data);
    (0..data.dof())
        .map(|j| {
            let rms = errors.rms[j];
            let interval = interval(data, j, &residual[j]);
            let torque = if errors.relative[j] > 0.0 { rms / errors.relative[j] } else { 0.0 };
            let moves = !data.joints[j].is_empty();
            JointVerdict {
                joint: j + 1,
                rms,
                interval,
                relative: errors.relative[j],
                noise_floor: floor[j],
                within: moves.then_some(interval[1] <= tolerance * torque),
            }
        })
        .collect()
}

/// The interval of the mean square over blocks.
fn interval(data: &Data<'_>, joint: usize, residual: &[f64]) -> [f64; 2] {
    let of = |block: &Block| {
        let rows = block.rows[joint].clone();
        (residual[rows.clone()].iter().map(|r| r * r).sum(), rows.len() as f64)
    };
    let (mean, half) = over_blocks(&data.blocks.iter().map(of).collect::<Vec<_>>());
    if half.is_infinite() {
        return [0.0, f64::MAX];
    }
    [(mean - half).max(0.0).sqrt(), (mean + half).sqrt()]
}
