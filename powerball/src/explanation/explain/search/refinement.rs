//! Refinement: settings of accepted effects (velocities, ways, orders, time constants, powers, ends of
//! windows) once everything is in the model. When an effect was looked for, friction had bent to it, others
//! were missing, and the search was coarse.

use super::super::model::{Accepted, Model};
use super::super::study::Study;
use super::screen::{Screen, Trial};
use crate::explanation::effects::{Candidate, Context, Window};
use crate::logs::parallel;
use std::ops::Range;

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

/// Where an accepted effect fits better, with its trial there. `own` are the places of its columns.
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
        // What takes its setting from its own coefficient, or lies in some logs, is where it belongs
        // but for its ends.
        if !refines && candidate.windows.is_empty() {
            others.extend(other_settings(&context, &candidate, share));
        }
        let trials = parallel::map(&others, |c| screen.try_candidate(c));
        let tried = others.into_iter().zip(trials).filter_map(|(c, t)| Some((c, t?)));
        let least = best.score + study.rule().refinement_gain;
        match tried.max_by(|a, b| a.1.score.total_cmp(&b.1.score)) {
            Some((c, trial)) if trial.score > least => (candidate, best) = (c, trial),
            _ => break,
        }
    }
    (candidate != accepted.candidate).then_some((candidate, best))
}

/// The same effect with other settings: those near by, in the first round all.
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
