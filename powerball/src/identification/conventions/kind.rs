//! Whether torques were measured or commanded, by samples as they were logged.
//!
//! Two recordings never measure the same: torques that repeat bit by bit while the positions do not were
//! commanded. Noise that no position column shares was measured.

use super::result::Kind;
use crate::logs::log::Log;

/// Samples that must repeat.
const REPEATS: usize = 50;
/// Noise above this share of a torque's rms is measured noise.
const NOISE: f64 = 2e-3;
/// … where less than this share of its variance follows the positions.
const FOLLOWS: f64 = 0.3;

/// What two logs, or the noise, show.
pub(super) fn kind(logs: &[&Log]) -> Option<Kind> {
    for (k, a) in logs.iter().enumerate() {
        if logs[..k].iter().any(|b| repeats(a, b)) {
            return Some(Kind::Commanded);
        }
    }
    let noisy = |log: &&&Log| log.torque.iter().zip(&log.q).filter(|(x, q)| is_noisy(x, q)).count();
    let all: usize = logs.iter().map(|log| log.torque.len()).sum();
    (2 * logs.iter().map(|log| noisy(&log)).sum::<usize>() > all).then_some(Kind::Measured)
}

/// Whether the torques of one log are those of another while its positions are not.
fn repeats(a: &Log, b: &Log) -> bool {
    let count = a.t.len().min(b.t.len());
    let same = |x: &[Vec<f64>], y: &[Vec<f64>]| {
        x.iter()
            .zip(y)
            .all(|(x, y)| x[..count].iter().zip(&y[..count]).filter(|(x, y)| x == y).count() > count * 9 / 10)
    };
    let changes = |x: &[f64]| x[..count].windows(2).filter(|w| w[0] != w[1]).count() > REPEATS;
    count > REPEATS && a.torque.iter().any(|x| changes(x)) && same(&a.torque, &b.torque) && !same(&a.q, &b.q)
}

/// Whether a torque has noise that is not that of the joint's position.
fn is_noisy(torque: &[f64], q: &[f64]) -> bool {
    let n = torque.len().min(20_000);
    if n < 100 {
        return false;
    }
    let third = |x: &[f64]| -> Vec<f64> {
        x[..n].windows(4).map(|w| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).collect()
    };
    let (t, q) = (third(torque), third(q));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let noise = dot(&t, &t);
    // White noise has twenty times its variance in third differences.
    let deviation = (noise / 20.0 / n as f64).sqrt();
    let rms = (dot(&torque[..n], &torque[..n]) / n as f64).sqrt();
    let follows = dot(&t, &q).powi(2) / (dot(&q, &q) * noise).max(f64::MIN_POSITIVE);
    deviation > NOISE * rms && follows < FOLLOWS
}
