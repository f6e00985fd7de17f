//! When the logs to judge on were recorded, where their times do not tell.
//!
//! Times that start anew in each file say nothing of when a file was recorded; the order of the files is taken for it, and the
//! logs of `--validate` then come after those of `--log`. But they may as well have been recorded in between (every other
//! repeat is held out, say). What warms up tells the two apart: the one that it fits is taken.

use super::evidence::{Path, path_gain};
use super::rule;
use super::screen::{Screen, Trial};
use crate::effects::{self, Candidate, Context};
use crate::estimate::{Design, Fit, friction_columns};
use crate::log::Log;
use crate::parallel;
use crate::regression::Data;

/// Said where the logs were taken to be recorded side by side.
pub(super) const BESIDE: &str = "the times of the logs start anew in each file: those of --validate are taken to have been recorded in between \
                                 those of --log, because what warms up fits that better than their order does";

/// Puts the logs of the other path beside the fitted ones where the order of the files is all that is known of their time and
/// that fits better. Returns whether it did.
pub(super) fn settle(
    logs: &[Log],
    validate: &[Log],
    data: &Data<'_>,
    fit: &Fit,
    other: &mut Data<'_>,
) -> bool {
    let known = |clock: f64| logs.iter().chain(validate).all(|log| (log.clock - clock).abs() < 1e-9);
    if logs.first().is_none_or(|first| known(first.clock)) {
        return false;
    }
    let Some(effect) = effects::all().into_iter().find(|e| e.name() == "temperature") else { return false };
    let first = other.recordings.iter().map(|r| r.clock).fold(f64::INFINITY, f64::min);
    let context = Context::new(data, fit, &fit.residual);
    let screen = Screen::new(&context);
    let candidates = effect.candidates(&context);
    let trials = parallel::map(&candidates, |c| screen.try_candidate(effect.as_ref(), c));
    // The best one of each joint.
    let mut best: Vec<(&Candidate, Trial)> = Vec::new();
    for (candidate, trial) in candidates.iter().zip(trials) {
        let Some(trial) = trial.filter(|t| t.score >= rule::LEAST_SCORE) else { continue };
        match best.iter_mut().find(|(c, _)| c.joints == candidate.joints) {
            Some((_, t)) if t.score >= trial.score => {}
            Some(known) => *known = (candidate, trial),
            None => best.push((candidate, trial)),
        }
    }
    if best.is_empty() {
        return false;
    }
    let residual = fit.residual_on(other, &[]);
    let gain = |other: &Data<'_>| -> f64 {
        let design = Design::new(other, &friction_columns(other, &fit.shapes), &[]);
        let path = Path { data: other, design, residual: residual.clone() };
        let context = Context::new(other, fit, &residual);
        let of = |(candidate, trial): &(&Candidate, Trial)| {
            let columns = effect.columns(&context, candidate);
            trial.score * path_gain(&screen, trial, &candidate.joints, &path, &columns).clamp(-1.0, 1.0)
        };
        best.iter().map(of).sum()
    };
    let after = gain(other);
    other.recordings.iter_mut().for_each(|r| r.clock -= first);
    if gain(other) > after {
        return true;
    }
    other.recordings.iter_mut().for_each(|r| r.clock += first);
    false
}
