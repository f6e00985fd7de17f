//! Surrogates: candidates shifted in time, or with the signs of recordings drawn, that cannot be true and
//! pass through the same tests. They show how often these data accept a candidate by chance.
//!
//! The module also shifts columns in time, thousands of times.

use super::super::model::Model;
use super::super::named::FalsePositives;
use super::super::study::Study;
use super::evidence::{Extent, evidence, refusal};
use super::groups::{CandidateKind, groups};
use super::screen::{Screen, Trial};
use crate::effects::{Context, Effect};
use chacha20::ChaCha8Rng;
use powerball_controller::JointNumber;
use powerball_identification::estimate::Added;
use powerball_logs::parallel;
use powerball_logs::regression::{Column, JointRows, Signals};
use rand::{RngExt, SeedableRng};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// Draws the final surrogates; a step draws by its number.
const FINAL_SEED: u64 = 99;

/// A surrogate: its trial, how it was made, and its score.
struct Surrogate {
    which: usize,
    shift: Shift,
    score: f64,
}

/// The score that trials must exceed to be distinguished from chance: that of most of their surrogates. A
/// push that is shifted in time may fall onto another one: most surrogates of a short event must score less,
/// not all.
#[must_use]
pub(crate) fn level_by_chance(screen: &Screen<'_>, trials: &[&Trial], short: bool, seed: u64) -> f64 {
    let rule = screen.context.rule;
    let draws = draw(screen, trials, rule.surrogates, seed);
    let share = if short { rule.event_surrogate_level } else { 1.0 - rule.family_wise };
    exceeded(draws.into_iter().flatten().map(|s| s.score).collect(), share)
}

/// The score below which a share of some scores stays.
fn exceeded(mut scores: Vec<f64>, share: f64) -> f64 {
    scores.sort_by(f64::total_cmp);
    scores.get((scores.len() as f64 * share) as usize).copied().unwrap_or(0.0)
}

/// Draws surrogates of real trials; `None` for one that would equal its original.
///
/// Columns are shifted in time within each recording. If a shift does not change one of them (a constant
/// torque, a wave of this very period), the signs of the recordings are drawn as well, the same for all
/// columns. Neither helps a constant in a single recording: it has no surrogate.
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
        let asked: Vec<(Shift, Added)> =
            shifts.iter().cloned().zip(products(screen, columns, &shifts)).collect();
        outcomes.extend(parallel::map(&asked, |(shift, products)| {
            let score = screen.solve(products, 1.0)?.score;
            Some(Surrogate { which, shift: shift.clone(), score })
        }));
        outcomes
    };
    by_trial.into_iter().enumerate().flat_map(of_trial).collect()
}

