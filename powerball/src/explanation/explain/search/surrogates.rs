//! Time-shift surrogates: candidates that cannot be true, asked the same questions. They tell how often these
//! very data say yes by chance.

use super::super::model::Model;
use super::super::named::FalsePositives;
use super::super::study::Study;
use super::evidence::{Extent, evidence};
use super::groups::{Among, groups};
use super::refusal::refusal;
use super::screen::{Screen, Trial};
use crate::controller::JointNumber;
use crate::explanation::effects::{Context, Effect};
use crate::identification::estimate::Folds;
use crate::logs::parallel;
use crate::logs::regression::{Column, Data};
use crate::logs::vector::dot;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;
use std::sync::Arc;

/// Draws the final surrogates; a step draws by its number.
const FINAL_SEED: u64 = 99;

/// What surrogates scored.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surrogates {
    /// Their penalised scores.
    pub(crate) scores: Vec<f64>,
    /// How many the rule accepted.
    pub(crate) accepted: usize,
}

/// Shifts the columns of real trials in time within each recording and asks the rule about them.
#[must_use]
pub(crate) fn surrogates(
    screen: &Screen<'_>,
    trials: &[(&Trial, &[JointNumber])],
    folds: &Folds,
    tests: f64,
    count: usize,
    seed: u64,
) -> Surrogates {
    let rule = screen.context.rule;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let draws: Vec<(usize, f64)> =
        (0..count).map(|k| (k % trials.len().max(1), rng.random_range(0.15..0.85))).collect();
    let outcomes = parallel::map(&draws, |(which, fraction)| {
        let (trial, joints) = trials.get(*which)?;
        let columns: Vec<Column> =
            trial.columns.iter().map(|c| shifted(c, screen.context.data, *fraction)).collect();
        if trial.columns.iter().zip(&columns).any(|(a, b)| alike(a, b) > rule.surrogate_correlation) {
            return None;
        }
        let surrogate = screen.try_columns(columns, 1.0)?;
        // The validation set is not asked: a shifted column has no meaning there, so this is the stricter
        // count.
        let mut found = evidence(screen, &surrogate, joints, folds, Extent::Everywhere, None);
        found.validation_gain = 1.0;
        Some((surrogate.score, refusal(rule, &found, tests, false).is_none()))
    });
    let mut surrogates = Surrogates::default();
    for (score, accepted) in outcomes.into_iter().flatten() {
        surrogates.scores.push(score);
        surrogates.accepted += usize::from(accepted);
    }
    surrogates
}

/// What the search of an effect for the logs and times that it is in reaches by chance: the best score among its
/// candidates where the residual is shifted in time within each recording. What was looked for over many windows
/// is compared with what is found over as many.
#[must_use]
pub(crate) fn searched_again(
    context: &Context<'_>,
    effect: &dyn Effect,
    count: usize,
    seed: u64,
) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let fractions: Vec<f64> = (0..count).map(|_| rng.random_range(0.15..0.85)).collect();
    parallel::map(&fractions, |fraction| {
        let residual: Vec<Vec<f64>> = (context.residual.iter().enumerate())
            .map(|(j, values)| rotated(values, &context.data.joints[j].rows, *fraction))
            .collect();
        let context = context.seen_with(&residual);
        let screen = Screen::new(&context);
        let candidates = effect.candidates(&context);
        let scores = candidates.iter().filter_map(|c| Some(screen.try_candidate(c)?.score));
        scores.fold(0.0, f64::max)
    })
}

/// Asks surrogates of every kind on the final residual: where nothing is missing any more, what passes is
/// chance.
pub(crate) fn false_positives(study: &Study<'_>, model: &Model) -> FalsePositives {
    let context = model.context(study);
    let screen = Screen::new(&context);
    let (groups, tests) = groups(study, model, &screen, Among::Names);
    let trials: Vec<(&Trial, &[JointNumber])> = groups
        .iter()
        .flat_map(|f| &f.members)
        .filter(|m| m.candidate.windows.is_empty())
        .map(|m| (&m.trial, m.candidate.joints.as_slice()))
        .collect();
    let rule = study.rule();
    let found = surrogates(&screen, &trials, &study.folds, tests, rule.final_surrogates, FINAL_SEED);
    let surrogates = found.scores.len();
    FalsePositives {
        surrogates,
        accepted: found.accepted,
        rate: found.accepted as f64 / surrogates.max(1) as f64,
        family_wise: rule.family_wise,
    }
}

fn shifted(column: &Column, data: &Data<'_>, fraction: f64) -> Column {
    let shift =
        |(j, values): &(usize, Arc<Vec<f64>>)| (*j, rotated(values, &data.joints[*j].rows, fraction).into());
    Column { parts: column.parts.iter().map(shift).collect() }
}

/// Values shifted by a share of each recording, whose rows are given; what leaves at one end comes in at the
/// other.
fn rotated(values: &[f64], recordings: &[Range<usize>], fraction: f64) -> Vec<f64> {
    let mut values = values.to_vec();
    for rows in recordings {
        values[rows.clone()].rotate_left((fraction * rows.len() as f64) as usize);
    }
    values
}

/// Correlation of two columns. One that hardly changes (a constant torque) is the same wherever it is shifted
/// to.
fn alike(a: &Column, b: &Column) -> f64 {
    let (mut cross, mut left, mut right, mut size) = (0.0, 0.0, 0.0, 0.0);
    for ((_, x), (_, y)) in a.parts.iter().zip(&b.parts) {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len().max(1) as f64;
        let (mx, my) = (mean(x), mean(y));
        cross += dot(x, y) - mx * my * x.len() as f64;
        left += dot(x, x) - mx * mx * x.len() as f64;
        right += dot(y, y) - my * my * y.len() as f64;
        size += dot(x, x) + dot(y, y);
    }
    if left.min(right) > 1e-6 * size { cross / (left * right).sqrt() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_changes_no_constant_and_a_wave_is_like_itself() {
        let column =
            |f: &dyn Fn(f64) -> f64| Column::on(0, (0..1000).map(|k| f(f64::from(k))).collect::<Vec<f64>>());
        // Filters leave a constant with rounding.
        let constant = column(&|k| 1.0 + 1e-12 * (k * 0.7).sin());
        assert_eq!(alike(&constant, &column(&|k| 1.0 - 1e-12 * (k * 0.7).cos())), 1.0);
        let wave = column(&|k| 3.0 + (k * 0.1).sin());
        assert!(alike(&wave, &wave) > 0.999);
        assert!(alike(&wave, &column(&|k| 3.0 + (k * 0.1).cos())).abs() < 0.1);
    }
}
