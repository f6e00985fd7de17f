//! A fit that impacts, spikes and brief collisions do not bias.
//!
//! A torque sample that lies farther from the model than noise explains is replaced by the model's torque and
//! a part of the residual (Huber's pseudo-values), before any filter spreads it over its neighbours; then the
//! logs are fitted as usual, and again until nothing changes. That part is all of a residual up to three
//! deviations, less of it beyond, nothing from six on (Hampel's ψ). The deviation is the median one of each
//! joint, which outliers do not move.
//!
//! The module also has ratios of sums over blocks that count as independent.

use super::distribution::t_quantile_975;
use super::reduced::{FrictionKind, Part, Solution, solve_reduced};
use super::solve::dot;
use super::spectrum::{Power, deconvolved};
use super::uncertainty::StandardErrors;
use super::variable_projection;
use faer::Mat;
use faer::linalg::solvers::Solve;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::{Log, logs_of_motors};
use powerball_logs::regression::{Data, DataError, DataOptions, Recording, RigidArm};
use powerball_logs::signal::motion::REST_SPEED;
use powerball_logs::summary::{Octaves, RFactor, Summary, parts};
use powerball_logs::vector::{NORMAL, median};

/// Misses up to this many deviations are believed.
const BELIEVED: f64 = 3.0;
/// From this many deviations on, nothing is believed.
const DISCARDED: f64 = 6.0;
/// Rounds in which far misses still count: the first model is bent by them, and must not be the judge alone.
const GENTLE_ROUNDS: usize = 5;
/// Rounds at most.
const ROUNDS: usize = 20;
/// A change of all coefficients below this share of their own size ends the rounds.
const SETTLED: f64 = 1e-5;

/// A robust fit.
#[derive(Debug)]
pub struct Robust {
    /// The fit.
    pub solution: Solution,
    /// By joint: the share of torque samples in motion that did not count in full.
    pub doubted: Vec<f64>,
}

/// Fits logs robustly.
///
/// # Errors
/// [`DataError`] where no log can be used.
pub fn solve_robust(
    body: &RigidArm,
    logs: &[Log],
    options: &DataOptions,
    law: FrictionKind,
) -> Result<Robust, DataError> {
    let n = body.dof();
    let mut solution = solve_reduced(&reduce(body, logs, options, |_| {})?, law);
    let mut doubted = vec![0.0; n];
    for round in 0..ROUNDS {
        let model = &solution;
        let mut misses: Vec<Vec<f64>> = vec![Vec::new(); n];
        reduce(body, logs, options, |recording| {
            for (j, miss) in model.misses(body, recording).into_iter().enumerate() {
                misses[j].extend(in_motion(recording, j).map(|k| miss[k].abs()));
            }
        })?;
        let deviation: Vec<f64> = misses.iter_mut().map(|m| NORMAL * median(m)).collect();
        for (j, m) in misses.iter().enumerate() {
            let beyond = m.iter().filter(|x| **x > BELIEVED * deviation[j]).count();
            doubted[j] = beyond as f64 / m.len().max(1) as f64;
        }
        let gentle = round < GENTLE_ROUNDS;
        let summary = reduce(body, logs, options, |recording| {
            for (j, miss) in model.misses(body, recording).into_iter().enumerate() {
                // Near a reversal friction itself may be far from its law: nothing is discarded there, only
                // bounded.
                let slow: Vec<bool> = recording.velocity(j).map(|v| v.abs() <= REST_SPEED).collect();
                for (k, tau) in recording.torque[j].iter_mut().enumerate() {
                    let bound = DISCARDED * deviation[j];
                    let counts = match slow[k] {
                        true => miss[k].clamp(-bound, bound),
                        false => believed(miss[k], deviation[j], gentle),
                    };
                    *tau -= miss[k] - counts;
                }
            }
        })?;
        let next = solve_reduced(&summary, law);
        let size: f64 = solution.theta.iter().map(|x| x * x).sum();
        let change: f64 = next.theta.iter().zip(&solution.theta).map(|(a, b)| (a - b).powi(2)).sum();
        solution = next;
        if !gentle && change <= (SETTLED * SETTLED) * size {
            break;
        }
    }
    Ok(Robust { solution, doubted })
}

