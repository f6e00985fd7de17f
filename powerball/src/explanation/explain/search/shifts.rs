//! Columns shifted in time, thousands of times: their products with the base and with the residual are circular
//! cross-correlations, which one Fourier transform a column gives for all shifts.

use super::screen::{Products, Screen};
use crate::logs::parallel;
use crate::logs::regression::{Column, JointRows};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// How columns are changed into some that cannot be true.
#[derive(Clone, Debug)]
pub(super) struct Shift {
    /// By this share of each recording.
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

/// Of each shift what is left of it as a surrogate: itself without signs where the shift alone makes the columns unlike
/// themselves, with signs where these are needed (a constant torque, a wave of this very period), `None` where
/// neither helps. `limit` is the largest correlation of a surrogate with what it is made of.
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

/// How like a surrogate is to what it is made of.
struct Likeness {
    /// Where it is shifted.
    correlation: f64,
    /// Where it is shifted and has the signs of recordings turned: means and all.
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
        // What hardly changes is the same wherever it is shifted to.
        correlation: if changes { cross / about_mean } else { 1.0 },
        cosine: turned / size,
    };
    cross.into_iter().zip(turned).map(of).collect()
}

/// The products of the shifted columns with the base, with each other and with the residual, by shift.
pub(super) fn products(screen: &Screen<'_>, columns: &[Column], shifts: &[Shift]) -> Vec<Products> {
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
        let (cross, score) = by_column.iter().map(split).unzip();
        Products { cross, score, square: square.clone() }
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

    /// Calls `use_it` with the place of every partner and with its product with this part shifted by so many rows.
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
    use super::*;
    use crate::logs::signal::Band;

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

    /// A constant is what it was wherever it is shifted to: with two recordings its signs are drawn, with one it
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
