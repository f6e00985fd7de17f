//! A candidate: one way in which an effect could appear in logs.
//!
//! The module also has the signal that an effect depends on ([`Axis`]), and figures of several joints.

use super::{Effect, Settings};
use powerball_controller::JointNumber;
use powerball_logs::regression::Data;
use serde::{Serialize, Serializer};

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

    /// The ends of some windows, `None` for one that lasts to its log's end; empty if all do.
    #[must_use]
    pub fn ends(windows: &[Window]) -> Vec<Option<f64>> {
        let end = |w: &Window| w.to.is_finite().then_some(w.to);
        let ends: Vec<Option<f64>> = windows.iter().map(end).collect();
        if ends.iter().all(Option::is_none) { Vec::new() } else { ends }
    }

    /// Whether another window of the same log overlaps it in time.
    #[must_use]
    pub fn overlaps(&self, other: &Window) -> bool {
        self.log == other.log && self.from < other.to && other.from < self.to
    }
}

/// An effect on some joints with the settings of its search.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The joints it acts on, at least one.
    pub joints: Vec<JointNumber>,
    /// The settings of its law, which also say which effect it is.
    pub settings: Settings,
    /// The windows in which it acts; empty if it acts everywhere.
    pub windows: Vec<Window>,
    /// How many alternatives the search chose this one from: what looking elsewhere costs.
    pub searched: f64,
}

impl Candidate {
    /// On one joint, everywhere.
    #[must_use]
    pub fn on(joint: JointNumber, settings: impl Into<Settings>, searched: usize) -> Candidate {
        Candidate::on_all(vec![joint], settings, searched)
    }

    /// On several joints, everywhere.
    #[must_use]
    pub fn on_all(joints: Vec<JointNumber>, settings: impl Into<Settings>, searched: usize) -> Candidate {
        Candidate { joints, settings: settings.into(), windows: Vec::new(), searched: searched as f64 }
    }

    /// This candidate with other settings.
    #[must_use]
    pub fn with(&self, settings: impl Into<Settings>) -> Candidate {
        Candidate { settings: settings.into(), ..self.clone() }
    }

    /// The effect that it is of.
    #[must_use]
    pub fn effect(&self) -> &'static dyn Effect {
        self.settings.effect()
    }

    /// Whether it acts on one of some joints.
    #[must_use]
    pub fn is_on(&self, joints: &[JointNumber]) -> bool {
        self.joints.iter().any(|j| joints.contains(j))
    }

    /// Whether it and another candidate describe the same cause (see [`Effect::excludes`]).
    #[must_use]
    pub fn excludes(&self, other: &Candidate) -> bool {
        self.effect() == other.effect() && self.effect().excludes(self, other)
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

/// A setting near another one: `share` of the way from `setting` to `factor` times `setting`.
#[must_use]
pub(super) fn scaled(setting: f64, factor: f64, share: f64) -> f64 {
    setting + share * (setting * factor - setting)
}

// The signal that an effect depends on: the horizontal axis of the plot that shows it.

/// The signal against which a residual is plotted to show an effect on a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// A joint's position.
    Position(JointNumber),
    /// The place within a cycle of the joint's own position, with this many cycles a turn.
    Cycle(f64),
    /// A joint's velocity.
    Velocity(JointNumber),
    /// The torque that the rigid arm requires at the joint.
    Torque,
    /// The size of that torque, where the residual is taken against the direction of motion.
    Load,
    /// How far the joint has come since it turned back, up to several times this way, rad or m; the residual
    /// is taken against the direction of motion.
    Travel(f64),
    /// The rate of the rigid arm's torque.
    TorqueRate,
    /// Running time; the residual is taken against the direction of motion.
    Warmth,
    /// Time.
    Time,
    /// The torque of the effect itself: for effects that depend on many signals at once.
    Law,
}

// A figure of several joints.

/// A figure for each joint that an effect is on, in the order of the joints found; as JSON the number alone
/// where it is on one.
#[derive(Clone, Debug, PartialEq)]
pub struct ByJoint(pub Vec<f64>);

impl ByJoint {
    /// A figure of everything that was found.
    pub(super) fn of(found: &[Found<'_>], figure: impl Fn(&Found<'_>) -> f64) -> ByJoint {
        ByJoint(found.iter().map(figure).collect())
    }

    /// The figure of the only joint; `None` where there are several.
    #[must_use]
    pub fn single(&self) -> Option<f64> {
        match self.0.as_slice() {
            [one] => Some(*one),
            _ => None,
        }
    }
}

impl Serialize for ByJoint {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.single() {
            Some(one) => one.serialize(to),
            None => self.0.serialize(to),
        }
    }
}