/// The score that the search of an effect for the logs and times that it is in exceeds by chance alone: its
/// best candidate where the residual is shifted in time within each recording. What was looked for over many
/// windows is compared with what is found over as many.
#[must_use]
pub(crate) fn level_of_search(context: &Context<'_>, effect: &dyn Effect, seed: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let shift = |rng: &mut ChaCha8Rng| Shift { fraction: rng.random_range(0.15..0.85), signs: Vec::new() };
    let shifts: Vec<Shift> = (0..context.rule.searched_surrogates()).map(|_| shift(&mut rng)).collect();
    let scores = parallel::map(&shifts, |shift| {
        let residual: Signals = (context.residual.iter().enumerate())
            .map(|(j, values)| rotated(values, &context.data.joints[j].rows, shift))
            .collect();
        let context = context.seen_with(&residual);
        let screen = Screen::new(&context);
        let candidates = effect.candidates(&context);
        let scores = candidates.iter().filter_map(|c| Some(screen.try_candidate(c)?.score));
        scores.fold(0.0, f64::max)
    });
    exceeded(scores, 1.0 - context.rule.family_wise)
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
    let draws = draw(&screen, &drawn, rule.surrogates, FINAL_SEED);
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

/// Values shifted within each recording, whose rows are given; values that leave at one end enter at the
/// other.
fn rotated(values: &[f64], recordings: &[Range<usize>], shift: &Shift) -> Vec<f64> {
    let mut values = values.to_vec();
    for rows in recordings {
        values[rows.clone()].rotate_left(shift.rows(rows.len()));
    }
    values
}

// Columns shifted in time, thousands of times: their products with the base and with the residual are
// circular cross-correlations, which one Fourier transform a column gives for all shifts.

/// How columns are changed into some that cannot be true.
#[derive(Clone, Debug)]
pub(super) struct Shift {
    /// Shift as a share of each recording.
    pub(super) fraction: f64,
    /// By recording, 1 or −1.
    pub(super) signs: Vec<f64>,
}

impl Shift {
    /// Rows of a recording of `n` by which it is shifted.
    pub(super) fn rows(&self, n: usize) -> usize {
        (self.fraction * n as f64) as usize
    }
}

/// The surrogate of each shift: without signs if the shift alone makes the columns different from the
/// original ones, with signs if these are needed (a constant torque, a wave of this very period), `None`
/// where neither helps. `limit` is the largest correlation of a surrogate with its original.
pub(super) fn unlike(
    columns: &[Column],
    joints: &[JointRows],
    shifts: &[Shift],
    limit: f64,
) -> Vec<Option<Shift>> {
    let by_column = parallel::map(columns, |column| likeness(column, joints, shifts));
    let plain = |shift: &Shift| Shift { fraction: shift.fraction, signs: vec![1.0; shift.signs.len()] };
    let of = |(s, shift): (usize, &Shift)| {
        if by_column.iter().all(|c| c[s].correlation <= limit) {
            Some(plain(shift))
        } else {
            by_column.iter().all(|c| c[s].cosine.abs() <= limit).then(|| shift.clone())
        }
    };
    shifts.iter().enumerate().map(of).collect()
}

/// The similarity of a surrogate to its original.
struct Likeness {
    /// Similarity if it is only shifted.
    correlation: f64,
    /// Similarity if it is shifted and the signs of recordings are changed, means included.
    cosine: f64,
}

fn likeness(column: &Column, joints: &[JointRows], shifts: &[Shift]) -> Vec<Likeness> {
    let (mut cross, mut turned) = (vec![0.0; shifts.len()], vec![0.0; shifts.len()]);
    let (mut about_mean, mut size) = (0.0, 0.0);
    for (j, values) in &column.parts {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let of_mean = mean * mean * values.len() as f64;
        let square: f64 = values.iter().map(|v| v * v).sum();
        (about_mean, size) = (about_mean + square - of_mean, size + square);
        cross.iter_mut().for_each(|c| *c -= of_mean);
        for (r, rows) in recordings(&joints[*j]) {
            let own = &values[rows.clone()];
            Transformed::new(own).correlate(&[own], |_, correlation| {
                for (s, shift) in shifts.iter().enumerate() {
                    let value = correlation(shift.rows(rows.len()));
                    cross[s] += value;
                    turned[s] += shift.signs[r] * value;
                }
            });
        }
    }
    let changes = about_mean > 1e-6 * 2.0 * size;
    let of = |(cross, turned): (f64, f64)| Likeness {
        // A signal that hardly changes is the same after any shift.
        correlation: if changes { cross / about_mean } else { 1.0 },
        cosine: turned / size,
    };
    cross.into_iter().zip(turned).map(of).collect()
}

/// The products of the shifted columns with the base, with each other and with the residual, by shift.
pub(super) fn products(screen: &Screen<'_>, columns: &[Column], shifts: &[Shift]) -> Vec<Added> {
    let (fit, data) = (screen.context.fit, screen.context.data);
    let joints: Vec<usize> = screen.joints_of(columns).collect();
    // By column and shift: with the base, and, last, with the residual.
    let by_column = parallel::map(columns, |column| {
        let mut sums = vec![vec![0.0; fit.design.size + 1]; shifts.len()];
        for &j in &joints {
            let Some(own) = column.at(j) else { continue };
            let mut partners: Vec<(usize, &[f64])> = fit.design.columns(j).collect();
            partners.push((fit.design.size, &screen.context.residual[j]));
            for (r, rows) in recordings(&data.joints[j]) {
                let parts: Vec<&[f64]> = partners.iter().map(|(_, v)| &v[rows.clone()]).collect();
                Transformed::new(&own[rows.clone()]).correlate(&parts, |partner, correlation| {
                    for (sums, shift) in sums.iter_mut().zip(shifts) {
                        let value = correlation(shift.rows(rows.len()));
                        sums[partners[partner].0] += fit.weights[j] * shift.signs[r] * value;
                    }
                });
            }
        }
        sums
    });
    // A shift and a sign that all columns share change none of their products with each other.
    let square = screen.products(columns).square;
    let of = |s: usize| {
        let split = |sums: &Vec<Vec<f64>>| {
            let (cross, score) = sums[s].split_at(fit.design.size);
            (cross.to_vec(), score[0])
        };
        let (cross, right) = by_column.iter().map(split).unzip();
        Added { cross, right, square: square.clone() }
    };
    (0..shifts.len()).map(of).collect()
}

/// A joint's rows by recording, but for recordings that have none.
fn recordings(joint: &JointRows) -> impl Iterator<Item = (usize, &Range<usize>)> {
    joint.rows.iter().enumerate().filter(|(_, rows)| !rows.is_empty())
}

/// One recording's part of a column, by frequency.
struct Transformed {
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
    /// The complex conjugates.
    spectrum: Vec<Complex<f64>>,
}

impl Transformed {
    fn new(values: &[f64]) -> Transformed {
        let mut planner = FftPlanner::new();
        let forward = planner.plan_fft_forward(values.len());
        let mut spectrum: Vec<Complex<f64>> = values.iter().map(|v| Complex::new(*v, 0.0)).collect();
        forward.process(&mut spectrum);
        spectrum.iter_mut().for_each(|c| *c = c.conj());
        Transformed { inverse: planner.plan_fft_inverse(values.len()), forward, spectrum }
    }

    /// Calls `use_it` with the place of every partner and with its product with this part, shifted by a
    /// number of rows.
    fn correlate(&self, partners: &[&[f64]], mut use_it: impl FnMut(usize, &dyn Fn(usize) -> f64)) {
        let n = self.spectrum.len();
        // Two real signals in one transform: one is its real part, the other its imaginary part.
        for (pair, two) in partners.chunks(2).enumerate() {
            let second = |i: usize| two.get(1).map_or(0.0, |values| values[i]);
            let mut both: Vec<Complex<f64>> =
                two[0].iter().enumerate().map(|(i, v)| Complex::new(*v, second(i))).collect();
            self.forward.process(&mut both);
            both.iter_mut().zip(&self.spectrum).for_each(|(b, s)| *b *= s);
            self.inverse.process(&mut both);
            let scale = 1.0 / n as f64;
            let at = |shift: usize| both[(n - shift % n) % n] * scale;
            use_it(2 * pair, &|shift| at(shift).re);
            if two.len() > 1 {
                use_it(2 * pair + 1, &|shift| at(shift).im);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::prepare::initial_model;
    use super::super::super::prepare::{Inertia, ValidationOnly, prepare};
    use super::super::super::tests::small_arms::planar_with_payload;
    use super::*;
    use crate::options::ExplainOptions;

    /// By correlations and row by row, columns on one joint and on two.
    #[test]
    fn the_products_of_a_surrogate_are_those_of_its_rows() {
        let (body, logs) = planar_with_payload();
        let (fit, validate) = logs.split_at(4);
        let options = ExplainOptions::default();
        let started =
            prepare(&body, (fit, validate), &options, Inertia::Shared, ValidationOnly::TakenOut).unwrap();
        let model = initial_model(started.base, &started.study);
        let context = model.context(&started.study);
        let screen = Screen::new(&context);
        let (groups, _) = groups(&started.study, &model, &screen, CandidateKind::Names);
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
                    let gram = &screen.context.fit.normal_equations().gram;
                    for (g, value) in slow.cross[a].iter().enumerate() {
                        close(fast.cross[a][g], *value, 1e-9 + size * gram[(g, g)].sqrt());
                    }
                    close(fast.square[(a, a)], slow.square[(a, a)], size * size);
                    let residual = (context.residual.iter().zip(&context.fit.weights))
                        .map(|(r, w)| w * r.iter().map(|v| v * v).sum::<f64>());
                    close(fast.right[a], slow.right[a], size * residual.sum::<f64>().sqrt());
                }
            }
        }
        assert!(joints.iter().all(|n| *n > 0), "{joints:?}");
    }
}

#[cfg(test)]
mod shifts_tests {
    use super::*;
    use powerball_logs::signal::Band;

    fn joint(rows: Vec<Range<usize>>) -> [JointRows; 1] {
        let torque = vec![0.0; 1000];
        [JointRows { torque, inertial: Vec::new(), kept: Vec::new(), rows, band: Band::new(10.0, 200.0) }]
    }

    fn column(f: &dyn Fn(f64) -> f64) -> [Column; 1] {
        [Column::on(0, (0..1000).map(|k| f(f64::from(k))).collect::<Vec<f64>>())]
    }

    fn shift(fraction: f64, signs: &[f64]) -> [Shift; 1] {
        [Shift { fraction, signs: signs.to_vec() }]
    }

    /// A shift does not change a constant: with two recordings its signs are drawn, with one it
    /// has no surrogate.
    #[test]
    fn a_constant_has_surrogates_where_there_are_two_recordings() {
        let (one, two) = (joint(std::iter::once(0..1000).collect()), joint(vec![0..500, 500..1000]));
        // Filters leave a constant with rounding.
        let constant = column(&|k| 2.0 + 1e-12 * (k * 0.7).sin());
        let signs = |joints, signs: &[f64]| {
            let kept = unlike(&constant, joints, &shift(0.3, signs), 0.9).pop().flatten();
            kept.map(|shift| shift.signs)
        };
        assert_eq!(signs(&one, &[1.0]), None);
        assert_eq!(signs(&two, &[1.0, 1.0]), None);
        assert_eq!(signs(&two, &[1.0, -1.0]), Some(vec![1.0, -1.0]));
    }

    /// A wave is shifted, and no sign is touched; by its own period it is like itself.
    #[test]
    fn a_wave_is_unlike_itself_but_after_a_period() {
        let joints = joint(std::iter::once(0..1000).collect());
        let wave = column(&|k| 3.0 + (k * 0.02 * std::f64::consts::PI).sin());
        let kept = |fraction| unlike(&wave, &joints, &shift(fraction, &[-1.0]), 0.4).pop().flatten();
        assert_eq!(kept(0.325).unwrap().signs, [1.0]);
        assert!(kept(0.4).is_none());
    }

    /// Against the sums that they are, in lengths with and without small factors.
    #[test]
    fn correlations_are_sums_over_shifted_rows() {
        for n in [1, 2, 60, 101] {
            let signal = |a: f64| (0..n).map(|k| (a * k as f64).sin() + 0.1 * a).collect::<Vec<f64>>();
            let (own, partners) = (signal(0.7), [signal(1.3), signal(0.2), signal(2.9)]);
            let parts: Vec<&[f64]> = partners.iter().map(Vec::as_slice).collect();
            let mut count = 0;
            Transformed::new(&own).correlate(&parts, |partner, correlation| {
                for shift in 0..n {
                    let sum: f64 = (0..n).map(|i| own[(i + shift) % n] * partners[partner][i]).sum();
                    assert!((correlation(shift) - sum).abs() < 1e-12 * n as f64);
                    count += 1;
                }
            });
            assert_eq!(count, 3 * n);
        }
    }
}
