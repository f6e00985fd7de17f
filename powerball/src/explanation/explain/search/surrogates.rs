//! Surrogates: candidates shifted in time, or with the signs of recordings drawn, that cannot be true, asked the same
//! questions. They tell how often these very data say yes by chance.

use super::super::model::Model;
use super::super::named::FalsePositives;
use super::super::study::Study;
use super::evidence::{Extent, evidence};
use super::groups::{CandidateKind, groups};
use super::refusal::refusal;
use super::screen::{Products, Screen, Trial};
use super::shifts::{Shift, products, unlike};
use crate::controller::JointNumber;
use crate::explanation::effects::{Context, Effect};
use crate::logs::parallel;
use crate::logs::regression::{Column, JointRows};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;
use std::sync::Arc;

/// Draws the final surrogates; a step draws by its number.
const FINAL_SEED: u64 = 99;

/// A surrogate: of which trial, how it was made, and what it scores.
struct Surrogate {
    which: usize,
    shift: Shift,
    score: f64,
}

/// The score that trials must exceed to be told from chance: that of most of their surrogates. A push that is shifted in
/// time may fall onto another one: of what is short, most must score less, not all.
#[must_use]
pub(crate) fn level_by_chance(screen: &Screen<'_>, trials: &[&Trial], short: bool, seed: u64) -> f64 {
    let rule = screen.context.rule;
    let draws = draw(screen, trials, rule.step_surrogates, seed);
    let share = if short { rule.event_surrogate_level } else { rule.surrogate_level };
    exceeded(draws.into_iter().flatten().map(|s| s.score).collect(), share)
}

/// What a share of some scores stays below.
fn exceeded(mut scores: Vec<f64>, share: f64) -> f64 {
    scores.sort_by(f64::total_cmp);
    scores.get((scores.len() as f64 * share) as usize).copied().unwrap_or(0.0)
}

/// Draws surrogates of real trials; `None` for one that would be what it is drawn from.
///
/// Columns are shifted in time within each recording. Where a shift leaves one of them what it was (a constant
/// torque, a wave of this very period), the signs of the recordings are drawn as well, the same for all columns.
/// Neither helps a constant in a single recording: it has no surrogate.
fn draw(screen: &Screen<'_>, trials: &[&Trial], count: usize, seed: u64) -> Vec<Option<Surrogate>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let recordings = screen.context.data.joints.iter().map(|j| j.rows.len()).max().unwrap_or(0);
    let mut by_trial: Vec<Vec<Shift>> = vec![Vec::new(); trials.len()];
    for k in 0..count {
        let fraction = rng.random_range(0.15..0.85);
        // The first keeps its sign, since a column with all of them turned is the same column.
        let sign = |r: usize| if r > 0 && rng.random_bool(0.5) { -1.0 } else { 1.0 };
        let shift = Shift { fraction, signs: (0..recordings).map(sign).collect() };
        if let Some(of_trial) = by_trial.get_mut(k % trials.len().max(1)) {
            of_trial.push(shift);
        }
    }
    let limit = screen.context.rule.surrogate_correlation;
    let of_trial = |(which, shifts): (usize, Vec<Shift>)| {
        let columns = &trials[which].columns;
        let unlike = unlike(columns, &screen.context.data.joints, &shifts, limit);
        let mut outcomes: Vec<Option<Surrogate>> =
            unlike.iter().filter(|shift| shift.is_none()).map(|_| None).collect();
        let shifts: Vec<Shift> = unlike.into_iter().flatten().collect();
        let asked: Vec<(Shift, Products)> =
            shifts.iter().cloned().zip(products(screen, columns, &shifts)).collect();
        outcomes.extend(parallel::map(&asked, |(shift, products)| {
            let score = screen.solve(products, 1.0)?.score;
            Some(Surrogate { which, shift: shift.clone(), score })
        }));
        outcomes
    };
    by_trial.into_iter().enumerate().flat_map(of_trial).collect()
}

