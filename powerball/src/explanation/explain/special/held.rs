//! What is held in logs of the validation set only: it is found and taken out before that set judges
//! anything.

use super::super::comparison::surprise;
use super::super::named::NamedEffect;
use super::super::search::{Extent, Screen, evidence, refusal};
use crate::explanation::effects::{self, Candidate, Context, Found, Part, Window};
use crate::explanation::options::ExplainOptions;
use crate::explanation::rule::Rule;
use crate::identification::estimate::{Fit, Folds, Term, fit, spread};
use crate::logs::log::Log;
use crate::logs::regression::{Column, Data, DataError, RigidArm};

/// Rounds in which the settings are made consistent with the coefficients.
const ROUNDS: usize = 3;

/// What is in logs of the validation set only.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    /// What is said of it.
    pub(crate) named: NamedEffect,
    /// What it is in a model.
    pub(crate) part: Part,
    /// Where it is.
    pub(crate) windows: Vec<Window>,
}

/// All logs together, with the base model fitted to them.
struct Pooled<'a> {
    data: Data<'a>,
    folds: Folds,
    fit: Fit,
}

/// An effect that was found on pooled logs.
struct Seen {
    candidate: Candidate,
    coefficients: Vec<f64>,
    p_value: f64,
    fold_gains: Vec<f64>,
    margin: f64,
}

/// Looks for what is in logs of the validation set only (see
/// [`Effect::may_be_in_validation_only`](crate::explanation::effects::Effect::may_be_in_validation_only)).
///
/// It can be learnt nowhere else than where it is: its few numbers are fitted to all logs together, and the
/// result says in which log it was seen. Its torque is taken out of `validation`; everything else is judged
/// on what stays.
///
/// # Errors
/// [`DataError`] as for any data.
pub(crate) fn held_in_validation(
    body: &RigidArm,
    (logs, validate): (&[Log], &[Log]),
    options: &ExplainOptions<'_>,
    base: &Fit,
    validation: &mut Data<'_>,
) -> Result<Option<Held>, DataError> {
    let rule = &options.rule;
    let residual = base.residual_on(validation, &[]);
    let odd = |log: usize| oddness(base, validation, &residual, log) > rule.odd_log;
    if !(0..validation.logs.len()).any(odd) {
        return Ok(None);
    }
    let all: Vec<Log> = logs.iter().chain(validate).cloned().collect();
    let data = Data::new(body, &all, &options.data)?;
    let folds = Folds::new(&data);
    let fit = fit(&data, &folds, &[], Some(base));
    let mut pooled = Pooled { data, folds, fit };
    let Some(mut seen) = look(rule, &pooled, validate) else { return Ok(None) };
    settle(rule, &mut pooled, &mut seen);
    let Seen { candidate, coefficients, p_value, mut fold_gains, margin } = seen;
    let effect = candidate.effect();
    let columns = effect.columns(&Context::new(validation, base, &residual, rule), &candidate);
    if !makes_it_odd(rule, base, validation, &residual, (&candidate.windows, &columns, &coefficients)) {
        return Ok(None);
    }
    let before = spread(validation, &residual).rms;
    take_out(validation, &columns, &coefficients);
    let after = spread(validation, &base.residual_on(validation, &[])).rms;
    let context = Context::new(&pooled.data, &pooled.fit, &pooled.fit.residual, rule);
    let found = Found { candidate: &candidate, coefficients: &coefficients };
    fold_gains.sort_by(f64::total_cmp);
    let named = NamedEffect {
        probability: options.rule.right,
        effect: effect.name().to_string(),
        joints: candidate.joints.clone(),
        figures: effect.figures(&context, &[found]),
        leftover: after.iter().zip(&before).map(|(a, b)| (a / b).powi(2)).sum::<f64>() / before.len() as f64,
        rms_before: before,
        rms_after: after,
        p_value,
        held_out_gain: fold_gains.get(fold_gains.len() / 2).copied().into_iter().collect(),
        logs: candidate.windows.iter().map(|w| w.log.clone()).collect(),
        margin,
        class: effect.class().name().to_string(),
        rivals: Vec::new(),
    };
    let part = effect.part(&context, &candidate, &coefficients);
    Ok(Some(Held { named, part, windows: candidate.windows }))
}