impl Solution {
    /// Measured less predicted torque at every sample of a recording, outside any band, by joint, N·m.
    fn misses(&self, body: &RigidArm, recording: &Recording) -> Vec<Vec<f64>> {
        let n = recording.dof;
        let rigid = body.torque(&recording.q, &recording.v, &recording.a, self.inertial());
        (0..n)
            .map(|j| {
                let friction = TanhFriction::new(self.friction(j));
                let predicted = rigid.iter().skip(j).step_by(n).zip(recording.velocity(j));
                let torque = recording.torque[j].iter();
                torque
                    .zip(predicted)
                    .map(|(tau, (rigid, v))| tau - rigid - friction.torque(v) - self.offset(j))
                    .collect()
            })
            .collect()
    }
}

/// The samples in which a joint moves: at rest its friction is anything.
fn in_motion(recording: &Recording, joint: usize) -> impl Iterator<Item = usize> + '_ {
    recording.velocity(joint).enumerate().filter(|(_, v)| v.abs() > REST_SPEED).map(|(k, _)| k)
}

/// How much of a miss counts.
fn believed(miss: f64, deviation: f64, gentle: bool) -> f64 {
    let (near, far) = (BELIEVED * deviation, DISCARDED * deviation);
    let size = miss.abs();
    if size <= near {
        miss
    } else if gentle {
        near * miss.signum()
    } else if size < far {
        near * (far - size) / (far - near) * miss.signum()
    } else {
        0.0
    }
}

fn reduce(
    body: &RigidArm,
    logs: &[Log],
    options: &DataOptions,
    mut correct: impl FnMut(&mut Recording),
) -> Result<Summary, DataError> {
    let mut summary = Summary::new(body, options);
    let mut refused = None;
    for log in logs {
        // One log that cannot be used is not a reason to refuse the others.
        refused = summary.push_corrected(body, log, options, &mut correct).err().or(refused);
    }
    match refused {
        Some(error) if summary.logs.is_empty() => Err(error),
        _ => Ok(summary),
    }
}

// Ratios of sums over blocks that count as independent.

/// Σ a / Σ b over blocks (a, b), and half the width of its 95 % interval by Student's t: infinite where fewer
/// than two blocks have a denominator.
#[must_use]
pub fn over_blocks(blocks: &[(f64, f64)]) -> (f64, f64) {
    let used: Vec<&(f64, f64)> = blocks.iter().filter(|(_, b)| *b > 0.0).collect();
    let count = used.len() as f64;
    let (above, below) = used.iter().fold((0.0, 0.0), |(a, b), block| (a + block.0, b + block.1));
    let ratio = if below > 0.0 { above / below } else { 0.0 };
    if count < 2.0 {
        return (ratio, f64::INFINITY);
    }
    let squares: f64 = used.iter().map(|(a, b)| (a - ratio * b).powi(2)).sum();
    (ratio, t_quantile_975(count - 1.0) * (squares * count / (count - 1.0)).sqrt() / below)
}

// Instrumental variables: a fit that noise of the positions does not bias.
//
// Accelerations are second derivatives of measured positions. Their noise stands in the regressor A, and
// least squares then draws inertias towards zero, however long the logs are. Instruments Z are columns that
// follow the true ones and are independent of that noise: Z'·(y − A·θ) = 0 has no such bias. The instruments
// are the model's own columns (as in the IDIM-IV method of Janot, Vandanjon and Gautier 2014) for another
// observation of the same motion: A is made of every second sample of the positions, Z of those between.
// Encoder noise of neighbouring samples is independent; noise that is slower than the samples, and noise of
// torques that acts back on the motion, are not seen.
//
// The steepnesses of friction and the joints' weights are those of the least-squares fit that this one
// starts from.

