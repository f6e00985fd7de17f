//! What a model of servos may lack on all logs: each candidate is fitted with everything else, and must lower
//! the error of simulated positions on the validation logs.

use super::result::{ServoEffect, ServoRival};
use crate::rule::Rule;
use powerball_controller::JointNumber;
use powerball_identification::evidence::p_of_sum;
use powerball_identification::servo::constants::Constant;
use powerball_identification::servo::fit::{Free, errors, fit, objective};
use powerball_identification::servo::{Joint, Problem, Role, ServoArm};
use powerball_logs::log::ServoLog;
use serde_json::{Value, json};

/// Steps of the fit with a candidate.
const STEPS: usize = 40;
/// Starts that are refined next to the best one, and the steps of each.
const REFINED: usize = 2;
const FIRST_STEPS: usize = 10;

/// What fades faster is how a log begins, not warmth, s: as for logs with torques.
const FADES: f64 = 15.0;

/// Something that a joint may have.
pub(super) struct Candidate {
    pub name: &'static str,
    /// What is fitted in addition, with the least value and where the search may begin; the scale is the
    /// first start.
    pub free: Vec<(Constant, f64, &'static [f64])>,
    /// What is set and not fitted.
    pub set: Vec<(Constant, f64)>,
}

/// Everything that these logs can show of a joint: what follows a signal needs it in the logs to fit and in
/// those that judge.
pub(super) fn all(joint: &Joint<'_>, arm: &ServoArm, held_out: &[ServoLog], rule: &Rule) -> Vec<Candidate> {
    let of = |name, free| Candidate { name, free, set: Vec::new() };
    let problem = &joint.problem;
    let judges = problem.in_logs(&arm.body, held_out, problem.joint);
    let mut all = vec![
        of("load_friction", vec![(Constant::Load, 0.0, &[0.1][..])]),
        of(
            "stribeck",
            vec![
                // A share of the torque at full duty.
                (Constant::Stribeck, 0.0, &[0.02]),
                (Constant::StribeckVelocity, 5e-3, &[0.1]),
            ],
        ),
    ];
    let tracks = problem.tracks();
    let has_volts = judges.tracks().iter().all(|track| track.volts.is_some());
    let volts = tracks.iter().map(|track| track.volts.filter(|_| has_volts)).collect::<Option<Vec<_>>>();
    let known = arm.known(problem.joint).servo.supply;
    if let Some(supply) = volts.and_then(|volts| known.or_else(|| mean(&volts.concat()))) {
        let set = vec![(Constant::Supply, supply)];
        all.push(Candidate { name: "torque_constant", free: Vec::new(), set });
    }
    const CHANGES: &[f64] = &[-0.2, 0.2, -0.5];
    let ends = tracks.iter().filter_map(|track| Some(track.t.last()? - track.t.first()?));
    let seconds: f64 = ends.sum();
    match tracks.first().and_then(|track| track.temperature?.first()) {
        Some(cold) if tracks.iter().chain(judges.tracks()).all(|of| of.temperature.is_some()) => {
            all.push(Candidate {
                name: "temperature",
                free: vec![(Constant::Warmth, -1.0, CHANGES)],
                set: vec![(Constant::Cold, *cold)],
            })
        }
        // Whatever drifts in a few seconds looks like warmth.
        _ if seconds < rule.least_time => {}
        _ => all.push(of(
            "temperature",
            vec![
                (Constant::Warmth, -1.0, CHANGES),
                (Constant::WarmthTime, FADES, &[2.0 * FADES, 8.0 * FADES, 30.0 * FADES]),
            ],
        )),
    }
    all
}

/// The mean of what is a number.
fn mean(signal: &[f64]) -> Option<f64> {
    let numbers: Vec<f64> = signal.iter().copied().filter(|x| x.is_finite()).collect();
    (!numbers.is_empty()).then(|| numbers.iter().sum::<f64>() / numbers.len() as f64)
}

impl Candidate {
    /// Whether a constant of it ends at its bound: something else is there, and this only resembles it.
    fn ends_at_bound(&self, fitted: &Joint<'_>) -> bool {
        let own = |role: &Role| self.free.iter().any(|(constant, ..)| *role == Role::Constant(*constant));
        let mut values = fitted.problem.roles.iter().zip(&fitted.fitted.values).zip(&fitted.free);
        values.any(|((role, value), free)| own(role) && *value <= free.least)
    }

