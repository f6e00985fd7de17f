//! Backward elimination: effects that later additions made unnecessary are removed.
//!
//! The module also judges the effects that are in the model from the start, and refines settings once
//! everything is in the model.

use super::super::model::{Accepted, Model, Origin};
use super::super::study::Study;
use super::cross_validation::CrossValidation;
use super::evidence::{Evidence, Extent, evidence};
use super::screen::Screen;
use crate::effects::{self, Candidate, Context, Placed, Window};
use powerball_identification::estimate::{Design, friction_columns};
use powerball_identification::evidence::{Rows, Trial, log_change};
use powerball_logs::parallel;
use powerball_logs::vector::dot;
use std::ops::Range;
use std::{mem, slice};

/// Removes one effect after the other, the weakest first, until every score is sufficient. If an effect
/// contains a term that every arm may have, and the other terms are not sufficient, only that term stays: a
/// spring whose rest lies far outside the travel is the zero of a torque sensor.
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
        if gain - rule.penalty(rest.len(), a.candidate.searched) < rule.least_score {
            return Some((k, part.clone()));
        }
    }
    None
}

/// The accepted effect whose score is least, where that is not enough.
fn weakest(study: &Study<'_>, model: &Model) -> Option<usize> {
    let rule = study.rule();
    let mut weakest: Option<(usize, f64)> = None;
    // Effects that are in the model from the start stay until everything else is known.
    let found = model.accepted.iter().enumerate().zip(gains(model)).filter(|((_, a), _)| !a.is_baseline());
    for ((k, a), gain) in found {
        let score = gain - rule.penalty(a.columns(), a.candidate.searched);
        if score < rule.least_score && weakest.is_none_or(|(_, w)| score < w) {
            weakest = Some((k, score));
        }
    }
    weakest.map(|(k, _)| k)
}

/// By how much χ² is less with each accepted effect than without it, all else fitted again.
pub(crate) fn gains(model: &Model) -> Vec<f64> {
    let columns: Vec<Vec<usize>> = model.places().into_iter().map(Iterator::collect).collect();
    falls(model, &columns)
}

/// Like [`gains`], for sets of columns.
fn falls(model: &Model, sets: &[Vec<usize>]) -> Vec<f64> {
    let normal = model.fit.normal_equations();
    let error = |without: &dyn Fn(usize) -> bool| {
        let theta = normal.solver(|c| model.fit.free[c] && !without(c)).solve(&normal.right);
        normal.square - dot(&theta, &normal.right)
    };
    let full = error(&|_| false);
    sets.iter().map(|columns| error(&|c| columns.contains(&c)) - full).collect()
}

// Effects that are in the model from the start: which of them are needed once everything else is known.

/// The evidence for a part of the model, with everything else refitted.
struct Needed {
    /// The part's place among what was accepted.
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

/// Removes effects that were in the model from the start and are not needed, the least needed first, each
/// judged with everything else in the model. An effect is needed if the fitted logs demand it. If a model
/// fits badly, its residual is slow and demands little by itself; the removed effects together must then not
/// raise the errors of logs that were not fitted, both ways round.
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
                // It cannot be distinguished from the rest.
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
    let validation = Rows { data: &study.validation, design: &design, residual: &on_validation };
    let set = Some((&validation, columns.as_slice()));
    let mut evidence = evidence(&screen, &trial, &candidate.joints, &study.folds, Extent::Everywhere, set);
    let cross_validation = CrossValidation::new(study, model, Some(place));
    let back = cross_validation.ask(study, &screen, (candidate, &trial, evidence.validation_gain));
    let mut rise = [-log_change(&validation, (&trial, &columns)), 0.0];
    if let Some(back) = back {
        evidence.p_value = evidence.p_value.min(back.p_value);
        rise[1] = -back.log_change;
    }
    Some(Needed { place, evidence, rise })
}

// Refinement: settings of accepted effects (velocities, ways, orders, time constants, powers, ends of
// windows) once everything is in the model. When an effect was looked for, friction had bent to it, others
// were missing, and the search was coarse.

/// Each round looks nearer than the one before it.
const ROUNDS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// Moves of a setting in one round at most.
const MOVES: usize = 6;
/// How far an end of a window is moved in the first round, s: blocks in which a payload's start is looked for
/// are 2 s long.
const ENDS: [f64; 3] = [0.4, 0.8, 1.6];

