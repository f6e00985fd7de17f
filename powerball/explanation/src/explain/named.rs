//! The report on one effect.

use crate::effects::Figures;
use crate::effects::words::Words;
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_identification::estimate::ResidualStats;
use serde::Serialize;

/// Errors on the fitted logs and on the validation set.
#[derive(Clone, Debug, Serialize)]
pub struct FitErrors {
    /// On the logs that were fitted.
    pub fit: ResidualStats,
    /// On the validation set.
    pub validate: ResidualStats,
}

/// An effect with its evidence.
#[derive(Clone, Debug, Serialize)]
pub struct NamedEffect {
    /// The effect's name.
    pub effect: String,
    /// The joints it acts on.
    pub joints: Vec<JointNumber>,
    /// The physical values, SI units.
    #[serde(rename = "parameters")]
    pub figures: Figures,
    /// The standard error of its size on each joint, a share of it; null where it is not of the fit.
    pub relative_std: Vec<Option<f64>>,
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
    /// In how many searches on fewer logs it was found again, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub again: Option<Again>,
    /// Whether no more than half of these searches gave it ([`most`](crate::rule::Rule::most)): it is seen in
    /// some logs, and is not certain.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub in_some_logs: bool,
    /// How often a name with such evidence is right ([`Evidence`](super::Evidence), docs/study.md).
    pub probability: f64,
    /// The name's penalised gain over that of the next best name on the same joints.
    pub margin: f64,
    /// Share of the residual's excess over the noise floor that stays on its joints after all effects.
    pub leftover: f64,
    /// The least share of its squared torque, over its joints, that no other column of the fit can take over.
    pub own_share: f64,
    /// Class of the effect; see `rivals` if another name fits as well.
    pub class: String,
    /// Names that were considered for the same residual.
    pub rivals: Vec<Rival>,
}

/// In how many searches on fewer logs a name was found again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Again {
    /// Searches that give the name on one of its joints.
    pub found: usize,
    /// Searches in all.
    pub of: usize,
}

impl Again {
    /// Whether a name is in some logs only: no more than half of the searches give it.
    #[must_use]
    pub(super) fn is_in_some(self, rule: &Rule) -> bool {
        self.found as f64 <= rule.most * self.of as f64
    }
}

impl NamedEffect {
    /// Whether it is the effect of some name, on one of some joints.
    #[must_use]
    pub fn is(&self, name: &str, joints: &[JointNumber]) -> bool {
        self.effect == name && self.joints.iter().any(|joint| joints.contains(joint))
    }

    /// The effect's size in words; `sliding`: for each joint of the arm, whether it slides, so that its
    /// torques are forces.
    #[must_use]
    pub fn size(&self, sliding: &[bool]) -> String {
        let first = self.joints.first().and_then(|joint| sliding.get(joint.index()));
        let slides = first.copied().unwrap_or(false);
        self.figures.in_words(&Words { slides, relative_std: &self.relative_std })
    }
}

/// A name that was considered and not given.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rival {
    /// The name.
    pub effect: String,
    /// The joints on which it was considered.
    pub joints: Vec<JointNumber>,
    /// Whether it fits as well, so that these logs do not tell.
    pub alike: bool,
    /// Why it was not given.
    pub why_not: String,
}

/// Why a name is not given that a step gave and a later one took back.
pub(super) const TAKEN_BACK: &str = "did not last, or could not be distinguished from its rivals";

/// The rule applied to surrogates: candidates that cannot be true, shifted in time within each recording or,
/// where that changes nothing (a constant torque), with the signs of the recordings drawn.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FalsePositives {
    /// Surrogates tried.
    #[serde(rename = "placebos")]
    pub surrogates: usize,
    /// Surrogates that the whole rule accepted.
    pub accepted: usize,
    /// Share of those tried that were accepted.
    pub rate: f64,
    /// Family-wise level of the significance test.
    pub family_wise: f64,
    /// Draws that had no surrogate: a constant torque in a single recording, say.
    pub without: usize,
}