/// The best candidate on all logs, if it is in validation logs only and the rule accepts it.
fn look(rule: &Rule, pooled: &Pooled<'_>, validate: &[Log]) -> Option<Seen> {
    let context = Context::new(&pooled.data, &pooled.fit, &pooled.fit.residual, rule);
    let screen = Screen::new(&context);
    let (trial, candidate) = effects::all()
        .iter()
        .filter(|effect| effect.may_be_in_validation_only())
        .flat_map(|effect| effect.candidates(&context))
        .filter_map(|c| Some((screen.try_candidate(&c)?, c)))
        .max_by(|a, b| a.0.score.total_cmp(&b.0.score))?;
    let found = evidence(&screen, &trial, &candidate.joints, &pooled.folds, Extent::of(&candidate), None);
    let tests = candidate.searched.max(1.0);
    let new = |name: &String| validate.iter().any(|log| log.file == *name);
    let elsewhere = candidate.windows.iter().any(|w| !new(&w.log));
    if elsewhere || refusal(rule, &found, tests, true).is_some() {
        return None;
    }
    Some(Seen {
        candidate,
        coefficients: Vec::new(),
        p_value: (found.p_value * tests).min(1.0),
        fold_gains: found.fold_gains,
        margin: surprise(rule, trial.score),
    })
}

/// Fits what was seen beside the base model until its settings follow from its coefficients.
fn settle(rule: &Rule, pooled: &mut Pooled<'_>, seen: &mut Seen) {
    for _ in 0..ROUNDS {
        let context = Context::new(&pooled.data, &pooled.fit, &pooled.fit.residual, rule);
        let columns = seen.candidate.effect().columns(&context, &seen.candidate);
        let count = columns.len();
        let terms: Vec<Term> =
            columns.into_iter().map(|column| Term { column, non_negative: false }).collect();
        pooled.fit = fit(&pooled.data, &pooled.folds, &terms, Some(&pooled.fit));
        seen.coefficients = (0..count).map(|c| pooled.fit.coefficient(c)).collect();
        match seen.candidate.effect().refined(&seen.candidate, &seen.coefficients) {
            Some(refined) => seen.candidate = refined,
            None => break,
        }
    }
}

/// How many times the squared error of the fitted logs a log of other data has, mean over joints.
fn oddness(base: &Fit, other: &Data<'_>, residual: &[Vec<f64>], log: usize) -> f64 {
    let ratios: Vec<f64> = (0..other.dof())
        .filter_map(|j| {
            let rows = other.recordings.iter().zip(&other.joints[j].rows).filter(|(r, _)| r.log == log);
            let (mut square, mut count) = (0.0, 0usize);
            for (_, rows) in rows {
                square += residual[j][rows.clone()].iter().map(|v| v * v).sum::<f64>();
                count += rows.len();
            }
            (count > 50 && base.sigma[j] > 0.0).then(|| square / count as f64 / base.sigma[j].powi(2))
        })
        .collect();
    ratios.iter().sum::<f64>() / ratios.len().max(1) as f64
}

/// Whether what was seen is what makes its logs odd: without it little of their excess over the fitted logs is
/// left, and no joint's error is larger. A base model that errs on a new path makes them odd as well, and what
/// fits best there only resembles that error.
fn makes_it_odd(
    rule: &Rule,
    base: &Fit,
    other: &Data<'_>,
    residual: &[Vec<f64>],
    (windows, columns, coefficients): (&[Window], &[Column], &[f64]),
) -> bool {
    let mut left = residual.to_vec();
    columns.iter().zip(coefficients).for_each(|(column, c)| column.add_to(&mut left, -c));
    let logs = || (0..other.logs.len()).filter(|log| windows.iter().any(|w| w.log == other.logs[*log]));
    let excess =
        |residual: &[Vec<f64>]| -> f64 { logs().map(|log| oddness(base, other, residual, log) - 1.0).sum() };
    let square = |residual: &[f64]| residual.iter().map(|v| v * v).sum::<f64>();
    let harms =
        |(left, residual): (&Vec<f64>, &Vec<f64>)| square(left) > (1.0 + rule.harm) * square(residual);
    excess(&left) <= rule.much_left * excess(residual) && !left.iter().zip(residual).any(harms)
}

fn take_out(other: &mut Data<'_>, columns: &[Column], coefficients: &[f64]) {
    for (column, c) in columns.iter().zip(coefficients) {
        for (j, values) in &column.parts {
            other.joints[*j].torque.iter_mut().zip(values.iter()).for_each(|(t, v)| *t -= c * v);
        }
    }
}
