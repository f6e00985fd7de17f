//! The result of an explanation; serialized it is explained.json.
//!
//! The module also has the report on an experiment that distinguishes names, and the plot that shows an
//! effect.

use super::super::comparison::Open;
use super::super::model::Model;
use super::super::named::{FalsePositives, FitErrors, NamedEffect};
use super::super::study::Study;
use super::logs::LogResult;
use super::unattributed::{Unattributed, quantile_bins};
use super::unnamed::UnnamedLaw;
use super::verdict::Verdict;
use crate::effects::{Axis, Context};
use crate::torque_model::TorqueModel;
use powerball_controller::JointNumber;
use powerball_identification::conventions::Conventions;
pub use powerball_identification::estimate::{TorqueCurve, curves};
use powerball_identification::transmission::JointTransmission;
use powerball_identification::usable::Findings;
use serde::Serialize;
use std::sync::Arc;

/// The result of the residual loop.
#[derive(Clone, Debug, Serialize)]
pub struct Explained {
    /// Why this result should not be used; empty where it can be.
    pub unusable: Vec<String>,
    /// How well each joint's torque is predicted: the first thing to read.
    pub verdict: Vec<Verdict>,
    /// Whether each log is like the others, and its differences; the fitted logs come first.
    pub logs: Vec<LogResult>,
    /// The arm's name.
    pub arm: String,
    /// The arm file, as its path was given to the command; `None` for an arm in memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm_file: Option<String>,
    /// Whether each joint slides: its torques are forces, N; not part of the JSON.
    #[serde(skip)]
    pub sliding: Vec<bool>,
    /// The joints that do not move in the logs to fit; not part of the JSON.
    #[serde(skip)]
    pub resting: Vec<JointNumber>,
    /// The meaning of the logs' columns, if they were checked.
    pub conventions: Option<Conventions>,
    /// The transmission between the motors' torques and the links', by joint, if logs hold both. Its effects
    /// are on the motors' side: none of them is in `effects`, nor in the errors here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Vec<JointTransmission>>,
    /// Errors of the base model.
    pub before: FitErrors,
    /// Errors with all accepted effects.
    pub after: FitErrors,
    /// How the error of each joint that moves changes on the validation set.
    pub held_out_change: Vec<Change>,
    /// Residual of white measurement noise alone in the band, by joint, N·m.
    pub noise_floor: Vec<f64>,
    /// By joint, the share of the squared error left on the validation set that a smooth function of the
    /// joints' states would take away there: much where a law is missing, little where the rest is noise.
    pub explainable: Vec<f64>,
    /// Accepted effects in the order in which they were added.
    pub effects: Vec<NamedEffect>,
    /// Effects without a name, as formulas.
    pub laws: Vec<UnnamedLaw>,
    /// Band of all errors here, Hz: the widest, where joints have their own.
    pub band: [f64; 2],
    /// The upper end of each joint's band, Hz.
    pub bands: Vec<f64>,
    /// How long the fitted logs are, s.
    pub fitted_time: f64,
    /// Equivalent number of independent samples in the residuals, all joints together.
    pub effective_samples: usize,
    /// The part of the residual that no candidate explains.
    pub unattributed: Option<Unattributed>,
    /// The recording that would distinguish the names that these logs leave open.
    pub next_experiment: Option<NextExperiment>,
    /// The decision of an experiment that was made for open names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experiment: Option<Experiment>,
    /// The open names, fitted; not part of the JSON.
    #[serde(skip)]
    pub open: Option<Arc<Open>>,
    /// How often the rule accepts effects that are not there, on these data.
    pub false_positives: FalsePositives,
    /// Faults of the logs and the arm file, and how they were handled.
    pub warnings: Vec<String>,
    /// Torques over time on the validation set, by joint; not part of the JSON.
    #[serde(skip)]
    pub curves: Vec<TorqueCurve>,
    /// The model with all named effects: model.json. Its errors are `after`, except if each joint was fitted
    /// by itself, because it has one body for all.
    #[serde(skip)]
    pub model: TorqueModel,
    /// The plots that show the effects; not part of the JSON.
    #[serde(skip)]
    pub shown: Vec<Shown>,
}

