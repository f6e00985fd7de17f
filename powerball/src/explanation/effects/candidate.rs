//! One way in which an effect could show.

use crate::logs::regression::Data;

/// A time span of one log.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// File name of the log.
    pub log: String,
    /// Start in the log's own t, s.
    pub from: f64,
    /// End in the log's own t, s; infinite for "to the end".
    pub to: f64,
    /// Seconds to add to the log's own t for the clock of all logs.
    pub offset: f64,
}

impl Window {
    /// A span of one of the logs of some data.
    #[must_use]
    pub(super) fn new(data: &Data<'_>, log: usize, from: f64, to: f64) -> Window {
        let offset = data.recordings.iter().find(|r| r.log == log).map_or(0.0, |r| r.clock - r.start);
        Window { log: data.logs[log].clone(), from, to, offset }
    }
}

/// An effect on some joints with the settings of its search.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Joints, from 0.
    pub joints: Vec<usize>,
    /// Which of the effect's laws.
    pub form: usize,
    /// The law's settings that are not coefficients.
    pub values: Vec<f64>,
    /// Where it is, if not everywhere.
    pub windows: Vec<Window>,
    /// How many alternatives the search chose this one from: what looking elsewhere costs.
    pub searched: f64,
}

impl Candidate {
    /// On one joint, everywhere.
    #[must_use]
    pub fn on(joint: usize, form: usize, values: Vec<f64>, searched: usize) -> Candidate {
        Candidate { joints: vec![joint], form, values, windows: Vec::new(), searched: searched as f64 }
    }
}

/// A candidate that was accepted, with its coefficients.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// The candidate.
    pub candidate: &'a Candidate,
    /// One for each of its columns.
    pub coefficients: &'a [f64],
}

/// `count` values from `low` to `high` in equal ratios.
#[must_use]
pub(super) fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count).map(|k| low * (high / low).powf(k as f64 / last)).collect()
}

/// One list entry by joint where several joints have it, else the number alone.
pub(super) fn by_joint(found: &[Found<'_>], value: impl Fn(&Found<'_>) -> f64) -> serde_json::Value {
    match found {
        [one] => serde_json::json!(value(one)),
        many => serde_json::json!(many.iter().map(value).collect::<Vec<f64>>()),
    }
}
