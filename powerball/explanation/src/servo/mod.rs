//! What the model of an arm on position servos lacks, judged by positions of other logs.
//!
//! The base of each joint is its closed loop with Coulomb and viscous friction. What candidates add must
//! lower the error of simulated positions on the validation logs, block by block; what one log has alone is
//! looked for first, since such a log would bend everything else.

mod by_log;
mod candidates;
mod result;
#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tests;

use crate::rule::Rule;
use by_log::{Change, Size};
use powerball_controller::JointNumber;
use powerball_identification::IdentifyError;
use powerball_identification::estimate::distribution::{f_tail, t_quantile_975};
use powerball_identification::servo::constants::Constant;
use powerball_identification::servo::fit::errors;
use powerball_identification::servo::{Joint, Problem, Role, ServoArm, goal_error, off_in_all, rms};
use powerball_logs::Progress;
use powerball_logs::log::ServoLog;
pub use result::{Both, Differs, ExplainedServos, LogResult, ServoEffect, ServoRival, ServoVerdict};
use serde_json::json;

/// Explains logs of position servos: what they lack on all logs, and what single logs have.
///
/// # Errors
/// Arms and logs that cannot be used, and no validation log: why.
pub fn explain_servos(
    arm: &ServoArm,
    logs: &[ServoLog],
    validate: &[ServoLog],
    rule: &Rule,
    progress: Progress<'_>,
) -> Result<ExplainedServos, IdentifyError> {
    if validate.is_empty() {
        return Err(IdentifyError::Setting(
            "every addition is judged on logs that were not fitted: give at least one validation log".into(),
        ));
    }
    let mut result = ExplainedServos::of(arm, logs, validate);
    for j in 0..arm.body.dof() {
        progress.say(&format!("explaining joint {}", j + 1));
        explain_joint(&mut result, arm, (logs, validate), j, rule)?;
    }
    result.conclude(rule);
    Ok(result)
}

/// One joint: odd logs, the base without them, what it lacks.
fn explain_joint(
    result: &mut ExplainedServos,
    arm: &ServoArm,
    (logs, validate): (&[ServoLog], &[ServoLog]),
    j: usize,
    rule: &Rule,
) -> Result<(), IdentifyError> {
    let first = Odd::in_logs(arm, logs, (logs, validate), j, rule)?;
    let own = logs.iter().zip(&first.changes).filter(|(_, odd)| odd.is_none());
    let mut like: Vec<ServoLog> = own.map(|(log, _)| log.clone()).collect();
    if like.is_empty() {
        like = logs.to_vec();
    }
    // Odd logs had a part in what they were compared with.
    let found =
        if like.len() < logs.len() { Odd::in_logs(arm, &like, (logs, validate), j, rule)? } else { first };
    let odd_in = |of: &[ServoLog], from: usize| -> Vec<ServoLog> {
        of.iter()
            .zip(&found.changes[from..])
            .filter(|(_, odd)| odd.is_none())
            .map(|(log, _)| log.clone())
            .collect()
    };
    let held_out = odd_in(validate, logs.len());
    // What no other log can judge is judged where it was found.
    let held_out = if held_out.is_empty() { &like } else { &held_out };
    let known = arm.known(j);
    let mut problem =
        Problem::new(&arm.body, &like, j, &known).ok_or_else(|| IdentifyError::NothingUsable(Vec::new()))?;
    problem.roles.retain(|role| *role != Role::Constant(Constant::Load));
    let mut joint = Joint::solve(problem);
    for (log, ratio) in result.logs.iter_mut().zip(by_log::error_ratios(&found.sizes, logs.len())) {
        // The largest of all joints.
        log.error_ratio = ratio.map(f64::sqrt).into_iter().chain(log.error_ratio).reduce(f64::max);
    }
    if goal_error(&joint.problem.goal_errors(0.0)).is_none() {
        result.unusable.push(off_in_all(&JointNumber::from_index(j).to_string()));
    }
    let base = joint.problem.in_logs(&arm.body, logs, j);
    let base_validate = joint.problem.in_logs(&arm.body, validate, j);
    result.before.add(&errors(&base, &[]), &errors(&base_validate, &[]));
    let all = candidates::all(&joint, arm, held_out, rule);
    candidates::name(&mut joint, &mut result.effects, all, (arm, held_out), rule);
    report_odd(result, arm, &joint, (logs, validate), &found, j);
    Ok(())
}