/// An accepted effect elsewhere: its place, its candidate and how many columns that has.
type Moved = (usize, Candidate, usize);

/// Moves the settings to where all data fit best. Names, joints and logs stay.
pub(crate) fn refine(study: &Study<'_>, model: &mut Model) {
    for share in ROUNDS {
        let moved: Vec<Moved> = (model.accepted.iter().zip(model.coefficients()).zip(model.places()))
            .enumerate()
            .filter_map(|(k, ((a, coefficients), own))| {
                let (candidate, trial) = moved(study, model, a, &coefficients, own, share)?;
                Some((k, candidate, trial.columns.len()))
            })
            .collect();
        if moved.is_empty() {
            continue;
        }
        let weights = model.fit.weights.clone();
        let error = |model: &Model| model.fit.residual.weighted_square(&weights);
        let (before, old) = (error(model), model.accepted.clone());
        for (k, candidate, columns) in moved {
            model.accepted[k].replace(candidate, columns);
        }
        model.refit(study);
        // Moved together they may disturb each other.
        if error(model) > before {
            model.accepted = old;
            model.refit(study);
        }
    }
}

/// The settings with which an accepted effect fits better, with its trial there. `own` are the places of its
/// columns.
fn moved(
    study: &Study<'_>,
    model: &Model,
    accepted: &Accepted,
    coefficients: &[f64],
    own: Range<usize>,
    share: f64,
) -> Option<(Candidate, Trial)> {
    let effect = accepted.effect();
    let mut without = model.fit.residual.clone();
    let columns = model.context(study).columns(&accepted.candidate);
    without.add(&columns, coefficients);
    let context = study.on_fitted(&model.fit, &without);
    let screen = Screen::without(&context, own);
    let mut candidate = accepted.candidate.clone();
    let mut best = screen.try_candidate(&candidate)?;
    let refines = effect.refined(&candidate, coefficients).is_some();
    for _ in 0..MOVES {
        let fitted = |w: &Window| study.data.logs.contains(&w.log);
        let mut others: Vec<Candidate> = moved_ends(&candidate.windows, fitted, share)
            .map(|windows| Candidate { windows, ..candidate.clone() })
            .collect();
        // An effect that takes its setting from its own coefficient, or that lies in some logs, needs no
        // other setting, except for its ends.
        if !refines && candidate.windows.is_empty() {
            others.extend(other_settings(&context, &candidate, share));
        }
        let trials = parallel::map(&others, |c| screen.try_candidate(c));
        let tried = others.into_iter().zip(trials).filter_map(|(c, t)| Some((c, t?)));
        let least = best.score + 0.5 * study.rule().per_coefficient;
        match tried.max_by(|a, b| a.1.score.total_cmp(&b.1.score)) {
            Some((c, trial)) if trial.score > least => (candidate, best) = (c, trial),
            _ => break,
        }
    }
    (candidate != accepted.candidate).then_some((candidate, best))
}

/// A candidate's effect with other settings: those near by, in the first round all.
fn other_settings(context: &Context<'_>, candidate: &Candidate, share: f64) -> Vec<Candidate> {
    let effect = candidate.effect();
    let mut others = effect.neighbours(candidate, share);
    if share == ROUNDS[0] {
        let alike = |c: &Candidate| c.joints == candidate.joints && c.excludes(candidate);
        others.extend(effect.candidates(context).into_iter().filter(alike));
    }
    for other in &mut others {
        other.searched = candidate.searched;
    }
    others
}

/// Windows of which one of those that may move has one end elsewhere.
fn moved_ends<'w>(
    windows: &'w [Window],
    may: impl Fn(&Window) -> bool + 'w,
    share: f64,
) -> impl Iterator<Item = Vec<Window>> + 'w {
    let ways = ENDS.iter().flat_map(move |way| [way * share, -way * share]);
    let free = (0..windows.len()).filter(move |w| may(&windows[*w]));
    let ends = free.flat_map(|w| [(w, true), (w, false)]);
    ends.flat_map(move |end| ways.clone().map(move |way| (end, way))).filter_map(|((w, start), way)| {
        let mut moved = windows.to_vec();
        let end = if start { &mut moved[w].from } else { &mut moved[w].to };
        *end += way;
        (end.is_finite() && moved[w].from < moved[w].to).then_some(moved)
    })
}
