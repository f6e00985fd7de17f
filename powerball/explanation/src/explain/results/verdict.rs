//! The first line of every answer: how much of each joint's torque is explained, and what to do about the rest.
//!
//! Also here: whether an explanation contradicts itself.

use super::super::named::NamedEffect;
use super::super::study::Study;
use super::explained::Explained;
use super::unattributed::Dependencies;
use powerball_controller::JointNumber;
use powerball_identification::estimate::ResidualStats;
use serde::Serialize;
use std::fmt;

/// How far a joint's torque is explained on the validation set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The joint.
    pub joint: JointNumber,
    /// How far.
    pub state: State,
    /// rms of what is left over rms of the measured torque; not a number where the joint does not move.
    pub left: f64,
    /// What the rest depends on, the likely kinds, and what to record or check; empty where nothing is left.
    pub advice: String,
}

/// How far a torque is explained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum State {
    /// What is left is little, or noise.
    #[serde(rename = "explained")]
    Explained,
    /// Effects were named, and much is left beside them.
    #[serde(rename = "named in part")]
    InPart,
    /// Much is left, and nothing was named.
    #[serde(rename = "not explained")]
    Not,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            State::Explained => "explained",
            State::InPart => "named in part",
            State::Not => "not explained",
        })
    }
}

/// The verdict on every joint.
pub(crate) fn verdict(
    study: &Study<'_>,
    named: &[NamedEffect],
    after: &ResidualStats,
    floor: &[f64],
    dependencies: &Dependencies,
) -> Vec<Verdict> {
    let explained = explained(study, after, floor, dependencies);
    let of = |j: usize| {
        let joint = JointNumber::from_index(j);
        let (left, rms) = (after.relative[j], after.rms[j]);
        if study.validation.joints[j].is_empty() {
            let advice = "it does not move in the logs to judge on, or its torque says nothing there: record a \
                motion that moves it";
            return Verdict { joint, state: State::Not, left: f64::NAN, advice: advice.to_string() };
        }
        let state = if explained[j] {
            State::Explained
        } else if named.iter().any(|e| e.joints.contains(&joint)) {
            State::InPart
        } else {
            State::Not
        };
        let advice = match state {
            State::Explained => String::new(),
            _ => advice(study, j, left, rms / floor[j], dependencies),
        };
        Verdict { joint, state, left, advice }
    };
    (0..study.validation.dof()).map(of).collect()
}

/// Of which joints little is left, or hardly more than measurement noise; of one that does not move in the logs to judge
/// on nothing is known.
pub(super) fn explained(
    study: &Study<'_>,
    after: &ResidualStats,
    floor: &[f64],
    dependencies: &Dependencies,
) -> Vec<bool> {
    let rule = study.rule();
    let of = |j: usize| {
        let little = match dependencies.of(j) {
            [] => rule.explained_share,
            _ => rule.little_share,
        };
        let is_little = after.relative[j] <= little || after.rms[j] <= rule.above_floor * floor[j];
        is_little && !study.validation.joints[j].is_empty()
    };
    (0..study.validation.dof()).map(of).collect()
}

