//! Effects in logs of the validation set only, or a body in all fitted logs and in no other one: they are
//! found and removed before that set is used for any judgement.

use super::super::comparison::{leftover, relative_score};
use super::super::named::NamedEffect;
use super::super::search::{Extent, Screen, evidence, level_by_chance, refusal};
use crate::effects::{self, Candidate, Context, Found, Part, Window, contact_wrench};
use crate::options::ExplainOptions;
use crate::rule::Rule;
use powerball_identification::estimate::{Fit, Folds, Term, fit, noise_floor, residual_stats};
use powerball_identification::evidence::error_in_log;
use powerball_logs::log::Log;
use powerball_logs::regression::{Column, Data, DataError, RigidArm, Signals};
use powerball_logs::vector::median;

/// Rounds in which the settings are made consistent with the coefficients.
const ROUNDS: usize = 3;
/// Effects that are looked for in all logs together, at most.
const MOST: usize = 16;
/// Draws their surrogates.
const SEED: u64 = 7;

/// An effect in logs of the validation set only, or in all fitted logs.
#[derive(Clone, Debug)]
pub(crate) struct ValidationOnlyEffect {
    /// The report on this effect.
    pub(crate) named: NamedEffect,
    /// One entry a window or body.
    pub(crate) parts: Vec<ValidationOnlyPart>,
}

/// One of several pushes, or a body.
#[derive(Clone, Debug)]
pub(crate) struct ValidationOnlyPart {
    /// The change's form in a model.
    pub(crate) part: Part,
    /// The windows in which it acts.
    pub(crate) windows: Vec<Window>,
    /// Torque of the part on the fitted logs and on the validation set, which was taken out there, by joint
    /// and row, N·m.
    pub(crate) torque: [Signals; 2],
}

/// The base model, the logs that it is fitted to and those that it is judged on, as rows.
#[derive(Debug)]
pub(crate) struct Baseline<'a> {
    pub(crate) data: Data<'a>,
    pub(crate) validation: Data<'a>,
    pub(crate) base: Fit,
}

/// All logs together, with the base model fitted to them, and what was found in them.
struct Pooled<'a> {
    data: Data<'a>,
    folds: Folds,
    fit: Fit,
    seen: Vec<Seen>,
}

/// An effect that was found on pooled logs.
#[derive(Clone, Debug)]
struct Seen {
    candidate: Candidate,
    coefficients: Vec<f64>,
    p_value: f64,
    fold_gains: Vec<f64>,
    margin: f64,
}