impl Explained {
    /// Adds what the columns are, and why the result should not be used.
    #[must_use]
    pub fn with_columns(mut self, columns: Conventions) -> Explained {
        // Of which no more than noise is left is no useless joint.
        let is_open =
            |joint: &JointNumber| self.verdict.iter().any(|v| v.joint == *joint && !v.state.is_good());
        let useless = self.after.validate.useless_joints().into_iter().filter(is_open).collect();
        let rms = &self.after.validate.rms;
        let not_finite = rms.iter().any(|x| !x.is_finite());
        let resting = self.resting.clone();
        let findings =
            Findings { columns: Some(&columns), resting, useless, not_finite, ..Findings::default() };
        self.unusable = findings.reasons();
        self.conventions = Some(columns);
        self
    }
}

/// The change of a joint's error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The joint.
    pub joint: JointNumber,
    /// rms after over rms before, less 1.
    pub rms: f64,
    /// 95 % interval of the change, from blocks that count as independent.
    pub interval: [f64; 2],
}

// The report on an experiment that distinguishes names.

/// The recording that would distinguish the names that logs leave open.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextExperiment {
    /// A sentence that says what to do.
    pub advice: String,
    /// The names.
    pub to_tell_apart: Vec<&'static str>,
    /// The path to record.
    #[serde(flatten)]
    pub trajectory: Trajectory,
}

/// The path of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Trajectory {
    /// None was looked for.
    NotDesigned {},
    /// None could be found.
    None {
        /// Always `None`: null in explained.json, next to the reason.
        trajectory: Option<&'static str>,
        /// Why.
        no_trajectory: String,
    },
    /// One was designed.
    Designed {
        /// The joints that the names are of.
        joints: Vec<JointNumber>,
        /// Name of the trajectory's file.
        trajectory: &'static str,
        /// rms of the difference that would stay, over the residual's own rms, by joint.
        expected_difference: Vec<f64>,
        /// χ² by which the wrong name would fall behind.
        expected_evidence: f64,
        /// The expected evidence of the median random path.
        of_a_usual_path: f64,
        /// How long it takes, s.
        duration: f64,
    },
}

/// The decision of an experiment that was made for open names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Experiment {
    /// The names that were open.
    pub to_tell_apart: Vec<&'static str>,
    /// The log of the experiment.
    pub log: String,
    /// The name that is right; `None` where the logs cannot say.
    pub decided: Option<&'static str>,
    /// Why, in words.
    pub why: String,
    /// χ² by which the better name leads on the fitted logs.
    pub evidence: f64,
    /// Probability of so large a lead by chance.
    pub p_value: f64,
    /// χ² by which it leads on the held-out logs.
    pub held_out_evidence: f64,
    /// The names that were given before.
    pub named_before: Vec<String>,
}

impl NextExperiment {
    /// Advice alone.
    #[must_use]
    pub(crate) fn not_designed(names: Vec<&'static str>) -> NextExperiment {
        NextExperiment {
            advice: format!(
                "record the joints concerned on a path with other positions, velocities and loads than these \
                 logs, where {} predict different torques",
                names.join(" and ")
            ),
            to_tell_apart: names,
            trajectory: Trajectory::NotDesigned {},
        }
    }
}

// The plot that shows an effect: a joint's residual over the signal that the effect depends on, without it
// and with it.

/// An effect on one joint, seen on the fitted logs.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// The effect's name.
    pub effect: String,
    /// The joint.
    pub joint: JointNumber,
    /// The signal with its unit.
    pub signal: String,
    /// Whether torques are taken against the direction of motion: friction is then positive.
    pub against_motion: bool,
    /// By row: the signal; the residual of the model without this effect but with all others; the residual
    /// with it; the torque of the effect.
    pub rows: Vec<[f64; 4]>,
    /// The columns of `rows` as means over equal shares of the rows, in the order of the signal; none over
    /// time.
    pub means: Vec<[f64; 4]>,
}

/// Means along the signal.
const MEANS: usize = 24;
/// Joints shown of an effect that acts on several.
const JOINTS: usize = 2;
/// An effect that builds up over a distance is seen within this many times the distance.
const WAYS: f64 = 10.0;
/// Steps of the encoders look like turning back; a joint turns back when it has come this far the other way,
/// rad or m.
const TURNED: f64 = 1e-3;