/// Fits logs by instrumental variables, from a fit by least squares.
///
/// # Errors
/// Why not, in words: no log can be used, or the instruments do not determine what the columns do.
pub fn solve_instrumental(
    body: &RigidArm,
    logs: &[Log],
    options: &DataOptions,
    start: &Solution,
) -> Result<(Solution, StandardErrors), String> {
    let layout = start.layout;
    let rows = rows(body, logs, options, start)?;
    let free: Vec<usize> = (0..layout.size()).filter(|c| start.free[*c] && !layout.is_tangent(*c)).collect();
    let size = free.len();
    let place: Vec<Option<usize>> = (0..layout.size()).map(|c| free.iter().position(|f| *f == c)).collect();
    let levels: Vec<Vec<Level>> = rows
        .iter()
        .map(|joint| match joint {
            None => Vec::new(),
            Some((global, octaves)) => octaves.levels().iter().map(|t| Level::new(t, global)).collect(),
        })
        .collect();
    let (inverse, found) = solve_moments(&levels, &start.weights, &place, size)?;
    let mut theta = vec![0.0; layout.size()];
    free.iter().enumerate().for_each(|(i, c)| theta[*c] = found[(i, 0)]);
    let errors = standard_errors(&levels, start, &inverse, &theta, &free, &place);
    let solution = Solution {
        layout,
        identity: start.identity.clone(),
        shapes: start.shapes.clone(),
        theta,
        weights: start.weights.clone(),
        bands: start.bands.clone(),
        free: (0..layout.size()).map(|c| place[c].is_some()).collect(),
        parts: levels.into_iter().map(|j| j.into_iter().map(|l| l.part).collect()).collect(),
    };
    Ok((solution, errors))
}

/// (ZᵀA)⁻¹, and the parameters (ZᵀA)⁻¹ Zᵀy, both summed over joints.
fn solve_moments(
    levels: &[Vec<Level>],
    weights: &[f64],
    place: &[Option<usize>],
    size: usize,
) -> Result<(Mat<f64>, Mat<f64>), String> {
    let (mut moments, mut right) = (Mat::<f64>::zeros(size, size), Mat::<f64>::zeros(size, 1));
    for (level, weight) in weighted(levels, weights) {
        let (za, zy) = level.moments(place, size);
        moments += za * faer::Scale(weight);
        right += zy * faer::Scale(weight);
    }
    let scale: Vec<f64> =
        (0..size).map(|i| moments[(i, i)].abs().sqrt().max(f64::MIN_POSITIVE).recip()).collect();
    let scaled = Mat::from_fn(size, size, |i, k| moments[(i, k)] * scale[i] * scale[k]);
    let unscaled = scaled.partial_piv_lu().solve(Mat::<f64>::identity(size, size));
    let inverse = Mat::from_fn(size, size, |i, k| unscaled[(i, k)] * scale[i] * scale[k]);
    let found = &inverse * &right;
    if (0..size).any(|i| !found[(i, 0)].is_finite()) {
        return Err(
            "the instruments do not determine the parameters: record a motion that excites them".into()
        );
    }
    Ok((inverse, found))
}