/// Searches for effects in logs of the validation set only (see
/// [`Effect::may_be_in_validation_only`](crate::effects::Effect::may_be_in_validation_only)), and for a
/// body that all fitted logs have and no other one.
///
/// Such an effect can be learnt only from all logs together: its few numbers are fitted to all of them, and
/// the result says in which log it was seen. Returned are the rows without its torque and the base model of
/// these: everything else is judged on them.
///
/// # Errors
/// [`DataError`] as for any data.
pub(crate) fn validation_only_effects<'a>(
    body: &RigidArm,
    (logs, validate): (&[Log], &[Log]),
    options: &ExplainOptions<'_>,
    mut baseline: Baseline<'a>,
) -> Result<(Baseline<'a>, Vec<ValidationOnlyEffect>), DataError> {
    let rule = &options.rule;
    let Baseline { validation, base, .. } = &baseline;
    let residual = base.residual_on(validation, &[]);
    let odd = |log: usize| oddness(base, validation, &residual, log) > rule.unlike;
    if !(0..validation.logs.len()).any(odd) {
        return Ok((baseline, Vec::new()));
    }
    let all: Vec<Log> = logs.iter().chain(validate).cloned().collect();
    let together = Data::new(body, &all, &options.data)?;
    let folds = Folds::new(&together);
    let fit = fit(&together, &folds, &[], Some(base));
    let mut pooled = Pooled { data: together, folds, fit, seen: Vec::new() };
    // Effects in some fitted logs are found as well, so that they do not hide the others.
    while let Some(seen) = look(rule, &pooled).filter(|_| pooled.seen.len() < MOST) {
        pooled.take(rule, seen);
    }
    let whole = |seen: &Seen, log: &String| {
        seen.candidate.windows.iter().any(|w| w.log == *log && w.to.is_infinite())
    };
    let fitted = |seen: &&Seen| {
        let logs = &baseline.data.logs;
        logs.iter().all(|log| whole(seen, log)) && seen.candidate.windows.len() == logs.len()
    };
    let mut found = Vec::new();
    let of_fitted = pooled.seen.iter().find(fitted);
    if let Some((effect, data, base)) =
        of_fitted.and_then(|s| taken_out_of_fitted(rule, &pooled, &baseline, s))
    {
        found.push(effect);
        baseline = Baseline { data, base, ..baseline };
    }
    // A body that is put down again is there for a while as well, and no push.
    let short = |seen: &Seen| {
        matches!(Extent::of(&seen.candidate), Extent::Short(_)) && !seen.candidate.effect().of_the_body()
    };
    // Wrong zeros of torque sensors cause errors on another path that look like pushes.
    let Baseline { data, validation, base } = &baseline;
    let pushed = pooled.seen.iter().any(short) && {
        let (better, left) = with_zeros(rule, base, (data, validation));
        (0..validation.logs.len()).any(|log| oddness(&better, validation, &left, log) > rule.unlike)
    };
    let new = |seen: &&Seen| {
        let in_validation = seen.candidate.windows.iter().all(|w| validation.logs.contains(&w.log));
        let longest = seen.candidate.windows.iter().map(|w| w.to - w.from).fold(0.0, f64::max);
        // A push that lasts longer than that of a hand may equally be an error of the base model on a new
        // path.
        in_validation && (!short(seen) || (pushed && longest <= contact_wrench::LONGEST_PUSH))
    };
    let seen: Vec<&Seen> = pooled.seen.iter().filter(new).collect();
    for &effect in effects::all() {
        let own = seen.iter().copied().filter(|seen| seen.candidate.effect() == effect);
        let mut own: Vec<&Seen> = own.collect();
        own.sort_by(|a, b| a.begins().total_cmp(&b.begins()));
        if let Some((effect, without)) = taken_out(rule, &pooled, &baseline, &own) {
            found.push(effect);
            baseline.validation = without;
        }
    }
    Ok((baseline, found))
}

/// The base model with what every arm may have (see [`Effect::baseline`](crate::effects::Effect::baseline)),
/// and its residual on the validation set.
fn with_zeros(rule: &Rule, base: &Fit, (data, validation): (&Data<'_>, &Data<'_>)) -> (Fit, Signals) {
    let context = Context::new(data, base, &base.residual, rule);
    let candidates: Vec<Candidate> = effects::all().iter().flat_map(|e| e.baseline(&context)).collect();
    let columns = |context: &Context<'_>| -> Vec<Column> {
        candidates.iter().flat_map(|c| c.effect().columns(context, c)).collect()
    };
    let terms: Vec<Term> =
        columns(&context).into_iter().map(|column| Term { column, non_negative: false }).collect();
    let better = fit(data, &Folds::new(data), &terms, Some(base));
    let left = better.residual_on(validation, &columns(&Context::for_columns(validation, base, rule)));
    (better, left)
}

/// Takes a body that all fitted logs have out of them, where the base model fitted to what stays predicts the
/// validation set as it predicts the fitted logs. Returned with it are the fitted logs without it, and their
/// base model.
fn taken_out_of_fitted<'a>(
    rule: &Rule,
    pooled: &Pooled<'_>,
    Baseline { data, validation, base }: &Baseline<'a>,
    seen: &Seen,
) -> Option<(ValidationOnlyEffect, Data<'a>, Fit)> {
    let torque = seen.torque(data, base, rule);
    let residual = base.residual_on(validation, &[]);
    let without = data.without_torque(&torque);
    let fitted = fit(&without, &Folds::new(&without), &[], None);
    let left = fitted.residual_on(validation, &[]);
    let excess = |base: &Fit, residual: &Signals| excess(base, validation, residual, |_| true);
    if excess(&fitted, &left) > rule.max_unexplained * excess(base, &residual) {
        return None;
    }
    let named = named(rule, pooled, &[seen], validation, [residual, left]);
    let effect = with_torques(rule, pooled, &[seen], named, vec![[torque, Signals::zeros(validation)]]);
    Some((effect, without, fitted))
}

