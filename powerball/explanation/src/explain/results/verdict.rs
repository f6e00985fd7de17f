//! The first line of every answer: how well each joint's torque is predicted, and what to do about the rest.
//!
//! The module also checks that an explanation does not contradict itself.

use super::super::named::NamedEffect;
use super::super::study::Study;
use super::explained::{Change, Explained};
use super::unattributed::Dependencies;
use powerball_controller::JointNumber;
use powerball_identification::estimate::ResidualStats;
use serde::Serialize;
use std::fmt;

/// How well a joint's torque is predicted on the validation set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The joint.
    pub joint: JointNumber,
    /// How well.
    pub state: State,
    /// rms of the residual over rms of the measured torque; NaN if the joint does not move.
    pub left: f64,
    /// The dependencies of the remaining error, its likely causes, and what to record or check; empty if
    /// little remains.
    pub advice: String,
}

/// How well the model with the named effects predicts a torque. The first state that applies is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum State {
    /// The remaining error is hardly more than measurement noise
    /// ([`above_floor`](crate::rule::Rule::above_floor)).
    #[serde(rename = "at the noise floor")]
    AtNoiseFloor,
    /// Little of the torque is left ([`little`](crate::rule::Rule::little)).
    #[serde(rename = "predicted")]
    Predicted,
    /// More error remains, but the named effects lowered it: the 95 % interval of the change lies below zero.
    #[serde(rename = "improved")]
    Improved,
    /// More is left, and no error fell.
    #[serde(rename = "not predicted")]
    NotPredicted,
}

impl State {
    /// Whether no more than little or noise is left.
    #[must_use]
    pub fn is_good(self) -> bool {
        matches!(self, State::AtNoiseFloor | State::Predicted)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            State::AtNoiseFloor => "at the noise floor",
            State::Predicted => "predicted",
            State::Improved => "improved",
            State::NotPredicted => "not predicted",
        })
    }
}

/// The verdict on every joint.
pub(crate) fn verdict(
    study: &Study<'_>,
    changes: &[Change],
    after: &ResidualStats,
    floor: &[f64],
    dependencies: &Dependencies,
) -> Vec<Verdict> {
    let of = |j: usize| {
        let joint = JointNumber::from_index(j);
        if study.validation.joints[j].is_empty() {
            let advice = "it does not move in the validation logs, or its torque carries no information \
                there: record a motion that moves it";
            let state = State::NotPredicted;
            return Verdict { joint, state, left: f64::NAN, advice: advice.to_string() };
        }
        let (left, rms) = (after.relative[j], after.rms[j]);
        let improved = || changes.iter().any(|change| change.joint == joint && change.interval[1] < 0.0);
        let state = if is_at_noise_floor(study, rms, floor[j]) {
            State::AtNoiseFloor
        } else if left <= study.rule().little {
            State::Predicted
        } else if improved() {
            State::Improved
        } else {
            State::NotPredicted
        };
        let advice = match state.is_good() {
            true => String::new(),
            false => advice(study, j, left, rms / floor[j], dependencies),
        };
        Verdict { joint, state, left, advice }
    };
    (0..study.validation.dof()).map(of).collect()
}

fn is_at_noise_floor(study: &Study<'_>, rms: f64, floor: f64) -> bool {
    rms <= study.rule().above_floor * floor
}

/// Whether the remaining error of a joint is so small that it needs no name; it is unknown for a joint that
/// does not move in the validation logs.
pub(super) fn needs_no_name(study: &Study<'_>, after: &ResidualStats, floor: &[f64], j: usize) -> bool {
    let little = after.relative[j] <= study.rule().negligible;
    !study.validation.joints[j].is_empty() && (little || is_at_noise_floor(study, after.rms[j], floor[j]))
}

/// Likely causes and advice for a joint with a large remaining error.
fn advice(study: &Study<'_>, j: usize, left: f64, over_noise: f64, dependencies: &Dependencies) -> String {
    let mut parts: Vec<String> = Vec::new();
    if left > 1.0 - study.rule().little {
        parts.push(
            "the model predicts almost nothing of this torque on other paths: check the sign, unit and \
                order of the column, that the arm file belongs to this arm, and that the logs excite the \
                joint"
                .to_string(),
        );
    }
    match dependencies.of(j) {
        [] if over_noise < 3.0 => parts.push("the remaining error is little more than noise".to_string()),
        [] => parts.push(
            "the remaining error depends on no signal of the logs: slow noise of the sensor, a cause that \
                comes and goes, or a model whose parameters these logs do not determine"
                .to_string(),
        ),
        signals => {
            let names: Vec<&str> = signals.iter().take(3).map(|(name, _)| name.as_str()).collect();
            parts.push(format!("the remaining error depends on {}: {}", names.join(", "), kind(signals, j)));
        }
    }
    let seconds = study.fitted_time();
    if seconds < study.rule().least_time {
        parts.push(format!(
            "the logs to fit hold {seconds:.0} s: record several exciting paths of 20 s (powerball excite)"
        ));
    }
    parts.join("; ")
}