/// What single logs have on a joint.
struct Odd<'o, 'l> {
    /// The joint with all friction, as it is in the logs that it is compared with.
    joint: Joint<'l>,
    /// The joint's problem in each log.
    each: Vec<Problem<'o>>,
    /// By log, those to fit first.
    changes: Vec<Option<Change>>,
    sizes: Vec<[Option<Size>; 2]>,
    /// The logs of each change.
    groups: Vec<(Change, Vec<usize>)>,
}

impl<'o, 'l> Odd<'o, 'l> {
    /// Compared with the servo in the logs `like`.
    fn in_logs(
        arm: &ServoArm,
        like: &'l [ServoLog],
        (logs, validate): (&'o [ServoLog], &'o [ServoLog]),
        j: usize,
        rule: &Rule,
    ) -> Result<Odd<'o, 'l>, IdentifyError> {
        let joint = Joint::fit(arm, like, j)?;
        let each = each_log(arm, &joint, (logs, validate), j);
        let sizes = by_log::sizes(&each);
        let mut changes = by_log::odd(&sizes, logs.len(), rule);
        let mut groups = by_log::groups(&changes, &sizes);
        by_log::join(&mut groups, &mut changes, (&each, &sizes), rule);
        Ok(Odd { joint, each, changes, sizes, groups })
    }

    /// How large a change of logs is, and their errors with it, `None` where the joint cannot show it.
    fn size(&self, change: Change, own: &[usize], to_fit: usize) -> Option<(Size, Vec<Vec<f64>>)> {
        let together = by_log::together(&self.each, own);
        let size = by_log::size(&together, change)?;
        let like: Vec<usize> = (0..to_fit).filter(|k| self.changes[*k].is_none()).collect();
        let with_all = match change {
            Change::Payload => by_log::payload(&self.each, (&like, own), &self.joint, size),
            Change::Gain => None,
        };
        Some(with_all.unwrap_or_else(|| (size, by_log::changed(&together, change, size.value))))
    }
}

/// A problem for each log, those to fit first.
fn each_log<'o>(
    arm: &ServoArm,
    joint: &Joint<'_>,
    (logs, validate): (&'o [ServoLog], &'o [ServoLog]),
    j: usize,
) -> Vec<Problem<'o>> {
    let (fit, held_out) =
        (joint.problem.in_logs(&arm.body, logs, j), joint.problem.in_logs(&arm.body, validate, j));
    let own = (0..logs.len()).map(|k| fit.of_log(k));
    own.chain((0..validate.len()).map(|k| held_out.of_log(k))).collect()
}

/// Names what single logs have, each change once for all logs that have it, and what is left with it.
fn report_odd(
    result: &mut ExplainedServos,
    arm: &ServoArm,
    joint: &Joint<'_>,
    (logs, validate): (&[ServoLog], &[ServoLog]),
    odd: &Odd<'_, '_>,
    j: usize,
) {
    let number = JointNumber::from_index(j);
    let each = each_log(arm, joint, (logs, validate), j);
    let mut left: Vec<Vec<Vec<f64>>> = each.iter().map(|problem| errors(problem, &[])).collect();
    let is_odd: Vec<bool> = odd.changes.iter().map(Option::is_some).collect();
    for (change, own) in &odd.groups {
        let change = *change;
        // They are unlike the others, with a name or without.
        own.iter().for_each(|k| result.logs[*k].like_the_others = false);
        let Some((size, squares)) = odd.size(change, own, logs.len()) else { continue };
        let spread = by_log::spread(&odd.sizes, &is_odd, change) / (own.len() as f64).sqrt();
        let between = between(&odd.sizes, own, change);
        let std = size.std.hypot(spread).hypot(between);
        let blocks: usize = own.iter().map(|k| odd.each[*k].blocks()).sum();
        let usual = is_odd.iter().filter(|odd| !**odd).count();
        let freedom = freedom([(size.std, blocks), (spread, usual), (between, own.len())]);
        let p_value = f_tail(((size.value - change.none()) / std).powi(2), 1.0, freedom);
        let half = t_quantile_975(freedom) * std;
        // What may be nothing has no name.
        if (size.value - change.none()).abs() <= half {
            continue;
        }
        let before = rms_of(&left, own);
        let mut with = squares.into_iter();
        own.iter().for_each(|k| left[*k] = with.by_ref().take(left[*k].len()).collect());
        let effect = ServoEffect {
            effect: change.name(),
            joints: vec![number],
            parameters: parameters(arm, joint, change, (size.value, std, half), own.len()),
            rms_before: vec![before],
            rms_after: vec![rms_of(&left, own)],
            p_value,
            probability: 1.0 - p_value,
            logs: own.iter().map(|k| result.logs[*k].log.clone()).collect(),
            leftover: size.left(),
            rivals: rivals(&odd.sizes, own, change),
        };
        for &k in own {
            let length = if k < logs.len() { &logs[k].t } else { &validate[k - logs.len()].t };
            let share = 1.0 - odd.sizes[k][change as usize].map_or(1.0, |size| size.left());
            result.logs[k].differs.push(Differs {
                effect: change.name(),
                joints: vec![number],
                start_time: length.first().copied().unwrap_or(0.0),
                end_time: length.last().copied().unwrap_or(0.0),
                share,
            });
        }
        result.effects.push(effect);
    }
    let (fit, held_out) = left.split_at(logs.len());
    result.after.add(&fit.concat(), &held_out.concat());
    let delay = joint.goal_delay();
    let goal: Vec<Vec<f64>> =
        each.iter().skip(logs.len()).flat_map(|problem| problem.goal_errors(delay)).collect();
    result.goal_error.push(goal_error(&goal));
}

