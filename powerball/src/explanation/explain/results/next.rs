//! What is said of an experiment that tells names apart.

use crate::controller::JointNumber;
use serde::Serialize;

/// What to record to tell names apart that logs leave open.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextExperiment {
    /// What to do, in words.
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
        /// Always `None`: null in explained.json, beside the reason.
        trajectory: Option<&'static str>,
        /// Why.
        no_trajectory: String,
    },
    /// One was designed.
    Designed {
        /// The joints that the names are of.
        joints: Vec<JointNumber>,
        /// Its file's name.
        trajectory: &'static str,
        /// rms of the difference that would stay, over the residual's own rms, by joint.
        expected_difference: Vec<f64>,
        /// χ² by which the wrong name would fall behind.
        expected_evidence: f64,
        /// The same of the middle one of random paths.
        of_a_usual_path: f64,
        /// How long it takes, s.
        duration: f64,
    },
}

/// What an experiment that was made for open names has decided.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Experiment {
    /// The names that were open.
    pub to_tell_apart: Vec<&'static str>,
    /// Its log.
    pub log: String,
    /// The name that is right; `None` where the logs cannot say.
    pub decided: Option<&'static str>,
    /// Why, in words.
    pub why: String,
    /// χ² by which the better name leads on the fitted logs.
    pub evidence: f64,
    /// Probability of such a lead by chance.
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