/// Removes an effect that was seen from the validation set, if it causes the difference of its logs. Also
/// returns that set without it.
fn taken_out<'a>(
    rule: &Rule,
    pooled: &Pooled<'_>,
    Baseline { data, validation, base }: &Baseline<'a>,
    seen: &[&Seen],
) -> Option<(ValidationOnlyEffect, Data<'a>)> {
    let residual = base.residual_on(validation, &[]);
    seen.first()?;
    let windows: Vec<Window> = seen.iter().flat_map(|seen| seen.candidate.windows.clone()).collect();
    let torques: Vec<Signals> = seen.iter().map(|seen| seen.torque(validation, base, rule)).collect();
    let mut torque = Signals::zeros(validation);
    torques.iter().for_each(|own| torque.add_signal(own, 1.0));
    if !makes_it_odd(rule, base, validation, &residual, (&windows, &torque)) {
        return None;
    }
    let without = validation.without_torque(&torque);
    let left = base.residual_on(&without, &[]);
    let named = named(rule, pooled, seen, &without, [residual, left]);
    let torques = torques.into_iter().map(|torque| [Signals::zeros(data), torque]).collect();
    Some((with_torques(rule, pooled, seen, named, torques), without))
}

/// The report on an effect that was seen, with the residual on the validation set before and after.
fn named(
    rule: &Rule,
    pooled: &Pooled<'_>,
    seen: &[&Seen],
    validation: &Data<'_>,
    left: [Signals; 2],
) -> NamedEffect {
    let Candidate { joints, .. } = &seen[0].candidate;
    let effect = seen[0].candidate.effect();
    let [before, after] = left.map(|residual| residual_stats(validation, &residual).rms);
    let context = Context::new(&pooled.data, &pooled.fit, &pooled.fit.residual, rule);
    let found: Vec<Found<'_>> = seen.iter().map(|seen| seen.found()).collect();
    let mut logs: Vec<String> = Vec::new();
    for window in seen.iter().flat_map(|seen| &seen.candidate.windows) {
        if !logs.contains(&window.log) {
            logs.push(window.log.clone());
        }
    }
    NamedEffect {
        // Follows from the rest when the result is made.
        probability: f64::NAN,
        effect: effect.name().to_string(),
        joints: joints.clone(),
        figures: effect.figures(&context, &found),
        leftover: leftover(&before, &after, &noise_floor(validation), joints),
        rms_before: before,
        rms_after: after,
        p_value: seen.iter().map(|seen| seen.p_value).fold(0.0, f64::max),
        held_out_gain: seen.iter().map(|seen| median(&mut seen.fold_gains.clone())).collect(),
        logs,
        again: None,
        in_some_logs: false,
        margin: seen.iter().map(|seen| seen.margin).fold(f64::INFINITY, f64::min),
        // No other column is fitted to validation logs.
        own_share: 1.0,
        relative_std: Vec::new(),
        class: effect.class().name().to_string(),
        rivals: Vec::new(),
    }
}

/// The parts of an effect that were seen, as parts of a model, each with its torques.
fn with_torques(
    rule: &Rule,
    pooled: &Pooled<'_>,
    seen: &[&Seen],
    named: NamedEffect,
    torques: Vec<[Signals; 2]>,
) -> ValidationOnlyEffect {
    let context = Context::new(&pooled.data, &pooled.fit, &pooled.fit.residual, rule);
    let part = |(seen, torque): (&&Seen, [Signals; 2])| ValidationOnlyPart {
        part: seen.candidate.effect().part(&context, &seen.candidate, &seen.coefficients),
        windows: seen.candidate.windows.clone(),
        torque,
    };
    let parts = seen.iter().zip(torques).map(part).collect();
    ValidationOnlyEffect { named, parts }
}