/// Standard errors under noise that is deconvolved from what each octave leaves.
fn standard_errors(
    levels: &[Vec<Level>],
    start: &Solution,
    inverse: &Mat<f64>,
    theta: &[f64],
    free: &[usize],
    place: &[Option<usize>],
) -> StandardErrors {
    let (layout, size) = (start.layout, free.len());
    let (mut std, mut quantile) = (vec![None; layout.size()], vec![0.0; layout.size()]);
    let mut sums = vec![(0.0, 0.0); size];
    let mut covariance = Mat::<f64>::zeros(layout.size(), layout.size());
    for (joint, weight) in levels.iter().zip(&start.weights) {
        let known: Vec<(&Level, Power)> = joint
            .iter()
            .enumerate()
            .filter(|(_, level)| level.part.rows > 0)
            .map(|(octave, level)| {
                let (za, _) = level.moments(place, size);
                let turned = inverse * &za;
                let taken = weight * (0..size).map(|i| turned[(i, i)]).sum::<f64>();
                let freedom = (level.part.rows as f64 - taken).max(1.0);
                (level, Power { octave, mean: level.part.left(theta) / freedom, freedom })
            })
            .collect();
        let sharp = deconvolved(&known.iter().map(|(_, power)| *power).collect::<Vec<_>>());
        for ((level, Power { freedom, .. }), power) in known.into_iter().zip(sharp) {
            let inverse_square = inverse * level.instrument_products(place, size) * inverse.transpose();
            for (i, (variance, doubt)) in sums.iter_mut().enumerate() {
                let share = weight * weight * power * inverse_square[(i, i)].max(0.0);
                *variance += share;
                *doubt += share * share / freedom;
            }
            for (i, k) in (0..size).flat_map(|i| (0..size).map(move |k| (i, k))) {
                covariance[(free[i], free[k])] += weight * weight * power * inverse_square[(i, k)];
            }
        }
    }
    for (c, (variance, doubt)) in free.iter().zip(&sums) {
        std[*c] = Some(variance.sqrt());
        let freedom = if *doubt > 0.0 { variance * variance / doubt } else { f64::from(u16::MAX) };
        quantile[*c] = t_quantile_975(freedom.max(1.0));
    }
    StandardErrors { std, quantile, covariance }
}

/// By joint, where it moves: the model's columns by their index, and the rows [Z A y].
type Rows = Vec<Option<(Vec<usize>, Octaves)>>;

fn rows(body: &RigidArm, logs: &[Log], options: &DataOptions, start: &Solution) -> Result<Rows, String> {
    let mut rows: Rows = (0..start.layout.dof).map(|_| None).collect();
    let mut refused = None;
    for (log, of_motors) in logs.iter().zip(&*logs_of_motors(body.arm(), logs)) {
        for (part, turned) in parts(log).into_iter().zip(parts(of_motors)) {
            let data = match Data::new(body, std::slice::from_ref(&part), options) {
                Ok(data) => data,
                Err(error) => {
                    refused = Some(format!("{}: {error}", log.file));
                    continue;
                }
            };
            let half = |first: usize| {
                data.seen_otherwise(|recording| every_second(recording, &turned, first, options.smoothing))
            };
            let (seen, instrument) = (half(0), half(1));
            for (j, joint) in rows.iter_mut().enumerate().filter(|(j, _)| !data.joints[*j].is_empty()) {
                let (global, a) = columns(&seen, start, j);
                let (_, z) = columns(&instrument, start, j);
                let all: Vec<Vec<f64>> =
                    z.into_iter().chain(a).chain([data.joints[j].torque.clone()]).collect();
                let (_, octaves) = joint.get_or_insert_with(|| (global, Octaves::new(all.len())));
                octaves.push_rows(&data.joints[j], &all);
            }
        }
    }
    if rows.iter().all(Option::is_none) {
        return Err(refused.unwrap_or_else(|| "no joint moves in these logs".into()));
    }
    Ok(rows)
}

/// The model's columns on a joint at the start's shapes, with their indices.
fn columns(data: &Data<'_>, start: &Solution, joint: usize) -> (Vec<usize>, Vec<Vec<f64>>) {
    let layout = start.layout;
    let rows = &data.joints[joint];
    let mut global: Vec<usize> = (0..layout.inertial).collect();
    let mut columns = rows.inertial.clone();
    let [g2, g4, viscous, ..] = variable_projection::columns(data, joint, start.shapes[joint]);
    for (k, column) in [g2, g4, viscous].into_iter().enumerate() {
        global.push(layout.friction(joint, k));
        columns.push(column.to_vec());
    }
    if layout.extra > 0 {
        global.push(layout.extra(joint));
        columns.push(vec![1.0; rows.len()]);
    }
    (global, columns)
}