    /// The joint with it, from where it is.
    fn fitted<'l>(&self, joint: &Joint<'l>) -> Joint<'l> {
        let full = joint.problem.constants.of(Constant::Torque);
        let unit = |constant| if constant == Constant::Stribeck { full } else { 1.0 };
        let mut roles = joint.problem.roles.clone();
        roles.extend(self.free.iter().map(|(constant, ..)| Role::Constant(*constant)));
        let mut problem = joint.problem.asking(roles);
        self.set.iter().for_each(|(constant, value)| problem.constants.set(*constant, *value));
        let mut starts = vec![joint.fitted.values.clone()];
        let mut free = joint.free.clone();
        for (constant, least, first) in &self.free {
            let unit = unit(*constant);
            let grid = first.iter().flat_map(|x| starts.iter().map(move |own| (own, unit * x)));
            starts = grid.map(|(own, x)| [own.as_slice(), &[x]].concat()).collect();
            free.push(Free { scale: (unit * first[0]).abs(), least: unit * least });
        }
        let error = |start: &Vec<f64>| objective(&errors(&problem, start));
        let mut starts: Vec<(f64, Vec<f64>)> =
            starts.into_iter().map(|start| (error(&start), start)).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let first = |(_, start): &(f64, Vec<f64>)| fit(&problem, start, &free, FIRST_STEPS);
        let refined = starts[1..].iter().take(REFINED).chain(&starts[..1]).map(first);
        // There always is a start.
        let best = refined.min_by(|a, b| a.objective.total_cmp(&b.objective));
        let start = best.map(|best| best.values).unwrap_or_default();
        let fitted = fit(&problem, &start, &free, STEPS);
        let (constants, inertial, _) = problem.at(&fitted.values);
        (problem.constants, problem.inertial) = (constants, inertial);
        let std = vec![None; free.len()];
        Joint { problem, fitted, free, std }
    }

    /// What it is in a result.
    fn parameters(&self, joint: &Joint<'_>) -> serde_json::Map<String, Value> {
        let of = |constant| joint.problem.constants.of(constant);
        let all = match self.name {
            "load_friction" => json!({"coefficient": of(Constant::Load)}),
            "temperature" => {
                json!({"change": of(Constant::Warmth), "time_constant": of(Constant::WarmthTime)})
            }
            // Where the torque at full duty is as it was fitted.
            "torque_constant" => json!({"law": "supply", "supply": of(Constant::Supply)}),
            _ => {
                let free = self.free.iter().map(|(own, ..)| (own.name().to_string(), json!(of(*own))));
                Value::Object(free.collect())
            }
        };
        all.as_object().cloned().unwrap_or_default()
    }
}

/// Adds to a joint what it lacks, the candidate that lowers the held-out error most first, while one does by
/// the rule.
pub(super) fn name(
    joint: &mut Joint<'_>,
    effects: &mut Vec<ServoEffect>,
    mut left: Vec<Candidate>,
    (arm, held_out): (&ServoArm, &[ServoLog]),
    rule: &Rule,
) {
    let level = rule.family_wise / (left.len() * arm.body.dof()) as f64;
    while let Some((next, k, effect)) = best(joint, &left, (arm, held_out), (rule, level)) {
        *joint = next;
        effects.push(effect);
        left.remove(k);
    }
}

/// Sums of squared errors of blocks that count as independent, rad².
fn block_squares(problem: &Problem<'_>) -> Vec<f64> {
    let blocks = errors(problem, &[]);
    let blocks = blocks.iter().flat_map(|own| own.chunks(problem.block().max(1)));
    blocks.map(|block| block.iter().map(|r| r * r).sum()).collect()
}

/// The probability that blocks improve so much by chance: one side.
fn by_chance(before: &[f64], after: &[f64]) -> f64 {
    let gains: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
    let gain = gains.iter().sum::<f64>();
    if gain > 0.0 { 0.5 * p_of_sum(&gains, 0.0) } else { 1.0 }
}

/// The candidate that lowers the held-out error most, where one does by the rule, with its number.
fn best<'l>(
    joint: &Joint<'l>,
    candidates: &[Candidate],
    (arm, held_out): (&ServoArm, &[ServoLog]),
    (rule, level): (&Rule, f64),
) -> Option<(Joint<'l>, usize, ServoEffect)> {
    let j = joint.problem.joint;
    let judged = |joint: &Joint<'_>| joint.problem.in_logs(&arm.body, held_out, j);
    let before = block_squares(&judged(joint));
    let total = before.iter().sum::<f64>();
    let mut tried: Vec<(Joint<'l>, usize, f64, f64)> = Vec::new();
    for (k, candidate) in candidates.iter().enumerate() {
        let next = candidate.fitted(joint);
        let after = block_squares(&judged(&next));
        let left = after.iter().sum::<f64>() / total.max(f64::MIN_POSITIVE);
        tried.push((next, k, left, by_chance(&before, &after)));
    }
    tried.sort_by(|a, b| a.2.total_cmp(&b.2));
    let mut tried = tried.into_iter();
    let (best, k, left, p_value) = tried.next()?;
    let is_sure = left <= 1.0 - rule.large_gain() || p_value <= level;
    if left > 1.0 - rule.least_gain || !is_sure || candidates[k].ends_at_bound(&best) {
        return None;
    }
    let samples: usize = judged(joint).tracks().iter().map(|track| track.t.len()).sum();
    let root = |squares: f64| (squares / samples.max(1) as f64).sqrt();
    let why_not = |share: f64| {
        let percent = [share, left].map(|x| 100.0 * x);
        format!("leaves {:.0} % of the held-out squared error, not {:.0} %", percent[0], percent[1])
    };
    let rivals = tried.map(|(_, other, share, _)| ServoRival {
        effect: candidates[other].name.to_string(),
        why_not: why_not(share),
    });
    let effect = ServoEffect {
        effect: candidates[k].name,
        joints: vec![JointNumber::from_index(j)],
        parameters: candidates[k].parameters(&best),
        rms_before: vec![root(total)],
        rms_after: vec![root(left * total)],
        p_value,
        probability: 1.0 - p_value,
        logs: Vec::new(),
        leftover: left,
        rivals: rivals.collect(),
    };
    Some((best, k, effect))
}
