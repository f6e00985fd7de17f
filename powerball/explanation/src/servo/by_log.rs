//! What one log of position servos has that the others do not: another mass at the end of the arm, or another
//! gain.
//!
//! Each log is asked alone, with the servo as it was found on all: which mass, or which gain, would lower its
//! position error? A log is unlike the others where its squared error is twice theirs, one of them takes away
//! half of it, and is larger than what the same question gives on the other logs by chance.

use crate::rule::Rule;
use powerball_identification::estimate::distribution::t_critical;
use powerball_identification::servo::constants::Constant;
use powerball_identification::servo::fit::{Fitted, Free, errors, fit, objective, slopes};
use powerball_identification::servo::{Joint, Problem, Role, standard_errors};
use powerball_logs::vector::median;

/// Masses that are tried first, in units of the mass whose weight is a tenth of the torque at full duty: a
/// swing in phase with another mass is a minimum too.
const MASSES: [f64; 10] = [-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0, 1.6, 2.4, 3.5];
/// Gains that are tried first, as shares of the one of the arm file.
const GAINS: [f64; 7] = [0.2, 0.35, 0.6, 1.0, 1.6, 2.7, 4.5];
/// How many of them are refined, in how many steps.
const REFINED: usize = 3;
const STEPS: usize = 20;
/// Sizes that differ by less than this share of them are one change.
const ALIKE: f64 = 0.3;
/// Standard errors that a change must be away from none, where logs without one say how much sizes differ.
const CLEAR: f64 = 3.0;
/// The probability of as much of a normal number, for two sizes: a log is a few blocks that count as
/// independent, and its standard error is as uncertain as these are few.
const BY_CHANCE: f64 = 0.0027;

/// What may differ in a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// A mass at the end of the arm, kg.
    Payload,
    /// The drive's gain, in units of the arm file's.
    Gain,
}

impl Change {
    pub(super) const ALL: [Change; 2] = [Change::Payload, Change::Gain];

    /// The change's name in results.
    pub(super) fn name(self) -> &'static str {
        match self {
            Change::Payload => "payload",
            Change::Gain => "torque_constant",
        }
    }

    /// The value that changes nothing.
    pub(super) fn none(self) -> f64 {
        match self {
            Change::Payload => 0.0,
            Change::Gain => 1.0,
        }
    }
}

/// A change as some logs have it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// kg, or a share.
    pub value: f64,
    /// The standard error within these logs.
    pub std: f64,
    /// Blocks that count as independent.
    pub blocks: usize,
    /// The objective without it and with it, rad².
    pub before: f64,
    pub after: f64,
}

impl Size {
    /// The share of the squared error that stays.
    pub(super) fn left(&self) -> f64 {
        self.after / self.before.max(f64::MIN_POSITIVE)
    }

    /// Standard errors that two sizes differ by with probability [`BY_CHANCE`]: Student's t.
    fn apart(&self) -> f64 {
        t_critical(BY_CHANCE, self.blocks.saturating_sub(1).max(1) as f64)
    }

    /// Whether it is away from none, next to how much logs without a change differ.
    fn is_clear(&self, change: Change, spread: f64) -> bool {
        (self.value - change.none()).abs() > CLEAR * self.std.hypot(spread)
    }
}

