//! The levels of a signal: coarse steps, and tops that are flat because something saturates.

use super::Severity;
use super::Warnings;

/// A saturated signal rests at its extreme at least so many samples one after another.
const FLAT: usize = 4;
/// … and for this share of the log in all.
const FLAT_SHARE: f64 = 2e-3;
/// … and so many times more often than just below it: a signal that turns there is at most 2.4 times as often
/// in its last step as in the one before.
const PILED: f64 = 4.0;
/// Fewer steps than these across what a signal covers are worth telling.
const STEPS_POSITION: f64 = 500.0;
const STEPS_EFFORT: f64 = 40.0;

/// Whether a torque or current signal never changes, or is cut off at an extreme.
pub(super) fn effort(x: &[f64], name: &str, warnings: &mut Warnings<'_>) {
    let (low, high) = x.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    if high - low <= 1e-12 * high.abs().max(low.abs()) {
        let message = "never changes: the joint's sensor or drive is dead, or it was not recorded";
        warnings.add(None, name.into(), message.into(), Severity::Warning);
        return;
    }
    for (edge, sign) in [(low, -1.0), (high, 1.0)] {
        let runs = x.chunk_by(|a, b| a == b).scan(0, |at, run| {
            *at += run.len();
            Some((*at - run.len(), run))
        });
        let flat: Vec<(usize, usize)> = runs
            .filter(|(_, run)| run[0] == edge && run.len() >= FLAT)
            .map(|(at, run)| (at, run.len()))
            .collect();
        let resting: usize = flat.iter().map(|(_, length)| length).sum();
        // The band below the edge: as wide as 2 % of the range, or to the next level.
        let next = x.iter().filter(|v| **v != edge).map(|v| sign * (edge - v)).fold(f64::INFINITY, f64::min);
        let width = (0.02 * (high - low)).max(1.001 * next);
        let below = x.iter().filter(|v| **v != edge && sign * (edge - **v) <= width).count();
        let piled = resting as f64 > PILED * below.max(1) as f64;
        if let Some((first, _)) = flat.first().filter(|_| edge != 0.0 && piled)
            && resting as f64 > FLAT_SHARE * x.len() as f64
        {
            let message = format!(
                "stays at its extreme {edge} for {resting} samples (first here): it looks saturated, and the \
                    model cannot explain torque that was not delivered"
            );
            warnings.add(Some(*first), name.into(), message, Severity::Warning);
        }
    }
}

/// Whether a signal has few levels.
pub(super) fn steps(x: &[f64], name: &str, position: bool, warnings: &mut Warnings<'_>) {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let range = sorted[sorted.len() - 1] - sorted[0];
    let least = if position { 0.05 } else { 0.0 };
    if range <= least {
        return;
    }
    let gaps = || sorted.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > 1e-9 * range);
    let step = gaps().fold(f64::INFINITY, f64::min);
    let count = range / step;
    // Every difference of levels is a number of steps, or there are none.
    let off = gaps().filter(|gap| (gap / step - (gap / step).round()).abs() > 0.1).count();
    let most = if position { STEPS_POSITION } else { STEPS_EFFORT };
    if count < most && off == 0 {
        let consequence = match position {
            true => "accelerations computed from it are mostly noise: log the encoder's full resolution",
            false => "errors below that step mean nothing",
        };
        let message = format!("has {:.0} levels, {step:.3e} apart: {consequence}", count + 1.0);
        warnings.add(None, name.into(), message, Severity::Warning);
    }
}
