//! Something held in logs of the other path: in those only, where it is found and taken out before that path
//! judges anything; or in fitted ones, where each other log is asked whether it is held there too.

use super::evidence::{Extent, evidence};
use super::forward::Session;
use super::naming::surprise;
use super::result::NamedEffect;
use super::rule;
use super::screen::Screen;
use crate::explanation::effects::{Context, Effect, Found, payload};
use crate::identification::estimate::{Fit, Folds, Term, fit, spread};
use crate::logs::log::Log;
use crate::logs::regression::{Column, Data, DataError, DataOptions, RigidBody};

/// A log whose squared error is this many times that of the fitted logs holds something that they do not.
const ODD: f64 = 2.0;
/// Rounds in which the payload's inertia is made consistent with its mass and place.
const ROUNDS: usize = 3;

/// Looks for a payload that is in logs of the other path only.
///
/// Such a payload can be learnt nowhere else than where it is: its few numbers are fitted to all logs
/// together, and the result says in which log it was seen. Its torque is taken out of `other`; everything
/// else is judged on what stays.
///
/// # Errors
/// [`DataError`] as for any data.
pub(super) fn payload_on(
    body: &RigidBody,
    logs: &[Log],
    validate: &[Log],
    options: &DataOptions,
    base: &Fit,
    other: &mut Data<'_>,
) -> Result<Option<NamedEffect>, DataError> {
    let residual = base.residual_on(other, &[]);
    if !odd(base, other, &residual) {
        return Ok(None);
    }
    let all: Vec<Log> = logs.iter().chain(validate).cloned().collect();
    let data = Data::new(body, &all, options)?;
    let folds = Folds::new(&data);
    let effect = payload::Payload;
    let pooled = fit(&data, &folds, &[], Some(base));
    let (mut candidate, p_value, gains, margin) = {
        let context = Context::new(&data, &pooled, &pooled.residual);
        let screen = Screen::new(&context);
        let candidates = effect.candidates(&context);
        let tried: Vec<_> =
            candidates.into_iter().filter_map(|c| Some((screen.try_candidate(&effect, &c)?, c))).collect();
        let Some((trial, candidate)) = tried.into_iter().max_by(|a, b| a.0.score.total_cmp(&b.0.score))
        else {
            return Ok(None);
        };
        let found = evidence(&screen, &trial, &candidate.joints, &folds, Extent::SomeLogs, None);
        let tests = candidate.searched.max(1.0);
        let new = |name: &String| validate.iter().any(|log| log.file == *name);
        let elsewhere = candidate.windows.iter().any(|w| !new(&w.log));
        if elsewhere || rule::refusal(&found, tests, true).is_some() {
            return Ok(None);
        }
        (candidate, (found.p_value * tests).min(1.0), found.fold_gains, surprise(trial.score))
    };
    let mut fitted = pooled;
    let mut coefficients = Vec::new();
    for _ in 0..ROUNDS {
        let columns = effect.columns(&Context::new(&data, &fitted, &fitted.residual), &candidate);
        let count = columns.len();
        let terms: Vec<Term> =
            columns.into_iter().map(|column| Term { column, non_negative: false }).collect();
        fitted = fit(&data, &folds, &terms, Some(&fitted));
        coefficients = (0..count).map(|c| fitted.coefficient(c)).collect();
        match effect.refined(&candidate, &coefficients) {
            Some(refined) => candidate = refined,
            None => break,
        }
    }
    let columns = effect.columns(&Context::new(other, base, &residual), &candidate);
    let before = spread(other, &residual).rms;
    take_out(other, &columns, &coefficients);
    let after = spread(other, &base.residual_on(other, &[])).rms;
    let parameters = effect.parameters(
        &Context::new(&data, &fitted, &fitted.residual),
        &[Found { candidate: &candidate, coefficients: &coefficients }],
    );
    let mut gains = gains;
    gains.sort_by(f64::total_cmp);
    Ok(Some(NamedEffect {
        effect: effect.name().to_string(),
        joints: candidate.joints.iter().map(|j| j + 1).collect(),
        parameters,
        leftover: after.iter().zip(&before).map(|(a, b)| (a / b).powi(2)).sum::<f64>() / before.len() as f64,
        rms_before: before,
        rms_after: after,
        p_value,
        held_out_gain: gains.get(gains.len() / 2).copied().into_iter().collect(),
        logs: candidate.windows.iter().map(|w| w.log.clone()).collect(),
        margin,
        class: effect.class().name().to_string(),
        rivals: Vec::new(),
    }))
}

impl Session<'_> {
    /// Asks the other logs whether they have what is in some logs and not in others: one answer a log.
    pub(super) fn look_into_other_logs(&mut self) {
        for (k, coefficients) in self.coefficients().into_iter().enumerate() {
            if self.accepted[k].candidate.windows.is_empty() {
                continue;
            }
            let seen = {
                let a = &self.accepted[k];
                let effect = self.effects[a.effect].as_ref();
                let mut without = self.fit.residual_on(&self.other, &self.other_columns(&self.fit));
                let none: Vec<Vec<f64>> = vec![Vec::new(); self.other.dof()];
                let own = effect.columns(&Context::new(&self.other, &self.fit, &none), &a.candidate);
                own.iter().zip(&coefficients).for_each(|(column, c)| column.add_to(&mut without, *c));
                effect.seen_in(&Context::new(&self.other, &self.fit, &without), &a.candidate, &coefficients)
            };
            if let Some(seen) = seen {
                self.accepted[k].candidate = seen;
            }
        }
    }
}

/// Whether a log's error is out of all proportion.
fn odd(base: &Fit, other: &Data<'_>, residual: &[Vec<f64>]) -> bool {
    (0..other.logs.len()).any(|log| {
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
        !ratios.is_empty() && ratios.iter().sum::<f64>() / ratios.len() as f64 > ODD
    })
}

fn take_out(other: &mut Data<'_>, columns: &[Column], coefficients: &[f64]) {
    for (column, c) in columns.iter().zip(coefficients) {
        for (j, values) in &column.parts {
            other.joints[*j].torque.iter_mut().zip(values).for_each(|(t, v)| *t -= c * v);
        }
    }
}
