//! What an explanation says, in the form of explained.json.

use super::correction::Correction;
use super::curves::TorqueCurve;
use super::open::Open;
use super::shown::Shown;
use crate::explanation::torque_model::TorqueModel;
use crate::identification::estimate::Spread;
use serde::Serialize;
use serde_json::Value;
use std::sync::Arc;

/// The result of the residual loop.
#[derive(Clone, Debug, Serialize)]
pub struct Explained {
    /// The arm's name.
    pub arm: String,
    /// Errors of the base model.
    pub before: Errors,
    /// Errors with all accepted effects.
    pub after: Errors,
    /// How the error of each joint that moves changes on the other path.
    pub held_out_change: Vec<Change>,
    /// What white measurement noise alone would leave in the band, by joint, N·m.
    pub noise_floor: Vec<f64>,
    /// Accepted effects in the order in which they were added.
    pub effects: Vec<NamedEffect>,
    /// Band of all errors here, Hz.
    pub band: [f64; 2],
    /// Samples that the residuals are worth, all joints together.
    pub effective_samples: usize,
    /// What no candidate explains.
    pub unattributed: Option<Unattributed>,
    /// What to record to tell the names apart that these logs leave open.
    pub next_experiment: Option<Value>,
    /// What an experiment that was made for open names has decided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experiment: Option<Value>,
    /// The open names, fitted; not part of the JSON.
    #[serde(skip)]
    pub open: Option<Arc<Open>>,
    /// How often the rule accepts effects that are not there, on these data.
    pub false_positives: FalsePositives,
    /// What was found in logs and arm file, and what was done about it.
    pub warnings: Vec<String>,
    /// Torques over time on the other path, by joint; not part of the JSON.
    #[serde(skip)]
    pub curves: Vec<TorqueCurve>,
    /// The model with everything that was named: model.json. Its errors are `after`; not where joints were
    /// taken apart, as it has one body for all.
    #[serde(skip)]
    pub model: TorqueModel,
    /// The plots that show the effects; not part of the JSON.
    #[serde(skip)]
    pub shown: Vec<Shown>,
}

/// Errors on the fitted logs and on the other path.
#[derive(Clone, Debug, Serialize)]
pub struct Errors {
    /// On the logs that were fitted.
    pub fit: Spread,
    /// On the other path.
    pub validate: Spread,
}

/// The change of a joint's error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Joint, from 1.
    pub joint: usize,
    /// rms after over rms before, less 1.
    pub rms: f64,
    /// Its 95 % interval, from blocks that count as independent.
    pub interval: [f64; 2],
}

/// An effect with its evidence.
#[derive(Clone, Debug, Serialize)]
pub struct NamedEffect {
    /// Its name.
    pub effect: String,
    /// Its joints, from 1.
    pub joints: Vec<usize>,
    /// Its physical reading, SI units.
    pub parameters: Value,
    /// Held-out error of its joints before it was added, N·m.
    pub rms_before: Vec<f64>,
    /// … and after.
    pub rms_after: Vec<f64>,
    /// Probability of as much by chance, over all joints and candidates tried: the worst of its joints.
    pub p_value: f64,
    /// Share by which held-out squared errors fall: the median over folds, by joint.
    pub held_out_gain: Vec<f64>,
    /// Logs it is in, where it is in some only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub logs: Vec<String>,
    /// Its penalised gain over that of the next best name on the same joints.
    pub margin: f64,
    /// Share of the residual's excess over the noise floor that stays on its joints after all effects.
    pub leftover: f64,
    /// What it is of: see `rivals` where another name fits as well.
    pub class: String,
    /// Names that were considered for the same residual.
    pub rivals: Vec<Rival>,
}

/// A name that was considered and not given.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rival {
    /// The name.
    pub effect: String,
    /// Why it was not given.
    pub why_not: String,
}

/// What stays without a name.
#[derive(Clone, Debug, Serialize)]
pub struct Unattributed {
    /// Joints, from 1.
    pub joints: Vec<usize>,
    /// Signals that the residual depends on, the strongest first.
    pub depends_on: Vec<String>,
    /// rms of the residual of those joints on the fitted logs, N·m.
    pub rms: Vec<f64>,
    /// Effects that fit a part of it but not well enough to be named.
    pub considered: Vec<Rival>,
    /// Curves that take a part of it off, where they were asked for: those of the joints whose held-out
    /// errors fall by them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction: Option<Vec<Correction>>,
}

/// The rule applied to candidates that cannot be true: shifted in time within each recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FalsePositives {
    /// Placebos tried.
    pub placebos: usize,
    /// Placebos that the whole rule accepted.
    pub accepted: usize,
    /// Their share.
    pub rate: f64,
    /// Family-wise level of the significance test.
    pub family_wise: f64,
}

impl FalsePositives {
    /// The share of placebos that were accepted.
    #[must_use]
    pub(super) fn share(&self) -> f64 {
        self.accepted as f64 / self.placebos.max(1) as f64
    }
}