/// The plots of all accepted effects, each on the joints where it explains most.
pub(crate) fn shown(study: &Study<'_>, model: &Model) -> Vec<Shown> {
    let context = model.context(study);
    let mut shown = Vec::new();
    for (a, coefficients) in model.accepted.iter().zip(model.coefficients()) {
        let columns = context.columns(&a.candidate);
        let mut best: Vec<(f64, usize, Vec<f64>)> = Vec::new();
        for j in 0..study.data.dof() {
            let mut own = vec![0.0; study.data.joints[j].len()];
            for (column, c) in columns.iter().zip(&coefficients) {
                let values = column.at(j).unwrap_or_default();
                own.iter_mut().zip(values).for_each(|(o, v)| *o += c * v);
            }
            let size = model.fit.weights[j] * own.iter().map(|v| v * v).sum::<f64>();
            if size > 0.0 {
                best.push((size, j, own));
            }
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        let axis = a.effect().shown_by(&a.candidate);
        for (_, j, own) in best.into_iter().take(JOINTS) {
            shown.push(plot(&context, a.effect().name(), axis, j, &own));
        }
    }
    shown
}

fn plot(context: &Context<'_>, effect: &str, axis: Axis, joint: usize, own: &[f64]) -> Shown {
    let signal = values(context, axis, joint, own);
    let against_motion = matches!(axis, Axis::Load | Axis::Travel(_) | Axis::Warmth);
    let velocity = rows(context, joint, |r| context.data.recordings[r].velocity(joint).collect());
    let sign = |row: usize| if against_motion { velocity[row].signum() } else { 1.0 };
    let seen = |row: &usize| !matches!(axis, Axis::Travel(way) if signal[*row] > WAYS * way);
    let rows: Vec<[f64; 4]> = (0..signal.len())
        .filter(seen)
        .map(|row| {
            let (after, own) = (sign(row) * context.residual[joint][row], sign(row) * own[row]);
            [signal[row], after + own, after, own]
        })
        .collect();
    // Means over a time in which the arm goes here and there say nothing.
    let means = if axis == Axis::Time { Vec::new() } else { means(&rows) };
    Shown {
        effect: effect.to_string(),
        joint: JointNumber::from_index(joint),
        signal: in_words(axis, joint, context),
        against_motion,
        rows,
        means,
    }
}

fn means(rows: &[[f64; 4]]) -> Vec<[f64; 4]> {
    let mut means = vec![[0.0; 4]; MEANS];
    let mut counts = [0.0; MEANS];
    let signal: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    for (row, bin) in rows.iter().zip(quantile_bins(&signal, MEANS)) {
        means[bin].iter_mut().zip(row).for_each(|(m, v)| *m += v);
        counts[bin] += 1.0;
    }
    means.iter_mut().zip(counts).for_each(|(m, n)| m.iter_mut().for_each(|v| *v /= n));
    means.retain(|m| m.iter().all(|v| v.is_finite()));
    means
}

fn in_words(axis: Axis, joint: usize, context: &Context<'_>) -> String {
    let unit = |j: JointNumber| match context.data.body.arm().joints[j.index()].kind {
        dyngen::arm::JointKind::Prismatic => "m",
        dyngen::arm::JointKind::Revolute => "rad",
    };
    match axis {
        Axis::Position(j) => format!("position of joint {j} [{}]", unit(j)),
        Axis::Cycle(order) => format!("place within a cycle, {order:.1} cycles a turn [cycles]"),
        Axis::Velocity(j) => format!("velocity of joint {j} [{}/s]", unit(j)),
        Axis::Torque => "torque of the rigid arm [N·m]".to_string(),
        Axis::Load => "size of the torque that the rigid arm requires at the joint [N·m]".to_string(),
        Axis::Travel(_) => {
            format!("way since the joint turned back [{}]", unit(JointNumber::from_index(joint)))
        }
        Axis::TorqueRate => "change of the rigid arm's torque [N·m/s]".to_string(),
        Axis::Warmth | Axis::Time => "time along all logs [s]".to_string(),
        Axis::Law => "what the effect adds [N·m]".to_string(),
    }
}

/// The signal by row.
fn values(context: &Context<'_>, axis: Axis, joint: usize, own: &[f64]) -> Vec<f64> {
    let data = context.data;
    let n = data.dof();
    let rigid =
        |r: usize| -> Vec<f64> { context.rigid()[r].iter().skip(joint).step_by(n).copied().collect() };
    match axis {
        Axis::Position(j) => rows(context, joint, |r| data.recordings[r].position(j.index()).collect()),
        Axis::Cycle(order) => rows(context, joint, |r| {
            let cycles = |q: f64| (order * q / std::f64::consts::TAU).rem_euclid(1.0);
            data.recordings[r].position(joint).map(cycles).collect()
        }),
        Axis::Velocity(j) => rows(context, joint, |r| data.recordings[r].velocity(j.index()).collect()),
        Axis::Torque => rows(context, joint, rigid),
        Axis::Load => rows(context, joint, |r| rigid(r).into_iter().map(f64::abs).collect()),
        Axis::Travel(_) => rows(context, joint, |r| travel(data.recordings[r].position(joint))),
        Axis::TorqueRate => rows(context, joint, |r| {
            let (torque, rate) = (rigid(r), data.recordings[r].rate);
            let last = torque.len() - 1;
            (0..=last)
                .map(|k| (torque[(k + 1).min(last)] - torque[k.saturating_sub(1)]) * 0.5 * rate)
                .collect()
        }),
        Axis::Warmth | Axis::Time => rows(context, joint, |r| {
            let recording = &data.recordings[r];
            (0..recording.len()).map(|k| recording.clock + k as f64 / recording.rate).collect()
        }),
        Axis::Law => own.to_vec(),
    }
}

/// A full-rate signal at a joint's rows.
fn rows(context: &Context<'_>, joint: usize, signal: impl Fn(usize) -> Vec<f64>) -> Vec<f64> {
    let (data, rows) = (context.data, &context.data.joints[joint]);
    let mut out = Vec::with_capacity(rows.len());
    for (r, recording) in data.recordings.iter().enumerate() {
        let (values, kept) = (signal(r), rows.band.kept(recording.len()));
        out.extend(rows.kept[r].iter().map(|k| values[kept[*k]]));
    }
    out
}

/// How far a joint has come since it last turned back.
fn travel(q: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut turned, mut furthest, mut way) = (None, 0.0, 0.0f64);
    q.map(|x| {
        let from = *turned.get_or_insert_with(|| {
            furthest = x;
            x
        });
        if way == 0.0 {
            way = if (x - from).abs() > TURNED { (x - from).signum() } else { 0.0 };
        }
        if way * (x - furthest) >= 0.0 {
            furthest = x;
        } else if way * (furthest - x) > TURNED {
            (turned, way) = (Some(furthest), -way);
            furthest = x;
        }
        (x - turned.unwrap_or(x)).abs()
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_follow_the_signal_and_share_the_rows() {
        let rows: Vec<[f64; 4]> =
            (0..240).rev().map(|k| [f64::from(k), 2.0 * f64::from(k), 1.0, 0.0]).collect();
        let means = means(&rows);
        assert_eq!(means.len(), MEANS);
        assert!(means.windows(2).all(|m| m[0][0] < m[1][0]));
        assert!(means.iter().all(|m| (m[1] - 2.0 * m[0]).abs() < 1e-9 && m[2] == 1.0));
        assert!(super::means(&[]).is_empty());
    }

    #[test]
    fn travel_counts_from_where_the_joint_turned_back() {
        let q: Vec<f64> = (0..=400).map(|k| (f64::from(k) * std::f64::consts::TAU / 200.0).cos()).collect();
        let way = travel(q.iter().copied());
        // It begins at its top, comes down by 2, turns, and so on; steps below a milliradian are no turning
        // back.
        for (k, want) in [(50, 1.0), (99, 2.0), (150, 1.0), (199, 2.0), (250, 1.0)] {
            assert!((way[k] - want).abs() < 0.01, "{k}: {}", way[k]);
        }
        assert!(way.iter().all(|w| (0.0..=2.001).contains(w)));
        let still = travel((0..100).map(|k| 1e-5 * f64::from(k % 2)));
        assert!(still.iter().all(|w| *w < 1e-4));
    }
}