/// The most likely cause of a torque that depends on a signal.
fn kind(signals: &[(String, f64)], j: usize) -> String {
    let Some((name, _)) = signals.first() else { return String::new() };
    let split = name.find(|c: char| c.is_ascii_digit()).unwrap_or(name.len());
    let (what, number) = name.split_at(split);
    let own = number.parse() == Ok(j + 1);
    match (what, own) {
        ("q", true) => "a spring, a cable, a ripple of the gear, or an encoder's zero".to_string(),
        ("q", false) => {
            format!("a hose or a linkage with joint {number}, or the load of the links behind it")
        }
        ("dq", true) => "friction of another law than tanh steps and a viscous part".to_string(),
        ("dq", false) => format!("a drive, a cable or a bearing that joint {number} moves too"),
        ("ddq", true) => "a rotor's inertia, a delay, or a gear that gives way".to_string(),
        ("ddq", false) => {
            format!("a rotor that joint {number} turns too, or an inertia that is not in the model")
        }
        ("tau", _) => "friction that grows with load, or a torque constant".to_string(),
        _ => "warming, a load that was taken up, or an outside force: it changes with time".to_string(),
    }
}

// Whether an explanation contradicts itself: tests ask it of measured logs, and the study of every case.

/// The contradictions of an explanation, in words; empty if there are none.
///
/// * Probabilities lie between 0 and 1.
/// * No name is given and refused on one joint.
/// * A joint at the noise floor is not among those where something is left without a name; the error of one
///   that is improved falls, that of one that is not predicted does not.
/// * An experiment is of names that are open: of at most one that was given on these joints. Each stands in
///   the answer, given, as a rival or as one that was considered.
/// * No interval of a change lies on the wrong side of it.
#[must_use]
pub fn contradictions(explained: &Explained) -> Vec<String> {
    let mut all = Vec::new();
    for effect in &explained.effects {
        let name = &effect.effect;
        let numbers =
            [("p", effect.p_value), ("probability", effect.probability), ("own share", effect.own_share)];
        for (what, value) in numbers.into_iter().filter(|(_, value)| !(0.0..=1.0).contains(value)) {
            all.push(format!("{what} of {name} is {value}"));
        }
        let rivals = effect.rivals.iter().filter(|rival| is_named(explained, &rival.effect, &effect.joints));
        all.extend(rivals.map(|rival| format!("{} is named and a rival of {name}", rival.effect)));
    }
    let laws = explained.laws.iter().filter(|law| !(0.0..=1.0).contains(&law.probability));
    all.extend(laws.map(|law| format!("the probability of {} is {}", law.formula, law.probability)));
    let rest = explained.unattributed.as_ref();
    for verdict in &explained.verdict {
        let (joint, state) = (verdict.joint, verdict.state);
        let left = rest.is_some_and(|rest| rest.joints.contains(&joint));
        let falls = explained.held_out_change.iter().any(|c| c.joint == joint && c.interval[1] < 0.0);
        let wrong = match state {
            State::AtNoiseFloor => left,
            State::Predicted => false,
            State::Improved => !falls,
            State::NotPredicted => falls,
        };
        if wrong {
            all.push(format!(
                "joint {joint} is {state}; its error falls: {falls}; left without a name: {left}"
            ));
        }
    }
    for rival in rest.iter().flat_map(|rest| &rest.considered) {
        if is_named(explained, &rival.effect, &rival.joints) {
            all.push(format!("{} is named and refused on joint {:?}", rival.effect, rival.joints));
        }
    }
    if let (Some(next), Some(open)) = (&explained.next_experiment, &explained.open) {
        let given = open.hypotheses.iter().filter(|h| is_named(explained, h.name, &h.joints)).count();
        if given > 1 {
            all.push(format!("an experiment of {:?}, which are given", next.to_tell_apart));
        }
    }
    for name in explained.next_experiment.iter().flat_map(|next| &next.to_tell_apart) {
        let rivals = explained.effects.iter().flat_map(|effect| &effect.rivals);
        let others = rivals.chain(rest.iter().flat_map(|rest| &rest.considered));
        let given = explained.effects.iter().any(|effect| effect.effect == *name);
        if !given && !others.into_iter().any(|other| other.effect == *name) {
            all.push(format!("an experiment of {name}, which stands nowhere in the answer"));
        }
    }
    for change in &explained.held_out_change {
        let [low, high] = change.interval;
        if !(low <= change.rms && change.rms <= high) {
            all.push(format!(
                "joint {} changes by {}, which {low} to {high} does not hold",
                change.joint, change.rms
            ));
        }
    }
    all
}

