//! Candidates that cannot be true, asked the same questions: how often these very data say yes by chance.

use super::evidence::{Extent, evidence};
use super::rule;
use super::screen::{Screen, Trial, dot};
use crate::identification::estimate::Folds;
use crate::logs::parallel;
use crate::logs::regression::{Column, Data};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A shifted column that still looks like the unshifted one (a periodic motion) is no placebo.
const MOST_ALIKE: f64 = 0.4;

/// What placebos scored.
#[derive(Clone, Debug, Default)]
pub(super) struct Placebos {
    /// Their penalised scores.
    pub(super) scores: Vec<f64>,
    /// How many the rule accepted.
    pub(super) accepted: usize,
}

/// Shifts the columns of real trials in time within each recording and asks the rule about them.
#[must_use]
pub(super) fn placebos(
    screen: &Screen<'_>,
    trials: &[(&Trial, &[usize])],
    folds: &Folds,
    tests: f64,
    count: usize,
    seed: u64,
) -> Placebos {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let draws: Vec<(usize, f64)> =
        (0..count).map(|k| (k % trials.len().max(1), rng.random_range(0.15..0.85))).collect();
    let outcomes = parallel::map(&draws, |(which, fraction)| {
        let (trial, joints) = trials.get(*which)?;
        let columns: Vec<Column> =
            trial.columns.iter().map(|c| shifted(c, screen.context.data, *fraction)).collect();
        if trial.columns.iter().zip(&columns).any(|(a, b)| alike(a, b) > MOST_ALIKE) {
            return None;
        }
        let placebo = screen.try_columns(columns, 1.0)?;
        // The other path is not asked: a shifted column has no meaning there, so this is the stricter count.
        let mut found = evidence(screen, &placebo, joints, folds, Extent::Everywhere, None);
        found.path_gain = 1.0;
        Some((placebo.score, rule::refusal(&found, tests, false).is_none()))
    });
    let mut placebos = Placebos::default();
    for (score, accepted) in outcomes.into_iter().flatten() {
        placebos.scores.push(score);
        placebos.accepted += usize::from(accepted);
    }
    placebos
}

fn shifted(column: &Column, data: &Data<'_>, fraction: f64) -> Column {
    let shift = |(j, values): &(usize, Vec<f64>)| {
        let mut values = values.clone();
        for rows in &data.joints[*j].rows {
            let by = (fraction * rows.len() as f64) as usize;
            values[rows.clone()].rotate_left(by);
        }
        (*j, values)
    };
    Column { parts: column.parts.iter().map(shift).collect() }
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
        let column = |f: &dyn Fn(f64) -> f64| Column::on(0, (0..1000).map(|k| f(f64::from(k))).collect());
        // Filters leave a constant with rounding.
        let constant = column(&|k| 1.0 + 1e-12 * (k * 0.7).sin());
        assert_eq!(alike(&constant, &column(&|k| 1.0 - 1e-12 * (k * 0.7).cos())), 1.0);
        let wave = column(&|k| 3.0 + (k * 0.1).sin());
        assert!(alike(&wave, &wave) > 0.999);
        assert!(alike(&wave, &column(&|k| 3.0 + (k * 0.1).cos())).abs() < 0.1);
    }
}