/// The score that the search of an effect for the logs and times that it is in exceeds by chance alone: its best
/// candidate where the residual is shifted in time within each recording. What was looked for over many windows is
/// compared with what is found over as many.
#[must_use]
pub(crate) fn level_of_search(context: &Context<'_>, effect: &dyn Effect, seed: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let shift = |rng: &mut ChaCha8Rng| Shift { fraction: rng.random_range(0.15..0.85), signs: Vec::new() };
    let shifts: Vec<Shift> = (0..context.rule.searched_surrogates).map(|_| shift(&mut rng)).collect();
    let scores = parallel::map(&shifts, |shift| {
        let residual: Vec<Vec<f64>> = (context.residual.iter().enumerate())
            .map(|(j, values)| rotated(values, &context.data.joints[j].rows, shift))
            .collect();
        let context = context.seen_with(&residual);
        let screen = Screen::new(&context);
        let candidates = effect.candidates(&context);
        let scores = candidates.iter().filter_map(|c| Some(screen.try_candidate(c)?.score));
        scores.fold(0.0, f64::max)
    });
    exceeded(scores, context.rule.surrogate_level)
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
        screen.try_columns(columns.collect(), 1.0).is_some_and(|trial| {
            let mut found = evidence(&screen, &trial, joints, &study.folds, Extent::Everywhere, None);
            found.validation_gain = 1.0;
            refusal(rule, &found, tests, false).is_none()
        })
    };
    let drawn: Vec<&Trial> = trials.iter().map(|(trial, _)| *trial).collect();
    let draws = draw(&screen, &drawn, rule.final_surrogates, FINAL_SEED);
    let found: Vec<&Surrogate> = draws.iter().flatten().collect();
    // What scores too little is refused by that alone.
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

/// A surrogate's column, row by row.
fn shifted(column: &Column, joints: &[JointRows], shift: &Shift) -> Column {
    let of = |(j, values): &(usize, Arc<Vec<f64>>)| {
        let mut values = rotated(values, &joints[*j].rows, shift);
        for (rows, sign) in joints[*j].rows.iter().zip(&shift.signs) {
            values[rows.clone()].iter_mut().for_each(|v| *v *= sign);
        }
        (*j, values.into())
    };
    Column { parts: column.parts.iter().map(of).collect() }
}

/// Values shifted within each recording, whose rows are given; what leaves at one end comes in at the other.
fn rotated(values: &[f64], recordings: &[Range<usize>], shift: &Shift) -> Vec<f64> {
    let mut values = values.to_vec();
    for rows in recordings {
        values[rows.clone()].rotate_left(shift.rows(rows.len()));
    }
    values
}

#[cfg(all(test, feature = "virtual-arm"))]
mod tests {
    use super::super::super::initial_model::initial_model;
    use super::super::super::prepare::{Inertia, ValidationOnly, prepare};
    use super::super::super::tests::small_arms::planar_with_payload;
    use super::*;
    use crate::explanation::options::ExplainOptions;

    /// By correlations and row by row, columns on one joint and on two.
    #[test]
    fn the_products_of_a_surrogate_are_those_of_its_rows() {
        let (body, logs) = planar_with_payload();
        let (fit, validate) = logs.split_at(4);
        let options = ExplainOptions::default();
        let begun =
            prepare(&body, (fit, validate), &options, Inertia::Shared, ValidationOnly::TakenOut).unwrap();
        let model = initial_model(begun.base, &begun.study);
        let context = model.context(&begun.study);
        let screen = Screen::new(&context);
        let (groups, _) = groups(&begun.study, &model, &screen, CandidateKind::Names);
        let shifts = [(0.2, [1.0; 4]), (0.51, [1.0, -1.0, 1.0, -1.0]), (0.84, [1.0, 1.0, 1.0, -1.0])]
            .map(|(fraction, signs)| Shift { fraction, signs: signs.to_vec() });
        let close = |a: f64, b: f64, size: f64| assert!((a - b).abs() <= 1e-9 * size, "{a} {b} of {size}");
        let mut joints = [0; 2];
        for trial in groups.iter().flat_map(|g| &g.members).map(|m| &m.trial) {
            joints[trial.columns[0].parts.len() - 1] += 1;
            for (shift, fast) in shifts.iter().zip(products(&screen, &trial.columns, &shifts)) {
                let columns = trial.columns.iter().map(|c| shifted(c, &context.data.joints, shift));
                let slow = screen.products(&columns.collect::<Vec<_>>());
                for a in 0..trial.columns.len() {
                    let size = slow.square[(a, a)].sqrt();
                    let gram = &screen.context.fit.gram.fitted(&context.fit.weights, |_| true).0;
                    for (g, value) in slow.cross[a].iter().enumerate() {
                        close(fast.cross[a][g], *value, 1e-9 + size * gram[(g, g)].sqrt());
                    }
                    close(fast.square[(a, a)], slow.square[(a, a)], size * size);
                    let residual = (context.residual.iter().zip(&context.fit.weights))
                        .map(|(r, w)| w * r.iter().map(|v| v * v).sum::<f64>());
                    close(fast.score[a], slow.score[a], size * residual.sum::<f64>().sqrt());
                }
            }
        }
        assert!(joints.iter().all(|n| *n > 0), "{joints:?}");
    }
}
