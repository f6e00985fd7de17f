//! What was named against what was there.

use super::alike::Settled;
use super::case::Case;
use powerball::explanation::Explained;
use powerball::explanation::explain::contradictions;
use serde::{Deserialize, Serialize};

/// A name that was given.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Named {
    pub(super) effect: String,
    pub(super) joints: Vec<usize>,
    /// Names that fit as well, so that the answer is their class.
    pub(super) alike: Vec<String>,
    pub(super) margin: f64,
    pub(super) leftover: f64,
    /// See [`NamedEffect::own_share`](powerball::explanation::explain::NamedEffect::own_share).
    #[serde(default)]
    pub(super) own_share: Option<f64>,
    /// The stated probability.
    #[serde(default)]
    pub(super) probability: Option<f64>,
}

impl Named {
    /// What is there in addition to the truths, on these joints, from 1.
    pub(super) fn additional(effect: &str, joints: Vec<usize>) -> Named {
        let (effect, alike) = (effect.into(), Vec::new());
        Named {
            effect,
            joints,
            alike,
            margin: f64::NAN,
            leftover: f64::NAN,
            own_share: None,
            probability: None,
        }
    }
}

/// What a rival says where it fits as well.
pub(super) const AS_WELL: &str = "fits as well";

/// One case and what came of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) case: String,
    pub(super) table: String,
    pub(super) truth: Vec<String>,
    /// The joints on which the truth is, from 1; empty if any joint counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) truth_joints: Vec<usize>,
    /// In words.
    pub(super) law: Vec<String>,
    /// Visible sizes.
    pub(super) sizes: Vec<f64>,
    pub(super) named: Vec<Named>,
    pub(super) unattributed: bool,
    /// Joints on which something is left without a name.
    #[serde(default)]
    pub(super) left_on: Vec<usize>,
    /// Time of motion in the logs to fit, s.
    #[serde(default)]
    pub(super) fitted_time: f64,
    /// Held-out error after the additions over that of the model without the effect, worst joint.
    pub(super) over_clean: f64,
    /// In what the explanation contradicts itself.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) contradictions: Vec<String>,
    pub(super) seconds: f64,
    /// What an experiment did, in the table of names that are alike.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) refined: Option<Settled>,
}

impl Outcome {
    pub(super) fn new(
        case: &Case,
        law: Vec<String>,
        sizes: Vec<f64>,
        explained: &Explained,
        known: &[Named],
        over_clean: f64,
        seconds: f64,
    ) -> Outcome {
        let new = |n: &Named| {
            let is = |k: &Named| k.effect == n.effect || n.alike.contains(&k.effect);
            !known.iter().any(|k| is(k) && n.joints.iter().all(|j| k.joints.contains(j)))
        };
        Outcome {
            case: case.name(),
            table: case.table.name(),
            truth: case.kinds.clone(),
            truth_joints: Vec::new(),
            law,
            sizes,
            named: named(explained).into_iter().filter(new).collect(),
            unattributed: explained.unattributed.is_some(),
            left_on: (explained.unattributed.iter())
                .flat_map(|rest| rest.joints.iter().map(|j| j.number()))
                .collect(),
            fitted_time: explained.fitted_time,
            over_clean,
            contradictions: contradictions(explained),
            seconds,
            refined: None,
        }
    }

    /// Whether the first name is what is there, or its class is reported.
    pub(super) fn first_right(&self) -> bool {
        self.named.first().is_some_and(|n| self.names_truth(n))
    }

    /// Whether everything that is there was named.
    pub(super) fn all_right(&self) -> bool {
        let named = || self.named.iter().filter(|n| self.names_truth(n));
        self.truth.iter().all(|t| named().any(|n| n.effect == *t || n.alike.contains(t)))
    }

    /// Names given to what is not there.
    pub(super) fn false_names(&self) -> usize {
        self.named.iter().filter(|n| !self.names_truth(n)).count()
    }

    /// Whether a name is of something that is there, or of its class, on its joint where that is known.
    pub(super) fn names_truth(&self, named: &Named) -> bool {
        let there =
            self.truth_joints.is_empty() || self.truth_joints.iter().any(|j| named.joints.contains(j));
        there && self.truth.iter().any(|t| named.effect == *t || named.alike.contains(t))
    }

    /// For the eye.
    pub(super) fn line(&self) -> String {
        let named: Vec<String> = (self.named.iter())
            .map(|n| {
                let alike =
                    if n.alike.is_empty() { String::new() } else { format!(" or {}", n.alike.join(", ")) };
                format!("{}{:?}{alike} m{:.1} l{:.2}", n.effect, n.joints, n.margin, n.leftover)
            })
            .collect();
        let sizes: Vec<String> = self.sizes.iter().map(|s| format!("{s:.2}")).collect();
        let verdict = match (self.truth.is_empty(), self.all_right(), self.false_names()) {
            (_, true, 0) => "ok ",
            (false, true, _) => "ok+",
            (false, false, 0) => "-- ",
            _ => "BAD",
        };
        format!(
            "{verdict} {} size {} over clean {:.2}, {:.1} s: [{}]{} | {}",
            self.case,
            sizes.join(" "),
            self.over_clean,
            self.seconds,
            named.join("; "),
            if self.unattributed { " unattributed" } else { "" },
            self.law.join("; "),
        )
    }
}

/// The names that an explanation gives.
pub(super) fn named(explained: &Explained) -> Vec<Named> {
    (explained.effects.iter())
        .map(|e| Named {
            effect: e.effect.clone(),
            joints: e.joints.iter().map(|j| j.number()).collect(),
            alike: e.rivals.iter().filter(|r| r.alike).map(|r| r.effect.clone()).collect(),
            margin: e.margin,
            leftover: e.leftover,
            own_share: Some(e.own_share),
            probability: Some(e.probability),
        })
        .collect()
}
