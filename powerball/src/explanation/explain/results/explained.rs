//! What an explanation says; serialized it is explained.json.
//!
//! Also here: torques over time on the validation set, for people to look at.

use super::super::comparison::Open;
use super::super::named::{FalsePositives, FitErrors, NamedEffect};
use super::laws::UnnamedLaw;
use super::logs::LogResult;
use super::next::{Experiment, NextExperiment};
use super::shown::Shown;
use super::unattributed::Unattributed;
use super::verdict::{State, Verdict};
use crate::controller::JointNumber;
use crate::explanation::torque_model::TorqueModel;
use crate::identification::conventions::Conventions;
pub use crate::identification::estimate::{TorqueCurve, curves};
use crate::identification::transmission::JointTransmission;
use serde::Serialize;
use std::sync::Arc;

/// The result of the residual loop.
#[derive(Clone, Debug, Serialize)]
pub struct Explained {
    /// How far each joint's torque is explained: the first thing to read.
    pub verdict: Vec<Verdict>,
    /// Whether each log is like the others, and what differs where it is not: those that were fitted first.
    pub logs: Vec<LogResult>,
    /// The arm's name.
    pub arm: String,
    /// Whether each joint slides: its torques are forces, N; not part of the JSON.
    #[serde(skip)]
    pub sliding: Vec<bool>,
    /// What the columns of the logs are, where they were asked.
    pub conventions: Option<Conventions>,
    /// What is between the motors' torques and the links', by joint, where logs hold both. Its effects are on
    /// the motors' side: none of them is in `effects`, nor in the errors here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Vec<JointTransmission>>,
    /// Errors of the base model.
    pub before: FitErrors,
    /// Errors with all accepted effects.
    pub after: FitErrors,
    /// How the error of each joint that moves changes on the validation set.
    pub held_out_change: Vec<Change>,
    /// What white measurement noise alone would leave in the band, by joint, N·m.
    pub noise_floor: Vec<f64>,
    /// Accepted effects in the order in which they were added.
    pub effects: Vec<NamedEffect>,
    /// What is there without a name, as formulas.
    pub laws: Vec<UnnamedLaw>,
    /// Band of all errors here, Hz: the widest, where joints have their own.
    pub band: [f64; 2],
    /// The upper end of each joint's band, Hz.
    pub bands: Vec<f64>,
    /// How long the fitted logs are, s.
    pub fitted_time: f64,
    /// Samples that the residuals are worth, all joints together.
    pub effective_samples: usize,
    /// What no candidate explains.
    pub unattributed: Option<Unattributed>,
    /// What to record to tell the names apart that these logs leave open.
    pub next_experiment: Option<NextExperiment>,
    /// What an experiment that was made for open names has decided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experiment: Option<Experiment>,
    /// The open names, fitted; not part of the JSON.
    #[serde(skip)]
    pub open: Option<Arc<Open>>,
    /// How often the rule accepts effects that are not there, on these data.
    pub false_positives: FalsePositives,
    /// What was found in logs and arm file, and what was done about it.
    pub warnings: Vec<String>,
    /// Torques over time on the validation set, by joint; not part of the JSON.
    #[serde(skip)]
    pub curves: Vec<TorqueCurve>,
    /// The model with everything that was named: model.json. Its errors are `after`; not where each joint was
    /// fitted by itself, as it has one body for all.
    #[serde(skip)]
    pub model: TorqueModel,
    /// The plots that show the effects; not part of the JSON.
    #[serde(skip)]
    pub shown: Vec<Shown>,
}

impl Explained {
    /// The joints that the model with what was named predicts no better than their mean does, on the logs to judge on;
    /// those of which no more than noise is left aside.
    #[must_use]
    pub fn useless_joints(&self) -> Vec<JointNumber> {
        let is_open = |joint: &JointNumber| {
            self.verdict.iter().any(|v| v.joint == *joint && v.state != State::Explained)
        };
        self.after.validate.useless_joints().into_iter().filter(is_open).collect()
    }
}

/// The change of a joint's error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The joint.
    pub joint: JointNumber,
    /// rms after over rms before, less 1.
    pub rms: f64,
    /// Its 95 % interval, from blocks that count as independent.
    pub interval: [f64; 2],
}

// Torques over time on the validation set, for people to look at.
