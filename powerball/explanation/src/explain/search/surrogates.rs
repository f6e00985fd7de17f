//! Surrogates: candidates shifted in time, or with the signs of recordings drawn, that cannot be true and
//! pass through the same tests. They show how often these data accept a candidate by chance.

use super::super::model::Model;
use super::super::named::FalsePositives;
use super::super::study::Study;
use super::evidence::{Extent, evidence, refusal};
use super::groups::{CandidateKind, groups};
use super::screen::Screen;
use crate::effects::{Context, Effect};
use powerball_controller::JointNumber;
use powerball_identification::evidence::{Chance, Surrogate, Trial, draw, rotated, shifted};
use powerball_logs::parallel;
use powerball_logs::regression::Signals;

/// Draws the final surrogates; a step draws by its number.
const FINAL_SEED: u64 = 99;

/// The score that trials must exceed to be distinguished from chance: that of most of their surrogates. A
/// push that is shifted in time may fall onto another one: most surrogates of a short event must score less,
/// not all.
#[must_use]
pub(crate) fn level_by_chance(screen: &Screen<'_>, trials: &[&Trial], short: bool, seed: u64) -> f64 {
    let rule = screen.context.rule;
    let draws = draw(&screen.base, trials, (rule.surrogates, rule.surrogate_correlation), seed);
    let share = if short { rule.event_surrogate_level } else { 1.0 - rule.family_wise };
    Chance::new(draws.into_iter().flatten().map(|s| s.score).collect()).level(share)
}

/// The score that the search of an effect for the logs and times that it is in exceeds by chance alone: its
/// best candidate where the residual is shifted in time within each recording. What was looked for over many
/// windows is compared with what is found over as many.
#[must_use]
pub(crate) fn level_of_search(context: &Context<'_>, effect: &dyn Effect, seed: u64) -> f64 {
    let rule = context.rule;
    let chance = Chance::of_search(rule.searched_surrogates(), seed, |shift| {
        let residual: Signals = (context.residual.iter().zip(&context.data.joints))
            .map(|(values, joint)| rotated(values, &joint.rows, shift))
            .collect();
        let context = context.seen_with(&residual);
        let screen = Screen::new(&context);
        let candidates = effect.candidates(&context);
        let scores = candidates.iter().filter_map(|c| Some(screen.try_candidate(c)?.score));
        scores.fold(0.0, f64::max)
    });
    chance.level(1.0 - rule.family_wise)
}

/// Asks surrogates of every kind on the final residual: where nothing is missing any more, what passes is
/// chance.
pub(crate) fn false_positives(study: &Study<'_>, model: &Model) -> FalsePositives {
    let context = model.context(study);
    let screen = Screen::new(&context);
    let (groups, tests) = groups(study, model, &screen, CandidateKind::Names);
    let trials: Vec<(&Trial, &[JointNumber])> = groups
        .iter()
        .flat_map(|f| &f.members)
        .filter(|m| m.candidate.windows.is_empty())
        .map(|m| (&m.trial, m.candidate.joints.as_slice()))
        .collect();
    let rule = study.rule();
    let accepts = |surrogate: &Surrogate| {
        // The validation set is not asked: a surrogate has no meaning there, so this is the stricter count.
        let (trial, joints) = trials[surrogate.which];
        let columns = trial.columns.iter().map(|c| shifted(c, &screen.context.data.joints, &surrogate.shift));
        screen.base.ask(columns.collect(), 1.0).is_some_and(|trial| {
            let mut found = evidence(&screen, &trial, joints, &study.folds, Extent::Everywhere, None);
            found.validation_gain = 1.0;
            refusal(rule, &found, tests, false).is_none()
        })
    };
    let drawn: Vec<&Trial> = trials.iter().map(|(trial, _)| *trial).collect();
    let draws = draw(&screen.base, &drawn, (rule.surrogates, rule.surrogate_correlation), FINAL_SEED);
    let found: Vec<&Surrogate> = draws.iter().flatten().collect();
    // A candidate that scores too little is refused by that alone.
    let high: Vec<&Surrogate> = found.iter().copied().filter(|s| s.score >= rule.least_score).collect();
    let accepted = parallel::map(&high, |surrogate| accepts(surrogate)).into_iter().filter(|a| *a).count();
    let surrogates = found.len();
    FalsePositives {
        surrogates,
        accepted,
        without: draws.len() - surrogates,
        rate: accepted as f64 / surrogates.max(1) as f64,
        family_wise: rule.family_wise,
    }
}