/// What to think of and to do where much is left.
fn advice(study: &Study<'_>, j: usize, left: f64, over_noise: f64, dependencies: &Dependencies) -> String {
    let mut parts: Vec<String> = Vec::new();
    if left > study.rule().nothing_share {
        parts.push(
            "the model predicts next to nothing of this torque on other paths: check the column's sign, unit \
             and order, that the arm file is this arm's, and that the logs excite it"
                .to_string(),
        );
    }
    match dependencies.of(j) {
        [] if over_noise < 3.0 => parts.push("what is left is little more than noise".to_string()),
        [] => parts.push(
            "what is left depends on no signal of the logs: slow noise of the sensor, something that comes and \
             goes, or a model whose parameters these logs do not hold"
                .to_string(),
        ),
        signals => {
            let names: Vec<&str> = signals.iter().take(3).map(|(name, _)| name.as_str()).collect();
            parts.push(format!("what is left depends on {}: {}", names.join(", "), kind(signals, j)));
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

/// What makes a torque that depends on a signal, most of all.
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

/// In what an explanation contradicts itself, in words; empty where it does not.
///
/// * Probabilities lie between 0 and 1.
/// * No name is given and refused on one joint.
/// * A joint that is explained is not among those where something is left without a name; one that is named in part
///   has a name, one that is not explained has none.
/// * An experiment is of names that are open: of at most one that was given on these joints.
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
        let joint = verdict.joint;
        let left = rest.is_some_and(|rest| rest.joints.contains(&joint));
        let named = explained.effects.iter().any(|effect| effect.joints.contains(&joint));
        let wrong = match verdict.state {
            State::Explained => left,
            State::InPart => !named,
            State::Not => named && !verdict.left.is_nan(),
        };
        if wrong {
            all.push(format!(
                "joint {joint} is {}, and named: {named}, left without a name: {left}",
                verdict.state
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

// How often a name with such evidence is right: a curve that was fitted to arms whose effects are known.

/// What is known of a name besides what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Its penalised gain over that of the next best name.
    pub margin: f64,
    /// Whether another name fits as well.
    pub alike: bool,
    /// Share of the excess over noise that stays on its joints.
    pub leftover: f64,
}

/// Numbers that the logit of the probability is linear in.
pub const FEATURES: usize = 4;

/// What they are weighted with: logistic regression (D. R. Cox, "The regression analysis of binary sequences", 1958) on one
/// half of drawn arms, judged on the other half. `cargo run --release -p xtask -- probability` fits them anew.
const COEFFICIENTS: [f64; FEATURES] = [1.74, 2.36, 1.81, -2.71];

/// A larger margin says no more.
const LARGEST_MARGIN: f64 = 20.0;
/// Some hundred names cannot speak of less than one in a hundred.
const SUREST: f64 = 0.99;

impl Evidence {
    /// What is known of a name that was given.
    pub(super) fn of(effect: &NamedEffect) -> Evidence {
        let alike = effect.rivals.iter().any(|rival| rival.alike);
        Evidence { margin: effect.margin, alike, leftover: effect.leftover }
    }

    /// 1, whether another name fits as well, the logarithm of the margin, and what is left over.
    #[must_use]
    pub fn features(&self) -> [f64; FEATURES] {
        let margin = within(self.margin, [1.0, LARGEST_MARGIN]).ln();
        // By what is gone, since what is no number counts as the lower end.
        let leftover = 1.0 - within(1.0 - self.leftover, [0.0, 1.0]);
        [1.0, f64::from(u8::from(self.alike)), margin, leftover]
    }

    /// How often such a name is right, or where another one fits as well, how often one of them is.
    #[must_use]
    pub fn probability(&self) -> f64 {
        let logit: f64 = COEFFICIENTS.iter().zip(self.features()).map(|(c, x)| c * x).sum();
        (1.0 / (1.0 + (-logit).exp())).min(SUREST)
    }
}

/// What is no number counts as the lower end, which `clamp` would keep.
#[allow(clippy::manual_clamp)]
fn within(x: f64, [low, high]: [f64; 2]) -> f64 {
    x.max(low).min(high)
}

#[cfg(test)]
mod probability_tests {
    use super::*;

    const CLEAR: Evidence = Evidence { margin: 5.0, alike: false, leftover: 0.02 };

    #[test]
    fn less_evidence_makes_no_name_more_probable() {
        let sure = CLEAR.probability();
        assert!(sure > 0.9 && sure <= SUREST, "{sure}");
        for worse in [Evidence { margin: 1.05, ..CLEAR }, Evidence { leftover: 0.6, ..CLEAR }] {
            assert!(worse.probability() < sure, "{worse:?}: {} against {sure}", worse.probability());
        }
    }

    #[test]
    fn what_is_no_number_is_no_evidence() {
        let nothing = Evidence { margin: f64::NAN, leftover: f64::NAN, ..CLEAR };
        let least = Evidence { margin: 1.0, leftover: 1.0, ..CLEAR };
        assert_eq!(nothing.probability(), least.probability());
        let endless = Evidence { margin: f64::INFINITY, ..CLEAR };
        assert!(endless.probability() >= CLEAR.probability());
    }
}
