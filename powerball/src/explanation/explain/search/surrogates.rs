//! Surrogates: candidates shifted in time, or with the signs of recordings drawn, that cannot be true, asked the same questions. They tell how often these
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
use crate::logs::parallel;
use crate::logs::regression::{Column, JointRows};
use crate::logs::vector::dot;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;
use std::sync::Arc;

/// Draws the final surrogates; a step draws by its number.
const FINAL_SEED: u64 = 99;

/// What surrogates scored.
#[derive(Clone, Debug, Default)]
struct Surrogates {
    /// Their penalised scores.
    scores: Vec<f64>,
    /// How many the rule accepted.
    accepted: usize,
    /// How many draws had none: as they are drawn, they would be what they are drawn from.
    without: usize,
}

/// The penalised scores of surrogates of these trials.
#[must_use]
pub(crate) fn scores(screen: &Screen<'_>, trials: &[&Trial], count: usize, seed: u64) -> Vec<f64> {
    draw(screen, trials, count, seed, |_, _| false).scores
}

/// Draws surrogates of real trials and asks each whether it is accepted.
fn draw(
    screen: &Screen<'_>,
    trials: &[&Trial],
    count: usize,
    seed: u64,
    accepts: impl Fn(usize, &Trial) -> bool + Sync,
) -> Surrogates {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let recordings = screen.context.data.joints.iter().map(|j| j.rows.len()).max().unwrap_or(0);
    let draws: Vec<(usize, f64, Vec<f64>)> = (0..count)
        .map(|k| {
            let fraction = rng.random_range(0.15..0.85);
            // The first keeps its sign, since a column with all of them turned is the same column.
            let sign = |r: usize| if r > 0 && rng.random_bool(0.5) { -1.0 } else { 1.0 };
            (k % trials.len().max(1), fraction, (0..recordings).map(sign).collect())
        })
        .collect();
    let limit = screen.context.rule.surrogate_correlation;
    let outcomes = parallel::map(&draws, |(which, fraction, signs)| {
        let trial = trials.get(*which)?;
        let columns = surrogate(&trial.columns, &screen.context.data.joints, limit, *fraction, signs)?;
        let surrogate = screen.try_columns(columns, 1.0)?;
        Some((surrogate.score, accepts(*which, &surrogate)))
    });
    let mut surrogates = Surrogates::default();
    for outcome in outcomes {
        match outcome {
            Some((score, accepted)) => {
                surrogates.scores.push(score);
                surrogates.accepted += usize::from(accepted);
            }
            None => surrogates.without += 1,
        }
    }
    surrogates
}

/// Columns that cannot be true: shifted in time within each recording. Where a shift leaves one of them what it was
/// (a constant torque, a wave of this very period), the signs of the recordings are drawn as well, the same
/// for all columns. Neither helps a constant in a single recording: it has no surrogate.
fn surrogate(
    columns: &[Column],
    joints: &[JointRows],
    limit: f64,
    fraction: f64,
    signs: &[f64],
) -> Option<Vec<Column>> {
    let shifted: Vec<Column> = columns.iter().map(|c| shifted(c, joints, fraction)).collect();
    if !columns.iter().zip(&shifted).any(|(a, b)| alike(a, b) > limit) {
        return Some(shifted);
    }
    let turned: Vec<Column> = shifted.iter().map(|c| turned(c, joints, signs)).collect();
    (!columns.iter().zip(&turned).any(|(a, b)| cosine(a, b).abs() > limit)).then_some(turned)
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
    let accepts = |which: usize, trial: &Trial| {
        // The validation set is not asked: a surrogate has no meaning there, so this is the stricter count.
        let joints = trials[which].1;
        let mut found = evidence(&screen, trial, joints, &study.folds, Extent::Everywhere, None);
        found.validation_gain = 1.0;
        refusal(rule, &found, tests, false).is_none()
    };
    let drawn: Vec<&Trial> = trials.iter().map(|(trial, _)| *trial).collect();
    let found = draw(&screen, &drawn, rule.final_surrogates, FINAL_SEED, accepts);
    let surrogates = found.scores.len();
    FalsePositives {
        surrogates,
        accepted: found.accepted,
        without: found.without,
        rate: found.accepted as f64 / surrogates.max(1) as f64,
        family_wise: rule.family_wise,
    }
}

fn shifted(column: &Column, joints: &[JointRows], fraction: f64) -> Column {
    let shift =
        |(j, values): &(usize, Arc<Vec<f64>>)| (*j, rotated(values, &joints[*j].rows, fraction).into());
    Column { parts: column.parts.iter().map(shift).collect() }
}

/// A column with the sign of each recording turned or not.
fn turned(column: &Column, joints: &[JointRows], signs: &[f64]) -> Column {
    let turn = |(j, values): &(usize, Arc<Vec<f64>>)| {
        let mut values = values.to_vec();
        for (rows, sign) in joints[*j].rows.iter().zip(signs) {
            values[rows.clone()].iter_mut().for_each(|v| *v *= sign);
        }
        (*j, values.into())
    };
    Column { parts: column.parts.iter().map(turn).collect() }
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

/// Cosine of the angle between two columns, means and all.
fn cosine(a: &Column, b: &Column) -> f64 {
    let of = |x: &Column, y: &Column| -> f64 {
        x.parts.iter().zip(&y.parts).map(|((_, x), (_, y))| dot(x, y)).sum()
    };
    of(a, b) / (of(a, a) * of(b, b)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::signal::Band;

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

    /// A constant is what it was wherever it is shifted to: with two recordings its signs are drawn, with one it
    /// has no surrogate; a wave is shifted, and no sign is touched.
    #[test]
    fn a_constant_has_surrogates_where_there_are_two_recordings() {
        let rows = |rows: Vec<Range<usize>>| JointRows {
            torque: vec![0.0; 1000],
            inertial: Vec::new(),
            kept: Vec::new(),
            rows,
            band: Band::new(10.0, 200.0),
        };
        let (one, two) = ([rows(std::iter::once(0..1000).collect())], [rows(vec![0..500, 500..1000])]);
        let (constant, signs) = (vec![Column::on(0, vec![2.0; 1000])], [1.0, -1.0]);
        assert!(surrogate(&constant, &one, 0.9, 0.3, &signs[..1]).is_none());
        assert!(surrogate(&constant, &two, 0.9, 0.3, &[1.0, 1.0]).is_none());
        let drawn = surrogate(&constant, &two, 0.9, 0.3, &signs).unwrap();
        assert_eq!(drawn[0].at(0).unwrap()[499..501], [2.0, -2.0]);
        let wave: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.1).sin()).collect();
        let drawn = surrogate(&[Column::on(0, wave.clone())], &two, 0.9, 0.3, &signs).unwrap();
        assert_eq!(drawn[0].at(0).unwrap()[500], wave[650]);
    }
}
