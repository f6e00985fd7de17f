//! Backward elimination: what later additions made unneeded goes out again.
//!
//! Also here: what is in the model from the start.

use super::super::model::{Model, Origin};
use super::super::study::Study;
use super::cross_validation::CrossValidation;
use super::evidence::{Evidence, Extent, Validation, evidence, log_change};
use super::screen::{Screen, penalty};
use crate::explanation::effects::{self, Candidate, Placed};
use crate::identification::estimate::{Design, friction_columns};
use crate::logs::vector::dot;
use std::{mem, slice};

/// Takes out one effect after the other, the weakest first, until every score is enough. Of an effect that
/// has in it what every arm may have, only that stays where the rest is not enough: a spring whose rest lies
/// far outside the travel is the zero of a torque sensor.
pub(crate) fn eliminate(study: &Study<'_>, model: &mut Model) {
    loop {
        if let Some(weakest) = weakest(study, model) {
            model.accepted.remove(weakest);
        } else if let Some((k, part)) = more_than_needed(study, model) {
            let accepted = &mut model.accepted[k];
            accepted.origin = Origin::Baseline { columns: 1 };
            let whole = mem::replace(&mut accepted.candidate, part);
            model.given_up.push(whole);
        } else {
            return;
        }
        model.refit(study);
    }
}

/// The place of an accepted effect of which only a part is needed, one that a model may have from the start
/// (see [`Effect::baseline`](effects::Effect::baseline)), and that part.
fn more_than_needed(study: &Study<'_>, model: &Model) -> Option<(usize, Candidate)> {
    let rule = study.rule();
    let context = model.context(study);
    let laws = |c: &Candidate| c.effect().placed_laws(&context, c);
    let parts: Vec<(Candidate, Vec<Placed>)> = (effects::all().iter())
        .flat_map(|effect| effect.baseline(&context))
        .filter_map(|part| Some((part.clone(), laws(&part).pop()?)))
        .collect();
    let found = model.accepted.iter().zip(model.places()).enumerate().filter(|(_, (a, _))| !a.is_baseline());
    for (k, (a, place)) in found {
        let whole = laws(&a.candidate);
        let Some((part, law)) = parts.iter().find(|(_, law)| whole.len() > 1 && whole.contains(law)) else {
            continue;
        };
        let rest: Vec<usize> =
            place.zip(&whole).filter(|(_, l)| *l != law).map(|(column, _)| column).collect();
        let gain = falls(model, slice::from_ref(&rest))[0];
        if gain - penalty(rule, rest.len(), a.candidate.searched) < rule.least_score {
            return Some((k, part.clone()));
        }
    }
    None
}

/// The accepted effect whose score is least, where that is not enough.
fn weakest(study: &Study<'_>, model: &Model) -> Option<usize> {
    let rule = study.rule();
    let mut weakest: Option<(usize, f64)> = None;
    // What is in the model from the start stays until everything else is known.
    let found = model.accepted.iter().enumerate().zip(gains(model)).filter(|((_, a), _)| !a.is_baseline());
    for ((k, a), gain) in found {
        let score = gain - penalty(rule, a.columns(), a.candidate.searched);
        if score < rule.least_score && weakest.is_none_or(|(_, w)| score < w) {
            weakest = Some((k, score));
        }
    }
    weakest.map(|(k, _)| k)
}

/// By how much χ² is less with each accepted effect than without it, all else fitted anew.
pub(crate) fn gains(model: &Model) -> Vec<f64> {
    let columns: Vec<Vec<usize>> = model.places().into_iter().map(Iterator::collect).collect();
    falls(model, &columns)
}

/// The same for sets of columns.
fn falls(model: &Model, sets: &[Vec<usize>]) -> Vec<f64> {
    let normal = model.fit.normal_equations();
    let error = |without: &dyn Fn(usize) -> bool| {
        let theta = normal.solver(|c| model.fit.free[c] && !without(c)).solve(&normal.right);
        normal.square - dot(&theta, &normal.right)
    };
    let full = error(&|_| false);
    sets.iter().map(|columns| error(&|c| columns.contains(&c)) - full).collect()
}

