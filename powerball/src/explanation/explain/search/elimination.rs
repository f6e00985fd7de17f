//! Backward elimination: what later additions made unneeded goes out again.

use super::super::model::Model;
use super::super::study::Study;
use super::screen::penalty;
use crate::identification::estimate::Solver;
use crate::logs::vector::dot;

/// Takes out one effect after the other, the weakest first, until every score is enough.
pub(crate) fn eliminate(study: &Study<'_>, model: &mut Model) {
    while let Some(weakest) = weakest(study, model) {
        model.accepted.remove(weakest);
        model.refit(study);
    }
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
    let (gram, right, square) = model.fit.gram.fitted(&model.fit.weights, |_| true);
    let error = |without: &dyn Fn(usize) -> bool| {
        let theta = Solver::new(&gram, |c| model.fit.free[c] && !without(c)).solve(&right);
        square - dot(&theta, &right)
    };
    let full = error(&|_| false);
    model.places().into_iter().map(|columns| error(&|c| columns.contains(&c)) - full).collect()
}