/// The size of a change in the logs of a problem, everything else as it is there; `None` where the joint
/// cannot show it.
pub(super) fn size(problem: &Problem<'_>, change: Change) -> Option<Size> {
    let (role, unit, first): (Role, f64, &[f64]) = match change {
        Change::Payload => {
            let weight = problem.payload_torque();
            let torque = problem.constants.of(Constant::Torque);
            (Role::Payload, (weight > 1e-6 * torque).then(|| 0.1 * torque / weight)?, &MASSES)
        }
        Change::Gain => (Role::Constant(Constant::Kp), problem.constants.of(Constant::Kp), &GAINS),
    };
    let asked = problem.asking(vec![role]);
    let least = if change == Change::Gain { 0.05 * unit } else { f64::NEG_INFINITY };
    let free = [Free { scale: unit, least }];
    let at = |value: f64| {
        let errors = errors(&asked, &[value]);
        Fitted { objective: objective(&errors), values: vec![value], errors }
    };
    let mut starts: Vec<Fitted> = first.iter().map(|share| at(share * unit)).collect();
    let before =
        objective(&errors(&asked, &[change.none() * if change == Change::Gain { unit } else { 1.0 }]));
    starts.sort_by(|a, b| a.objective.total_cmp(&b.objective));
    let refined = starts.iter().take(REFINED).map(|start| fit(&asked, &start.values, &free, STEPS));
    let best = refined.min_by(|a, b| a.objective.total_cmp(&b.objective))?;
    let slopes = slopes(&asked, &best.values, &free);
    let std = standard_errors(&slopes, &best.errors, &free, problem.block())[0]?;
    let scale = if change == Change::Gain { unit } else { 1.0 };
    Some(Size {
        value: best.values[0] / scale,
        std: std / scale,
        blocks: problem.blocks(),
        before,
        after: best.objective,
    })
}

/// The errors of a problem with a change of a size.
pub(super) fn changed(problem: &Problem<'_>, change: Change, value: f64) -> Vec<Vec<f64>> {
    match change {
        Change::Payload => errors(&problem.asking(vec![Role::Payload]), &[value]),
        Change::Gain => {
            let kp = problem.constants.of(Constant::Kp);
            errors(&problem.asking(vec![Role::Constant(Constant::Kp)]), &[value * kp])
        }
    }
}

