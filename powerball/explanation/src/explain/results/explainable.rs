//! The share of a model's residual that a smooth law of the joints' states would explain: it distinguishes
//! noise from a missing law.
//!
//! A Gaussian process (Rasmussen and Williams 2006) by random Fourier features (Rahimi and Recht 2007) is
//! fitted to the residual on the fitted logs, with the length and the noise that predict parts of them best,
//! and is tested on the validation set.

use super::super::study::Study;
use chacha20::ChaCha8Rng;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use powerball_identification::estimate::Solver;
use powerball_logs::parallel;
use powerball_logs::regression::{Data, Recording, Signals};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;

/// Features of a kernel.
const FEATURES: usize = 64;
/// Lengths of the kernels, in standard deviations of the states.
const LENGTHS: [f64; 2] = [0.6, 1.8];
/// Variances of the noise over that of the function.
const NOISES: [f64; 4] = [0.3, 3.0, 30.0, 300.0];
/// Rows of a joint that are enough.
const MOST_ROWS: usize = 2000;
/// Parts that are predicted in turn where there are fewer recordings.
const PARTS: usize = 5;
/// Presliding ends so far after a turn, rad or m.
const TURN: f64 = 0.02;
/// Draws the features.
const SEED: u64 = 31;

/// By joint, the share of the squared error that is left on the validation set.
pub(super) fn explainable(study: &Study<'_>, fitted: &Signals, held_out: &Signals) -> Vec<f64> {
    let joints: Vec<usize> = (0..study.data.dof()).collect();
    parallel::map(&joints, |j| {
        let own = Rows::new(&study.data, *j, &fitted[*j], None);
        let others = Rows::new(&study.validation, *j, &held_out[*j], Some(&own));
        if own.y.len() < 2 * FEATURES || others.y.is_empty() { 0.0 } else { share(&own, &others) }
    })
}

/// The residual of one joint, with the joints' states.
struct Rows {
    /// By state and row, in standard deviations of the fitted logs; those of the joint itself come first.
    states: Vec<Vec<f64>>,
    /// Mean and standard deviation of each state.
    scale: Vec<[f64; 2]>,
    /// The residual, N·m.
    y: Vec<f64>,
    /// The part to which each row belongs.
    part: Vec<usize>,
}

/// States of the joint itself: position, velocity, direction, way since its last turn.
const OWN: usize = 4;

impl Rows {
    /// The states and the residual of a joint; states are scaled like those of `like`.
    fn new(data: &Data<'_>, joint: usize, left: &[f64], like: Option<&Rows>) -> Rows {
        let n = data.dof();
        let slow = data.rest_velocity[joint];
        let mut all: Vec<Vec<f64>> = Vec::new();
        let mut add = |signal: &dyn Fn(&Recording) -> Vec<f64>| {
            all.push(data.joints[joint].column(&data.recordings, |_, recording| signal(recording)));
        };
        add(&|r| r.position(joint).collect());
        add(&|r| r.velocity(joint).collect());
        add(&|r| r.velocity(joint).map(|v| (v / slow).tanh()).collect());
        add(&|r| since_turn(r, joint));
        add(&|r| r.acceleration(joint).collect());
        for k in (0..n).filter(|k| *k != joint) {
            add(&|r| r.position(k).collect());
            add(&|r| r.velocity(k).collect());
        }
        let step = left.len().div_ceil(MOST_ROWS).max(1);
        let thin = |values: &[f64]| -> Vec<f64> { values.iter().step_by(step).copied().collect() };
        let mut states: Vec<Vec<f64>> = all.iter().map(|state| thin(state)).collect();
        let y = thin(left);
        let scale = match like {
            Some(like) => like.scale.clone(),
            None => states.iter().map(|state| mean_and_std(state)).collect(),
        };
        for (state, [mean, std]) in states.iter_mut().zip(&scale) {
            state.iter_mut().for_each(|x| *x = (*x - mean) / std);
        }
        let rows = &data.joints[joint].rows;
        let several = rows.iter().filter(|rows| !rows.is_empty()).count() >= 3;
        let mut part = Vec::with_capacity(left.len());
        for (r, rows) in rows.iter().enumerate() {
            part.extend((0..rows.len()).map(|k| if several { r } else { k * PARTS / rows.len() }));
        }
        let part = part.into_iter().step_by(step).collect();
        Rows { states, scale, y, part }
    }

    /// The features of its states, a row each: functions of the joint's own states, and of all.
    fn features(&self, length: f64) -> Mat<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut features = Mat::<f64>::zeros(self.y.len(), 2 * FEATURES);
        for (block, count) in [(0, OWN), (1, self.states.len())] {
            // As far apart as two states of one dimension.
            let scale = length * (count as f64).sqrt();
            for f in 0..FEATURES {
                let along: Vec<f64> = (0..count).map(|_| normal(&mut rng) / scale).collect();
                let phase: f64 = rng.random_range(0.0..TAU);
                for k in 0..self.y.len() {
                    let at: f64 = along.iter().zip(&self.states).map(|(a, state)| a * state[k]).sum();
                    features[(k, block * FEATURES + f)] = (at + phase).cos() / (FEATURES as f64).sqrt();
                }
            }
        }
        features
    }
}