/// The degrees of freedom of a standard error that is made of several, each with its count of numbers (Welch
/// and Satterthwaite).
fn freedom(parts: [(f64, usize); 3]) -> f64 {
    let all: f64 = parts.iter().map(|(std, _)| std * std).sum();
    let each = |(std, count): &(f64, usize)| std.powi(4) / count.saturating_sub(1).max(1) as f64;
    (all * all / parts.iter().map(each).sum::<f64>().max(f64::MIN_POSITIVE)).max(1.0)
}

/// How far single logs of those that have a change are from each other, as the error of their mean.
fn between(sizes: &[[Option<Size>; 2]], own: &[usize], change: Change) -> f64 {
    let values: Vec<f64> = own.iter().filter_map(|k| Some(sizes[*k][change as usize]?.value)).collect();
    let n = values.len() as f64;
    if n < 2.0 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()
}

fn rms_of(left: &[Vec<Vec<f64>>], own: &[usize]) -> f64 {
    rms(&own.iter().flat_map(|k| left[*k].iter().cloned()).collect::<Vec<_>>())
}

fn parameters(
    arm: &ServoArm,
    joint: &Joint<'_>,
    change: Change,
    (value, std, half): (f64, f64, f64),
    logs: usize,
) -> serde_json::Map<String, serde_json::Value> {
    let absolute = arm.known(joint.problem.joint).is_absolute();
    let interval = [value - half, value + half];
    let of = match change {
        Change::Payload if absolute => json!({"mass": value, "mass_std": std, "mass_interval": interval,
            "com": arm.tool, "start_time": vec![0.0; logs]}),
        // Kilograms a newton metre of the torque at full duty.
        Change::Payload => json!({"mass": null, "mass_for_torque": value, "mass_for_torque_std": std,
            "com": arm.tool, "start_time": vec![0.0; logs]}),
        Change::Gain => {
            let kp = joint.problem.constants.of(Constant::Kp);
            json!({"gain": value, "gain_std": std, "gain_interval": interval, "kp": value * kp})
        }
    };
    of.as_object().cloned().unwrap_or_default()
}

fn rivals(sizes: &[[Option<Size>; 2]], own: &[usize], change: Change) -> Vec<ServoRival> {
    let left = |change: Change| -> Option<f64> {
        let all: Option<Vec<Size>> = own.iter().map(|k| sizes[*k][change as usize]).collect();
        let sum = |(a, b): (f64, f64), size: &Size| (a + size.after, b + size.before);
        let (after, before) = all?.iter().fold((0.0, 0.0), sum);
        Some(100.0 * after / before.max(f64::MIN_POSITIVE))
    };
    let why_not = |other: Change| match (left(other), left(change)) {
        (Some(theirs), Some(ours)) => {
            format!("leaves {theirs:.0} % of the squared error of these logs, not {ours:.0} %")
        }
        _ => "these logs cannot show it".into(),
    };
    let others = Change::ALL.into_iter().filter(|other| *other != change);
    others.map(|other| ServoRival { effect: other.name().to_string(), why_not: why_not(other) }).collect()
}