// What is in the model from the start: which of it is needed once everything else is known.

/// What speaks for a part of the model, everything else refitted.
struct Needed {
    /// Its place among what was accepted.
    place: usize,
    evidence: Evidence,
    /// By how much the logarithm of the squared error rises without it on logs that took no part in the fit,
    /// mean over joints: fitted to the logs, and fitted to the validation set.
    rise: [f64; 2],
}

impl Needed {
    /// The lesser rise of both ways round, after those of what went out before.
    fn rise_after(&self, before: [f64; 2]) -> f64 {
        (self.rise[0] + before[0]).min(self.rise[1] + before[1])
    }
}

/// Takes out of the model what was in it from the start and is not needed, what the logs demand least first, each
/// judged with everything else in the model. Needed is what the fitted logs demand. Where a model fits badly
/// its residual is slow and demands little by itself; what goes out must then not raise the errors of logs
/// that took no part in the fit, both ways round and all that went out together.
pub(crate) fn keep_needed(study: &Study<'_>, model: &mut Model) {
    let rule = study.rule();
    let mut risen = [0.0; 2];
    loop {
        let baseline: Vec<usize> =
            (0..model.accepted.len()).filter(|k| model.accepted[*k].is_baseline()).collect();
        let mut found: Vec<Needed> = Vec::new();
        let mut useless = None;
        for &place in &baseline {
            match needed(study, model, place) {
                Some(needed) => found.push(needed),
                // It cannot be told from the rest.
                None => useless = Some(place),
            }
        }
        let dispensable =
            |n: &&Needed| n.evidence.score < rule.least_score && n.rise_after(risen) < rule.least_gain;
        let least = found.iter().filter(dispensable);
        let least = least.min_by(|a, b| a.evidence.score.total_cmp(&b.evidence.score));
        if let (None, Some(least)) = (useless, least) {
            risen = [0, 1].map(|way| risen[way] + least.rise[way]);
        }
        let Some(out) = useless.or(least.map(|n| n.place)) else {
            for Needed { place, evidence, .. } in found {
                model.accepted[place].p_value = (evidence.p_value * baseline.len() as f64).min(1.0);
                model.accepted[place].fold_gain = evidence.median_gain();
            }
            return;
        };
        model.accepted.remove(out);
        model.refit(study);
    }
}

fn needed(study: &Study<'_>, model: &Model, place: usize) -> Option<Needed> {
    let (candidate, own) = (&model.accepted[place].candidate, model.places()[place].clone());
    let coefficients = &model.coefficients()[place];
    let mut residual = model.fit.residual.clone();
    let columns = model.context(study).columns(candidate);
    residual.add(&columns, coefficients);
    let context = study.on_fitted(&model.fit, &residual);
    let screen = Screen::without(&context, own);
    let trial = screen.try_candidate(candidate)?;
    let all = model.columns_on_validation(study);
    let mut on_validation = model.fit.residual_on(&study.validation, &all);
    let context = study.on_validation(&model.fit, &[]);
    let columns = context.columns(candidate);
    on_validation.add(&columns, coefficients);
    let design =
        Design::new(&study.validation, &friction_columns(&study.validation, &model.fit.shapes), &all);
    let validation = Validation { data: &study.validation, design, residual: on_validation };
    let set = Some((&validation, columns.as_slice()));
    let mut evidence = evidence(&screen, &trial, &candidate.joints, &study.folds, Extent::Everywhere, set);
    let swapped = CrossValidation::new(study, model, Some(place));
    let back = swapped.ask(study, &screen, (candidate, &trial, evidence.validation_gain));
    let mut rise = [-log_change(&screen, &trial, &validation, &columns), 0.0];
    if let Some(back) = back {
        evidence.p_value = evidence.p_value.min(back.p_value);
        rise[1] = -back.log_change;
    }
    Some(Needed { place, evidence, rise })
}
