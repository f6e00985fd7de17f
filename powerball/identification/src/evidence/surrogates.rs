//! Surrogates: columns, or a residual, shifted in time within each recording, or with the signs of recordings
//! drawn. They cannot be true and pass through the same search, and show how much it finds by chance.
//!
//! The module also computes the products of columns that are shifted in time, thousands of times.

use super::base::{Base, Trial};
use crate::estimate::Added;
use chacha20::ChaCha8Rng;
use powerball_logs::parallel;
use powerball_logs::regression::{Column, JointRows};
use rand::{RngExt, SeedableRng};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// How much a search finds by chance: its best scores where nothing can be true.
#[derive(Clone, Debug)]
pub struct Chance {
    /// In ascending order.
    scores: Vec<f64>,
}

impl Chance {
    /// The chance that the best score of each surrogate shows.
    #[must_use]
    pub fn new(mut scores: Vec<f64>) -> Chance {
        scores.sort_by(f64::total_cmp);
        Chance { scores }
    }

    /// The chance of a search that is done again `count` times, each time with the residual shifted in time
    /// within each recording. `search` is given the shift and returns its best score.
    #[must_use]
    pub fn of_search(count: usize, seed: u64, search: impl Fn(&Shift) -> f64 + Sync + Send) -> Chance {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let shifts: Vec<Shift> = (0..count).map(|_| Shift::draw(&mut rng, 0)).collect();
        Chance::new(parallel::map(&shifts, search))
    }

    /// The score below which a share of them stays; 0 where there is none.
    #[must_use]
    pub fn level(&self, share: f64) -> f64 {
        self.scores.get((self.scores.len() as f64 * share) as usize).copied().unwrap_or(0.0)
    }

    /// The probability of such a score by chance: that of the search as a whole, whatever it looked for
    /// (the single-step test of Westfall and Young, 1993).
    #[must_use]
    pub fn p_value(&self, score: f64) -> f64 {
        let below = self.scores.partition_point(|chance| *chance < score);
        (1 + self.scores.len() - below) as f64 / (1 + self.scores.len()) as f64
    }
}

/// A column or several of a trial shifted: which trial, how, and the score.
#[derive(Clone, Debug)]
pub struct Surrogate {
    /// The place of the trial among those that were drawn from.
    pub which: usize,
    /// How it was made.
    pub shift: Shift,
    /// Score, not penalised for a search.
    pub score: f64,
}

/// Draws `count` surrogates of real trials in turn; `None` for one that would equal its original, which is
/// one whose correlation with it exceeds `limit`.
///
/// Columns are shifted in time within each recording. If a shift does not change one of them (a constant
/// torque, a wave of this very period), the signs of the recordings are drawn as well, the same for all
/// columns. Neither helps a constant in a single recording: it has no surrogate.
#[must_use]
pub fn draw(
    base: &Base<'_>,
    trials: &[&Trial],
    (count, limit): (usize, f64),
    seed: u64,
) -> Vec<Option<Surrogate>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let joints = &base.rows.data.joints;
    let recordings = joints.iter().map(|j| j.rows.len()).max().unwrap_or(0);
    let mut by_trial: Vec<Vec<Shift>> = vec![Vec::new(); trials.len()];
    for k in 0..count {
        let shift = Shift::draw(&mut rng, recordings);
        if let Some(of_trial) = by_trial.get_mut(k % trials.len().max(1)) {
            of_trial.push(shift);
        }
    }
    let of_trial = |(which, shifts): (usize, Vec<Shift>)| {
        let columns = &trials[which].columns;
        let unlike = unlike(columns, joints, &shifts, limit);
        let mut outcomes: Vec<Option<Surrogate>> =
            unlike.iter().filter(|shift| shift.is_none()).map(|_| None).collect();
        let shifts: Vec<Shift> = unlike.into_iter().flatten().collect();
        let asked: Vec<(Shift, Added)> =
            shifts.iter().cloned().zip(products(base, columns, &shifts)).collect();
        outcomes.extend(parallel::map(&asked, |(shift, products)| {
            let score = base.solve(products, 1.0)?.score;
            Some(Surrogate { which, shift: shift.clone(), score })
        }));
        outcomes
    };
    by_trial.into_iter().enumerate().flat_map(of_trial).collect()
}

/// A surrogate's column, row by row.
#[must_use]
pub fn shifted(column: &Column, joints: &[JointRows], shift: &Shift) -> Column {
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
#[must_use]
pub fn rotated(values: &[f64], recordings: &[Range<usize>], shift: &Shift) -> Vec<f64> {
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
pub struct Shift {
    /// Shift as a share of each recording.
    pub fraction: f64,
    /// By recording, 1 or −1.
    pub signs: Vec<f64>,
}

impl Shift {
    /// A shift far from none, with a sign for each of some recordings.
    fn draw(rng: &mut ChaCha8Rng, recordings: usize) -> Shift {
        let fraction = rng.random_range(0.15..0.85);
        // The first keeps its sign, since a column with all of them turned is the same column.
        let sign = |r: usize| if r > 0 && rng.random_bool(0.5) { -1.0 } else { 1.0 };
        Shift { fraction, signs: (0..recordings).map(sign).collect() }
    }

    /// Rows of a recording of `n` by which it is shifted.
    #[must_use]
    pub fn rows(&self, n: usize) -> usize {
        (self.fraction * n as f64) as usize
    }
}

/// The surrogate of each shift: without signs if the shift alone makes the columns different from the
/// original ones, with signs if these are needed (a constant torque, a wave of this very period), `None`
/// where neither helps. `limit` is the largest correlation of a surrogate with its original.
fn unlike(columns: &[Column], joints: &[JointRows], shifts: &[Shift], limit: f64) -> Vec<Option<Shift>> {
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
pub(super) fn products(base: &Base<'_>, columns: &[Column], shifts: &[Shift]) -> Vec<Added> {
    let (rows, size) = (&base.rows, base.rows.design.size);
    let joints: Vec<usize> = base.joints_of(columns).collect();
    // By column and shift: with the base, and, last, with the residual.
    let by_column = parallel::map(columns, |column| {
        let mut sums = vec![vec![0.0; size + 1]; shifts.len()];
        for &j in &joints {
            let Some(own) = column.at(j) else { continue };
            let mut partners: Vec<(usize, &[f64])> = rows.design.columns(j).collect();
            partners.push((size, &rows.residual[j]));
            for (r, rows) in recordings(&rows.data.joints[j]) {
                let parts: Vec<&[f64]> = partners.iter().map(|(_, v)| &v[rows.clone()]).collect();
                Transformed::new(&own[rows.clone()]).correlate(&parts, |partner, correlation| {
                    for (sums, shift) in sums.iter_mut().zip(shifts) {
                        let value = correlation(shift.rows(rows.len()));
                        sums[partners[partner].0] += base.weights[j] * shift.signs[r] * value;
                    }
                });
            }
        }
        sums
    });
    // A shift and a sign that all columns share change none of their products with each other.
    let square = base.products(columns, |j| 0..rows.residual[j].len()).square;
    let of = |s: usize| {
        let split = |sums: &Vec<Vec<f64>>| {
            let (cross, score) = sums[s].split_at(size);
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