/// Positions from every second sample of a log, without the others.
fn every_second(recording: &mut Recording, log: &Log, first: usize, smoothing: f64) {
    let end = recording.start + recording.len() as f64 / recording.rate;
    let from = log.t.partition_point(|t| *t < recording.start);
    let to = log.t.partition_point(|t| *t < end);
    let half = |x: &[f64]| -> Vec<f64> { x[from..to].iter().skip(first).step_by(2).copied().collect() };
    let positions: Vec<Vec<f64>> = log.q.iter().map(|q| half(q)).collect();
    recording.follow(&half(&log.t), &positions.iter().map(Vec::as_slice).collect::<Vec<_>>(), smoothing);
}

/// The rows of one joint and octave.
struct Level {
    /// Z by model column.
    instruments: Vec<Vec<f64>>,
    /// A and y.
    part: Part,
}

impl Level {
    fn new(factor: &RFactor, global: &[usize]) -> Level {
        let width = global.len();
        let column = |k: usize| factor.column(k).to_vec();
        let part = Part {
            columns: (width..=2 * width).map(column).collect(),
            global: global.to_vec(),
            rows: factor.rows(),
        };
        Level { instruments: (0..width).map(column).collect(), part }
    }

    /// Z'A and Z'y over the free columns.
    fn moments(&self, place: &[Option<usize>], size: usize) -> (Mat<f64>, Mat<f64>) {
        let (mut za, mut zy) = (Mat::zeros(size, size), Mat::zeros(size, 1));
        let torque = &self.part.columns[self.part.global.len()];
        for (z, i) in self.free(&self.instruments, place) {
            for (a, k) in self.free(&self.part.columns, place) {
                za[(i, k)] = dot(z, a);
            }
            zy[(i, 0)] = dot(z, torque);
        }
        (za, zy)
    }

    /// Z'Z over the free columns.
    fn instrument_products(&self, place: &[Option<usize>], size: usize) -> Mat<f64> {
        let mut zz = Mat::zeros(size, size);
        for (a, i) in self.free(&self.instruments, place) {
            for (b, k) in self.free(&self.instruments, place) {
                zz[(i, k)] = dot(a, b);
            }
        }
        zz
    }

    fn free<'s>(
        &'s self,
        columns: &'s [Vec<f64>],
        place: &'s [Option<usize>],
    ) -> impl Iterator<Item = (&'s Vec<f64>, usize)> {
        columns.iter().zip(&self.part.global).filter_map(|(column, g)| Some((column, place[*g]?)))
    }
}

fn weighted<'a>(levels: &'a [Vec<Level>], weights: &'a [f64]) -> impl Iterator<Item = (&'a Level, f64)> {
    levels.iter().zip(weights).flat_map(|(joint, weight)| joint.iter().map(move |level| (level, *weight)))
}

#[cfg(test)]
mod ratio_tests {
    use super::over_blocks;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn intervals_hold_the_true_ratio_as_often_as_they_say() {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(5);
        let held = (0..2000)
            .filter(|_| {
                let blocks: Vec<(f64, f64)> = (0..25)
                    .map(|_| {
                        let b = rng.random_range(1.0..2.0);
                        (b * rng.random_range(0.2..1.0), b)
                    })
                    .collect();
                let (ratio, half) = over_blocks(&blocks);
                (ratio - 0.6).abs() < half
            })
            .count();
        assert!((1860..=1940).contains(&held), "{held} of 2000");
        assert_eq!(over_blocks(&[(1.0, 2.0)]), (0.5, f64::INFINITY));
        assert_eq!(over_blocks(&[]).0, 0.0);
    }
}
