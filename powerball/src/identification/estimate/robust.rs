//! A fit that knocks, spikes and brief collisions do not bend.
//!
//! A torque sample that lies farther from the model than noise explains is replaced by the model's torque and
//! as much of the miss as is believed (Huber's pseudo-values), before any filter spreads it over its
//! neighbours; then the logs are fitted as ever, and again until nothing changes. What is believed: all of a
//! miss up to three deviations, less of it beyond, nothing from six on (Hampel's ψ). The deviation is the
//! median one of each joint, which outliers do not move.
//!
//! Also here: ratios of sums over blocks that count as independent.

use super::distribution::t_quantile_975;
use super::reduced::{FrictionKind, Solution, solve_reduced};
use crate::controller::friction::TanhFriction;
use crate::logs::log::Log;
use crate::logs::regression::{DataError, DataOptions, Recording, RigidArm};
use crate::logs::signal::rest::REST_SPEED;
use crate::logs::summary::Summary;
use crate::logs::vector::{NORMAL, median};

/// Misses up to this many deviations are believed.
const BELIEVED: f64 = 3.0;
/// From this many on nothing is.
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
        // One log that cannot be used is no reason to refuse the others.
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
pub(crate) fn over_blocks(blocks: &[(f64, f64)]) -> (f64, f64) {
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

#[cfg(test)]
mod ratio_tests {
    use super::over_blocks;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn intervals_hold_the_true_ratio_as_often_as_they_say() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
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
