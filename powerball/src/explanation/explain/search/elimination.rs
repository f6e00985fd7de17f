//! Backward elimination: what later additions made unneeded goes out again.

use super::super::model::Model;
use super::super::study::Study;
use super::screen::penalty;
use crate::explanation::effects::{self, Candidate, Placed};
use crate::identification::estimate::Solver;
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
            accepted.columns = 1;
            accepted.step = None;
            let whole = mem::replace(&mut accepted.candidate, part);
            model.given_up.push(whole);
        } else {
            return;
        }
        model.refit(study);
    }
}

/// The place of an accepted effect of which only a part is needed, one that a model may have from the start
/// (see [`Effect::baseline`](effects::Effect::beside)), and that part.
fn more_than_needed(study: &Study<'_>, model: &Model) -> Option<(usize, Candidate)> {
    let rule = study.rule();
    let context = model.context(study);
    let laws = |c: &Candidate| c.effect().placed_laws(&context, c);
    let parts: Vec<(Candidate, Vec<Placed>)> = (effects::all().iter())
        .flat_map(|effect| effect.baseline(&context))
        .filter_map(|part| Some((part.clone(), laws(&part).pop()?)))
        .collect();
    let found = model.accepted.iter().zip(model.places()).enumerate().filter(|(_, (a, _))| a.step.is_some());
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
    let found = model.accepted.iter().enumerate().zip(gains(model)).filter(|((_, a), _)| a.step.is_some());
    for ((k, a), gain) in found {
        let score = gain - penalty(rule, a.columns, a.candidate.searched);
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
    let (gram, right, square) = model.fit.gram.fitted(&model.fit.weights, |_| true);
    let error = |without: &dyn Fn(usize) -> bool| {
        let theta = Solver::new(&gram, |c| model.fit.free[c] && !without(c)).solve(&right);
        square - dot(&theta, &right)
    };
    let full = error(&|_| false);
    sets.iter().map(|columns| error(&|c| columns.contains(&c)) - full).collect()
}