/// The best candidate on all logs in addition to what was seen already, if the rule accepts it.
fn look(rule: &Rule, pooled: &Pooled<'_>) -> Option<Seen> {
    let context = Context::new(&pooled.data, &pooled.fit, &pooled.fit.residual, rule);
    let screen = Screen::new(&context);
    let (trial, candidate) = effects::all()
        .iter()
        .filter(|effect| effect.may_be_in_validation_only())
        .flat_map(|effect| effect.candidates(&context))
        .filter(|c| !pooled.seen.iter().any(|seen| seen.candidate.excludes(c)))
        .filter_map(|c| Some((screen.try_candidate(&c)?, c)))
        .max_by(|a, b| a.0.score.total_cmp(&b.0.score))?;
    let found = evidence(&screen, &trial, &candidate.joints, &pooled.folds, Extent::of(&candidate), None);
    let tests = candidate.searched.max(1.0);
    let short = matches!(Extent::of(&candidate), Extent::Short(_));
    let is_chance = || short && trial.score <= level_by_chance(&screen, &[&trial], true, SEED);
    if refusal(rule, &found, tests, true).is_some() || is_chance() {
        return None;
    }
    Some(Seen {
        candidate,
        coefficients: Vec::new(),
        p_value: (found.p_value * tests).min(1.0),
        fold_gains: found.fold_gains,
        margin: relative_score(rule, trial.score),
    })
}

impl Seen {
    fn found(&self) -> Found<'_> {
        Found { candidate: &self.candidate, coefficients: &self.coefficients }
    }

    /// The effect's torque on some logs, by joint and row, N·m.
    fn torque(&self, data: &Data<'_>, base: &Fit, rule: &Rule) -> Signals {
        let mut torque = Signals::zeros(data);
        let context = Context::for_columns(data, base, rule);
        let columns = self.candidate.effect().columns(&context, &self.candidate);
        torque.add(&columns, &self.coefficients);
        torque
    }

    /// When it is there first, on the clock of all logs, s.
    fn begins(&self) -> f64 {
        self.candidate.windows.iter().map(|w| w.from + w.offset).fold(f64::INFINITY, f64::min)
    }
}

impl Pooled<'_> {
    /// Takes in what was seen, and fits all of it together with the base model until its settings follow from
    /// its coefficients.
    fn take(&mut self, rule: &Rule, seen: Seen) {
        self.seen.push(seen);
        for _ in 0..ROUNDS {
            let context = Context::new(&self.data, &self.fit, &self.fit.residual, rule);
            let (mut terms, mut counts) = (Vec::new(), Vec::new());
            for Seen { candidate, .. } in &self.seen {
                let columns = candidate.effect().columns(&context, candidate);
                counts.push(columns.len());
                terms.extend(columns.into_iter().map(|column| Term { column, non_negative: false }));
            }
            self.fit = fit(&self.data, &self.folds, &terms, Some(&self.fit));
            let (mut first, mut moved) = (0, false);
            for (seen, count) in self.seen.iter_mut().zip(counts) {
                seen.coefficients = (first..first + count).map(|c| self.fit.coefficient(c)).collect();
                first += count;
                if let Some(refined) = seen.candidate.effect().refined(&seen.candidate, &seen.coefficients) {
                    (seen.candidate, moved) = (refined, true);
                }
            }
            if !moved {
                break;
            }
        }
    }
}

/// Rows below which a joint says nothing about a log.
const ROWS: usize = 51;

/// How many times the squared error of the fitted logs a log of other data has, mean over joints.
fn oddness(base: &Fit, other: &Data<'_>, residual: &[Vec<f64>], log: usize) -> f64 {
    error_in_log(other, residual, &base.sigma, (log, ROWS)).unwrap_or(0.0)
}

/// What the logs for which `of` holds have of that beyond the fitted logs, in all.
fn excess(base: &Fit, other: &Data<'_>, residual: &[Vec<f64>], of: impl Fn(&String) -> bool) -> f64 {
    let logs = (0..other.logs.len()).filter(|log| of(&other.logs[*log]));
    logs.map(|log| oddness(base, other, residual, log) - 1.0).sum()
}

/// Whether the effect causes the difference of its logs: without its torque little of their excess over the
/// fitted logs remains, and no joint's error is larger. A base model that is wrong on a new path also makes
/// them different, and the best fit there only resembles that error.
fn makes_it_odd(
    rule: &Rule,
    base: &Fit,
    other: &Data<'_>,
    residual: &Signals,
    (windows, torque): (&[Window], &Signals),
) -> bool {
    let left = residual.without(torque);
    let own = |log: &String| windows.iter().any(|w| w.log == *log);
    let excess = |residual: &Signals| excess(base, other, residual, own);
    let little = excess(&left) <= rule.max_unexplained * excess(residual);
    let (after, before) = (left.squares(), residual.squares());
    little && !after.iter().zip(before).any(|(after, before)| *after > (1.0 + rule.little) * before)
}