/// The sizes of every change in every log, one problem a log.
pub(super) fn sizes(logs: &[Problem<'_>]) -> Vec<[Option<Size>; 2]> {
    logs.iter().map(|log| Change::ALL.map(|change| size(log, change))).collect()
}

/// How much each change differs between logs that have none: what a size is compared with in addition to its
/// own error.
pub(super) fn spread(sizes: &[[Option<Size>; 2]], odd: &[bool], change: Change) -> f64 {
    let mut values: Vec<f64> = sizes
        .iter()
        .zip(odd)
        .filter(|(_, odd)| !**odd)
        .filter_map(|(of, _)| Some((of[change as usize]?.value - change.none()).abs()))
        .collect();
    // The median of |x| of a normal x is 0.6745 of its deviation.
    median(&mut values) / 0.6745
}

/// The squared error of each log over the median one of the fitted logs, which are the first `fitted`; `None`
/// where no change can be tested.
pub(super) fn error_ratios(sizes: &[[Option<Size>; 2]], fitted: usize) -> Vec<Option<f64>> {
    let error = |of: &[Option<Size>; 2]| of.iter().flatten().next().map(|size| size.before);
    let mut usual: Vec<f64> = sizes[..fitted].iter().filter_map(error).collect();
    let usual = median(&mut usual).max(f64::MIN_POSITIVE);
    sizes.iter().map(|of| Some(error(of)? / usual)).collect()
}

/// Which logs are unlike the fitted ones, which are the first `fitted`: by log, the change that explains it
/// best. All validation logs can have a change.
pub(super) fn odd(sizes: &[[Option<Size>; 2]], fitted: usize, rule: &Rule) -> Vec<Option<Change>> {
    let ratios = error_ratios(sizes, fitted);
    let spreads = Change::ALL.map(|change| spread(&sizes[..fitted], &vec![false; fitted], change));
    let best = |(of, ratio): (&[Option<Size>; 2], &Option<f64>)| -> Option<Change> {
        let clear = |change: &Change| {
            of[*change as usize].is_some_and(|size| {
                ratio.is_some_and(|ratio| ratio > rule.unlike)
                    && size.left() <= 1.0 - rule.most
                    && size.is_clear(*change, spreads[*change as usize])
            })
        };
        let left = |change: &Change| of[*change as usize].map_or(f64::INFINITY, |size| size.after);
        Change::ALL.into_iter().filter(clear).min_by(|a, b| left(a).total_cmp(&left(b)))
    };
    sizes.iter().zip(&ratios).map(best).collect()
}

/// The logs of each change, those whose sizes agree together: two loads are two effects. A size has its own
/// standard error, and in addition what logs without a change differ by.
pub(super) fn groups(changes: &[Option<Change>], sizes: &[[Option<Size>; 2]]) -> Vec<(Change, Vec<usize>)> {
    let mut groups: Vec<(Change, Vec<usize>)> = Vec::new();
    let odd: Vec<bool> = changes.iter().map(Option::is_some).collect();
    for change in Change::ALL {
        let spread = spread(sizes, &odd, change);
        let of = |k: &usize| sizes[*k][change as usize];
        let mut own: Vec<usize> = (0..changes.len()).filter(|k| changes[*k] == Some(change)).collect();
        own.sort_by(|a, b| of(a).map_or(0.0, |s| s.value).total_cmp(&of(b).map_or(0.0, |s| s.value)));
        let mut last: Option<Size> = None;
        for k in own {
            let Some(size) = of(&k) else { continue };
            let apart = |last: Size| {
                let difference = (size.value - last.value).abs();
                let share =
                    difference / (size.value - change.none()).abs().max((last.value - change.none()).abs());
                let error = size.std.hypot(spread).hypot(last.std.hypot(spread));
                difference > size.apart().max(last.apart()) * error && share > ALIKE
            };
            match groups.last_mut() {
                Some((of, logs)) if *of == change && !last.is_some_and(apart) => logs.push(k),
                _ => groups.push((change, vec![k])),
            }
            last = Some(size);
        }
    }
    groups
}

/// Logs that are not unlike enough alone join those whose change, as large as it is there, takes away as much
/// of their squared error as a change must.
pub(super) fn join(
    groups: &mut [(Change, Vec<usize>)],
    changes: &mut [Option<Change>],
    (each, sizes): (&[Problem<'_>], &[[Option<Size>; 2]]),
    rule: &Rule,
) {
    let odd: Vec<bool> = changes.iter().map(Option::is_some).collect();
    for (change, own) in groups {
        let Some(size) = size(&together(each, own), *change) else { continue };
        let spread = spread(sizes, &odd, *change);
        for k in 0..each.len() {
            let Some(alone) = sizes[k][*change as usize].filter(|_| changes[k].is_none()) else { continue };
            let with = objective(&changed(&each[k], *change, size.value));
            if with <= (1.0 - rule.most) * alone.before && alone.is_clear(*change, spread) {
                changes[k] = Some(*change);
                own.push(k);
            }
        }
    }
}

/// Logs as one problem.
pub(super) fn together<'o>(each: &[Problem<'o>], own: &[usize]) -> Problem<'o> {
    each[own[0]].clone().and(own[1..].iter().map(|k| &each[*k]))
}

/// A payload of `own` logs, fitted with all constants of the joint, which the logs `like` share: what
/// friction and what weight is, both loads decide. With the errors of `own`.
pub(super) fn payload(
    each: &[Problem<'_>],
    (like, own): (&[usize], &[usize]),
    joint: &Joint<'_>,
    size: Size,
) -> Option<(Size, Vec<Vec<f64>>)> {
    if like.is_empty() {
        return None;
    }
    let mut roles = joint.problem.roles.clone();
    roles.push(Role::Payload);
    let unloaded = together(each, like).unloaded();
    let count = unloaded.tracks().len();
    let all = unloaded.and([&together(each, own)]).asking(roles);
    let start: Vec<f64> = joint.fitted.values.iter().copied().chain([size.value]).collect();
    let scale = size.value.abs().max(f64::MIN_POSITIVE);
    let free: Vec<Free> =
        joint.free.iter().copied().chain([Free { scale, least: f64::NEG_INFINITY }]).collect();
    let fitted = fit(&all, &start, &free, STEPS);
    let slopes = slopes(&all, &fitted.values, &free);
    let std = standard_errors(&slopes, &fitted.errors, &free, all.block()).pop()??;
    let value = *fitted.values.last()?;
    let left = fitted.errors[count..].to_vec();
    Some((Size { value, std, after: objective(&left), ..size }, left))
}