fn is_named(explained: &Explained, name: &str, joints: &[JointNumber]) -> bool {
    explained.effects.iter().any(|effect| effect.is(name, joints))
}

// How often a name with such evidence is right: a curve that was fitted to logs whose effects are known.

/// The evidence for a name: features that predict how often such a name is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// The name's penalised gain over that of the next best name.
    pub margin: f64,
    /// Whether another name fits as well.
    pub alike: bool,
    /// Share of the excess over noise that stays on its joints.
    pub leftover: f64,
    /// Time of motion in the fitted logs over [`least_time`](crate::rule::Rule::least_time).
    pub time: f64,
}

/// Numbers that the logit of the probability is linear in.
pub const FEATURES: usize = 5;

/// Weights of the features: logistic regression (D. R. Cox, "The regression analysis of binary sequences",
/// 1958) on effects of simulated arms and on effects put into measured logs.
/// `cargo run --release -p xtask -- probability` fits them again, and judges them by set.
const COEFFICIENTS: [f64; FEATURES] = [1.91, 4.04, 1.83, -3.29, 3.26];

/// A larger margin says no more, nor does a margin or a time below its inverse. Below a margin of 1 another
/// name fits better: a class with a small margin is right far less often than one with a margin of 1.
const LARGEST_MARGIN: f64 = 20.0;
/// Some hundred names cannot speak of less than one in a hundred.
const SUREST: f64 = 0.99;

impl Evidence {
    /// The evidence for a name that was given by logs with this time of motion over the least one.
    pub(super) fn of(effect: &NamedEffect, time: f64) -> Evidence {
        let alike = effect.rivals.iter().any(|rival| rival.alike);
        Evidence { margin: effect.margin, alike, leftover: effect.leftover, time }
    }

    /// 1, whether another name fits as well, the logarithm of the margin, the remaining share, and the
    /// logarithm of the time if it is less than the least.
    #[must_use]
    pub fn features(&self) -> [f64; FEATURES] {
        let margin = within(self.margin, [1.0 / LARGEST_MARGIN, LARGEST_MARGIN]).ln();
        // By what is gone, since what is not a number counts as the lower end.
        let leftover = 1.0 - within(1.0 - self.leftover, [0.0, 1.0]);
        let time = within(self.time, [1.0 / LARGEST_MARGIN, 1.0]).ln();
        [1.0, f64::from(u8::from(self.alike)), margin, leftover, time]
    }

    /// Probability that such a name is right, or that one of them is, if another one fits as well.
    #[must_use]
    pub fn probability(&self) -> f64 {
        let logit: f64 = COEFFICIENTS.iter().zip(self.features()).map(|(c, x)| c * x).sum();
        (1.0 / (1.0 + (-logit).exp())).min(SUREST)
    }
}

/// NaN counts as the lower end; `clamp` would keep it.
#[allow(clippy::manual_clamp)]
fn within(x: f64, [low, high]: [f64; 2]) -> f64 {
    x.max(low).min(high)
}

#[cfg(test)]
mod probability_tests {
    use super::*;

    const CLEAR: Evidence = Evidence { margin: 5.0, alike: false, leftover: 0.02, time: 2.0 };

    #[test]
    fn less_evidence_makes_no_name_more_probable() {
        let sure = CLEAR.probability();
        assert!(sure > 0.9 && sure <= SUREST, "{sure}");
        let short = Evidence { time: 0.3, ..CLEAR };
        for worse in [Evidence { margin: 1.05, ..CLEAR }, Evidence { leftover: 0.6, ..CLEAR }, short] {
            assert!(worse.probability() < sure, "{worse:?}: {} against {sure}", worse.probability());
        }
        let class = Evidence { margin: 1.0, alike: true, ..CLEAR };
        let second = Evidence { margin: 0.2, ..class };
        assert!(second.probability() < class.probability(), "a name that others fit far better");
    }

    #[test]
    fn what_is_no_number_is_no_evidence() {
        let nothing = Evidence { margin: f64::NAN, leftover: f64::NAN, time: f64::NAN, ..CLEAR };
        let least = Evidence { margin: 0.0, leftover: 1.0, time: 0.0, ..CLEAR };
        assert_eq!(nothing.probability(), least.probability());
        let endless = Evidence { margin: f64::INFINITY, ..CLEAR };
        assert!(endless.probability() >= CLEAR.probability());
    }
}