/// The share of the squared error of `others` that the function fitted to `own` takes away.
fn share(own: &Rows, others: &Rows) -> f64 {
    let square = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>();
    let (all, to_judge) = (square(&own.y), square(&others.y));
    if all <= 0.0 || to_judge <= 0.0 {
        return 0.0;
    }
    let parts = own.part.iter().copied().max().unwrap_or(0) + 1;
    // No function at all is a choice too.
    let (mut best, mut share) = (all, 0.0);
    for length in LENGTHS {
        let features = own.features(length);
        let by_part: Vec<(Mat<f64>, Vec<f64>)> =
            (0..parts).map(|part| own.products(&features, part)).collect();
        for noise in NOISES {
            let without = |part: usize| coefficients(&by_part, Some(part), noise);
            let fits: Vec<Vec<f64>> = (0..parts).map(without).collect();
            let held_out: f64 =
                (0..own.y.len()).map(|k| (own.y[k] - at(&features, k, &fits[own.part[k]])).powi(2)).sum();
            if held_out < best {
                best = held_out;
                let fit = coefficients(&by_part, None, noise);
                let asked = others.features(length);
                let left: f64 =
                    (0..others.y.len()).map(|k| (others.y[k] - at(&asked, k, &fit)).powi(2)).sum();
                share = (1.0 - left / to_judge).max(0.0);
            }
        }
    }
    share
}

impl Rows {
    /// ΦᵀΦ and Φᵀy over the rows of one part.
    fn products(&self, features: &Mat<f64>, part: usize) -> (Mat<f64>, Vec<f64>) {
        let rows: Vec<usize> = (0..self.y.len()).filter(|k| self.part[*k] == part).collect();
        let own = Mat::from_fn(rows.len(), features.ncols(), |k, f| features[(rows[k], f)]);
        let mut gram = Mat::zeros(features.ncols(), features.ncols());
        matmul(gram.as_mut(), Accum::Replace, own.transpose(), own.as_ref(), 1.0, Par::Seq);
        let right = |f: usize| own.col_as_slice(f).iter().zip(&rows).map(|(x, k)| x * self.y[*k]).sum();
        (gram, (0..features.ncols()).map(right).collect())
    }
}

/// The fit to all parts, or to all but one.
fn coefficients(by_part: &[(Mat<f64>, Vec<f64>)], without: Option<usize>, noise: f64) -> Vec<f64> {
    let size = by_part[0].1.len();
    let (mut gram, mut right) = (Mat::<f64>::zeros(size, size), vec![0.0; size]);
    for (_, (own, towards)) in by_part.iter().enumerate().filter(|(part, _)| Some(*part) != without) {
        gram += own;
        right.iter_mut().zip(towards).for_each(|(all, own)| *all += own);
    }
    (0..size).for_each(|c| gram[(c, c)] += noise);
    Solver::new(&gram, |_| true).solve(&right)
}

fn at(features: &Mat<f64>, row: usize, coefficients: &[f64]) -> f64 {
    coefficients.iter().enumerate().map(|(f, c)| c * features[(row, f)]).sum()
}

/// How far a joint has moved since its last turn, with its direction: 1 where it has moved far.
fn since_turn(recording: &Recording, joint: usize) -> Vec<f64> {
    let (mut turned_at, mut ahead) = (None::<f64>, true);
    let of = |(q, v): (f64, f64)| {
        if turned_at.is_none() || (v != 0.0 && (v > 0.0) != ahead) {
            (turned_at, ahead) = (Some(q), v > 0.0);
        }
        let way = turned_at.map_or(0.0, |at| (q - at).abs());
        (if ahead { 1.0 } else { -1.0 }) * (1.0 - (-way / TURN).exp())
    };
    recording.position(joint).zip(recording.velocity(joint)).map(of).collect()
}

fn mean_and_std(values: &[f64]) -> [f64; 2] {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let std = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    [mean, if std > 0.0 { std } else { 1.0 }]
}

/// Box and Muller.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..TAU));
    (-2.0 * a.ln()).sqrt() * b.cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a joint that swings with another one; what is left is a law of its states and noise of
    /// standard deviation 1.
    fn rows(seed: u64, law: impl Fn(&[f64]) -> f64) -> Rows {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let phases: Vec<f64> = (0..2).map(|_| rng.random_range(0.0..TAU)).collect();
        let n = 1500;
        let wave = |joint: usize, k: usize, by: f64| {
            (0.02 * (1.0 + 0.37 * joint as f64) * k as f64 + phases[joint] + by).sin()
        };
        let own = |k: usize| {
            let (q, v) = (wave(0, k, 0.0), wave(0, k, 0.25 * TAU));
            vec![q, v, v.signum(), v.signum(), -q, wave(1, k, 0.0), wave(1, k, 0.25 * TAU)]
        };
        let states: Vec<Vec<f64>> = (0..7).map(|s| (0..n).map(|k| own(k)[s]).collect()).collect();
        let y = (0..n).map(|k| law(&own(k)) + normal(&mut rng)).collect();
        Rows { states, scale: Vec::new(), y, part: (0..n).map(|k| k * PARTS / n).collect() }
    }

    /// A law with a share of 1 / (1 + noise) of the variance is seen with that share, and noise with none.
    #[test]
    fn a_law_of_the_states_is_seen_and_noise_is_none() {
        let seen = |law: &dyn Fn(&[f64]) -> f64| share(&rows(1, law), &rows(2, law));
        assert!(seen(&|_| 0.0) < 0.02, "{}", seen(&|_| 0.0));
        let of_own = |x: &[f64]| 2.0 * (3.0 * x[0]).sin() + x[2];
        let power = |law: &dyn Fn(&[f64]) -> f64| {
            let Rows { y, states, .. } = rows(2, law);
            let at = |k: usize| law(&states.iter().map(|s| s[k]).collect::<Vec<_>>()).powi(2);
            (0..y.len()).map(at).sum::<f64>() / y.iter().map(|y| y * y).sum::<f64>()
        };
        for law in [&of_own as &dyn Fn(&[f64]) -> f64, &|x| 2.0 * x[0] * x[5]] {
            approx::assert_relative_eq!(seen(law), power(law), epsilon = 0.06);
        }
    }
}
